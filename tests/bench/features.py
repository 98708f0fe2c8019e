"""What features cost a pixel in instructions, where rays meet them and where none does, counted by
callgrind against the recorded counts.

    python tests/bench/features.py [--record] [--program build/bench/bench/pipeline_counts]

Runs engine/core/bench/pipeline_counts on its fixed scenes as instructions.py does ray_counts. A
scene called "… beside" is the plain one with something that no ray meets, or with a setting that
nothing reads; a lens of no size and frames of a camera that rests draw the plain one the long way.
What moves otherwise is a scene of its own for each sample. Those of `FREE` must cost what the plain
scene costs: this holds for any compiler. Scenes of one light without shadows tell what a sample of
each kind of light costs. Exit code 1 when a feature is not free, or when a count is more than 5 %
above features.json; --record renews that file.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import sys
from pathlib import Path

from instructions import grown, measure
from ray_tables import table

RECORDED = Path(__file__).with_name("features.json")
FREE = ("mirror beside", "glass beside", "texture beside", "4 light samples beside")
SCENES = (
    "plain", *FREE, "highlights beside", "lobes beside", "alpha beside", "sphere beside",
    "highlights", "lobes", "texture", "alpha", "mirror", "glass", "soft light, 4 samples",
    "smooth", "smooth beside", "offsets beside", "hair beside", "medium beside",
    "middle of a lens", "resting camera frames",
)  # fmt: skip
SOFT_LIGHTS = ("sun", "sphere", "disc", "rectangle", "near rectangle", "ellipse")
"""Scenes of one light of 4 samples that casts no shadow; beside them, one without a light."""
FREE_WITHIN = 1e-3


def main() -> int:
    found = measure(__doc__, RECORDED, "pipeline_counts", (*SCENES, "no light", *SOFT_LIGHTS))
    if not found:
        return 0
    measured, recorded, renewed = found
    print(features_table(measured.per_item, recorded.per_item))
    print(light_samples_table(measured.per_item, recorded.per_item))
    same = measured.compiler == recorded.compiler and not renewed
    worse = [
        *not_free(measured.per_item),
        *(grown(measured.per_item, recorded.per_item) if same else []),
    ]
    print(
        "\n".join(worse)
        or "nothing is paid for what a scene does not have"
        + ("" if same else "; growth is not judged")
    )
    return int(bool(worse))


def not_free(measured: dict[str, float]) -> list[str]:
    """A line per feature that costs something where no ray meets it."""
    plain = measured["plain"]
    return [
        f"{scene}: {measured[scene] / plain - 1:+.2%} of the plain scene"
        for scene in FREE
        if measured[scene] > (1 + FREE_WITHIN) * plain
    ]


def features_table(measured: dict[str, float], recorded: dict[str, float]) -> str:
    rows = [("instructions a pixel", "now", "over plain", "recorded")]
    for scene, value in measured.items():
        known = recorded.get(scene)
        rows.append(
            (
                scene,
                f"{value:.0f}",
                f"{value / measured['plain'] - 1:+.2%}",
                f"{known:.0f}" if known else "-",
            )
        )
    return table(rows)


def light_samples_table(measured: dict[str, float], recorded: dict[str, float]) -> str:
    """What a pixel pays for a sample of each kind of light, but for its shadow ray."""

    def one_sample(counts: dict[str, float], kind: str) -> str:
        return f"{(counts[kind] - counts['no light']) / 4:.0f}" if kind in counts else "-"

    rows = [("instructions a light sample", "now", "recorded")]
    return table(
        rows
        + [(kind, one_sample(measured, kind), one_sample(recorded, kind)) for kind in SOFT_LIGHTS]
    )


if __name__ == "__main__":
    sys.exit(main())
