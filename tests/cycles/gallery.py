"""The manual's gallery: twelve scenes of ../shared/scenes in Glint and in Cycles, the same light in
both, with what each took.

    python tests/cycles/gallery.py [--only NAME …] [--reuse]

Writes docs/manual/gallery.md and docs/manual/pictures/<scene>.jpg, Glint on the left. Glint has the
settings of a user who chooses nothing, Cycles the same number of samples and bounces. Seconds are
the processor's, of all threads, so that other work on the machine is not in them. One process for
each scene and engine.
"""

# ruff: noqa: T201  (a command talks to a person)

from __future__ import annotations

import argparse
import csv
import json
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
import contact_scene  # noqa: E402
import glint_tree  # noqa: E402, F401  (makes the package importable as glint)

ROOT = HERE.parents[1]
SCENES = ROOT.parent / "shared" / "scenes"
PAGE, PICTURES = ROOT / "docs" / "manual" / "gallery.md", ROOT / "docs" / "manual" / "pictures"
KEPT = ROOT / "build" / "gallery"
SIDE, QUALITY, BOUNCES, DIFFUSE = 400, 85, 12, 4
SECONDS_ALLOWED = 590
CHOSEN = {
    "iso_room_ortho": "A parallel camera, area lights, 17 materials",
    "lights_all_types": "Sun, point, spot and area lights in one scene",
    "area_rect_interior": "An area light that shines through a hole into a box",
    "living_room": "A house from outside, its rooms by light that bounces",
    "occlusion_room": "A room with custom normals, lit by its doors",
    "FlightHelmet": "Leather, glass and metal from images",
    "ToyCar": "Clear coat, glass and cloth",
    "SheenChair": "Sheen of a fabric",
    "EmissiveStrengthTest": "Cubes that glow",
    "AlphaBlendModeTest": "Alpha: opaque, cut out, blended",
    "SimpleInstancing": "125 instances",
    "appleseed_particles": "An emitter that instances objects",
}
_HEAD = """# Gallery

Twelve scenes by other people, Glint on the left, Cycles on the right, with the same light in both:
{samples} samples a pixel, {diffuse} diffuse bounces, {bounces} of mirrors and glass, no denoiser,
the sRGB curve. Glint has the settings of who chooses nothing. Seconds are the processor's, of all
threads together and with Blender's own work, at {side} pixels; only their ratios mean something.
`make gallery` draws them anew, where the scenes lie beside this folder.
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--reuse", action="store_true", help="keep pictures of an earlier run")
    parser.add_argument("--worker", nargs=3, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        return work(*options.worker)
    if not SCENES.is_dir():
        raise SystemExit(f"{SCENES} is not there: the gallery draws the shared scenes")
    KEPT.mkdir(parents=True, exist_ok=True)
    PICTURES.mkdir(parents=True, exist_ok=True)
    with (SCENES / "MANIFEST.csv").open(newline="") as table:
        entries = {row["file"].split("/")[0]: row for row in csv.DictReader(table)}
    for name in options.only or CHOSEN:
        draw(name, SCENES / entries[name]["file"], options.reuse)
    PAGE.write_text(page(entries), encoding="utf-8")
    return 0


def draw(name: str, source: Path, reuse: bool) -> None:
    """Both pictures, and the two side by side as a JPEG."""
    for engine in ("GLINT", "CYCLES"):
        stem = KEPT / f"{name}_{engine.lower()}"
        if not (reuse and stem.with_suffix(".json").exists()):
            command = [sys.executable, __file__, "--worker", str(source), str(stem), engine]
            subprocess.run(command, check=True, timeout=SECONDS_ALLOWED, stdout=subprocess.DEVNULL)
    pair = [np.load(KEPT / f"{name}_{engine}.npy") for engine in ("glint", "cycles")]
    gap = np.ones((pair[0].shape[0], 8, 3), np.float32)
    shown = [np.flipud(encoded(picture)) for picture in pair]
    write_jpeg(PICTURES / f"{name}.jpg", np.concatenate([shown[0], gap, shown[1]], 1))
    print(name, *(seconds(name, engine) for engine in ("glint", "cycles")), flush=True)


def encoded(picture: np.ndarray) -> np.ndarray:
    """(h, w, 3) as a display shows it, before grey where it is transparent."""
    from glint.engine.analysis.flip import displayed

    return displayed(picture).astype(np.float32)


def write_jpeg(path: Path, pixels: np.ndarray) -> None:
    """pixels: (h, w, 3), 0 to 1, row 0 on top."""
    import OpenImageIO as oiio

    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], 3, oiio.UINT8)
    spec.attribute("Compression", f"jpeg:{QUALITY}")
    output = oiio.ImageOutput.create(str(path))
    rounded = np.rint(np.clip(pixels, 0, 1) * 255).astype(np.uint8)
    if not (output and output.open(str(path), spec) and output.write_image(rounded)):
        raise OSError(f"{path} cannot be written: {oiio.geterror()}")
    output.close()


def seconds(name: str, engine: str) -> float:
    return json.loads((KEPT / f"{name}_{engine}.json").read_text())["seconds"]


def page(entries: dict[str, dict[str, str]]) -> str:
    """The page of what is there."""
    from glint.engine.settings import OFFERED

    text = _HEAD.format(samples=OFFERED.samples, diffuse=DIFFUSE, bounces=BOUNCES, side=SIDE)
    for name, what in CHOSEN.items():
        if not (KEPT / f"{name}_cycles.json").exists():
            continue
        entry = entries[name]
        times = f"Glint {seconds(name, 'glint'):.1f} s, Cycles {seconds(name, 'cycles'):.1f} s"
        credit = credit_of(name, entry)
        text += (
            f"\n## {name}\n\n{what}. {times}.\n\n![{name} in Glint and in Cycles]"
            f"(pictures/{name}.jpg)\n\n*{credit}; {entry['licence'].split(' (')[0]}*  \n"
            f"<https://github.com/{entry['source_repo']}>\n"
        )
    return text


def credit_of(name: str, entry: dict[str, str]) -> str:
    """Who made a scene: the manifest's word, or that of the list beside a glTF model."""
    if "metadata.json" not in entry["credit"]:
        return entry["credit"].strip()
    legal = json.loads((SCENES / name / "metadata.json").read_text(encoding="utf-8"))["legal"]
    return ", ".join(dict.fromkeys(part["artist"] for part in legal))


def work(source: str, stem: str, engine: str) -> int:
    """One picture, in linear float32."""
    contact_scene.LONG_SIDE = SIDE
    scene = contact_scene.prepare(source)
    import glint
    from glint.engine.settings import OFFERED
    from glint.operators.compare_cycles import match_cycles

    if engine == "GLINT":
        glint.register()
        scene.render.engine = "GLINT"
    else:
        match_cycles(scene, OFFERED.samples, BOUNCES, diffuse=DIFFUSE)
        scene.cycles.use_light_tree = True  # as it is by default: less noise of many lamps
    import cycles_reference

    start = processor_seconds()
    picture = cycles_reference.render_passes(scene)["Combined"]
    took = processor_seconds() - start
    np.save(f"{stem}.npy", picture)
    Path(f"{stem}.json").write_text(json.dumps({"seconds": round(took, 2)}))
    return 0


def processor_seconds() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    sys.exit(main())
