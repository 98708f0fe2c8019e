"""Film → Blender's render result: which passes a view layer asks for, what Blender calls them, and
how they are filled.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import bpy
import numpy as np

from ... import engine
from ..export import aovs_of
from ..export.light_groups import LightGroups
from ..export.report import Note, Report
from .compositor import linked_outputs

BLENDER_SWITCHES = {
    "Depth": "use_pass_z",
    "Position": "use_pass_position",
    "Normal": "use_pass_normal",
    "UV": "use_pass_uv",
    "Object Index": "use_pass_object_index",
    "Material Index": "use_pass_material_index",
    "Emission": "use_pass_emit",
    "Environment": "use_pass_environment",
    "Mist": "use_pass_mist",
    "Vector": "use_pass_vector",
    "Ambient Occlusion": "use_pass_ambient_occlusion",
    "Crypto Object": "use_pass_cryptomatte_object",
    "Crypto Material": "use_pass_cryptomatte_material",
    "Crypto Asset": "use_pass_cryptomatte_asset",
}
"""Passes that Blender's own view layer properties switch on."""

LIGHT_SWITCHES = {name: f"use_pass_{name.lower().replace(' ', '_')}" for name in engine.BY_SURFACE}
"""The same of light by the surface that gives it back."""

PART_SWITCHES = {
    name: f"use_pass_{name.lower()}"
    for name in ("Diffuse", "Specular", "Ambient", "Shadow", "Mirror")
}
"""Parts of the picture that `view_layer.glint` switches on."""

HEALTH_SWITCHES = {
    name: f"use_pass_{name.lower()}"
    for name in ("Error", "Samples", "Cost", "Grazing", "Gap", "Fallbacks")
}
"""Passes about the render itself that `view_layer.glint` switches on."""

GLINT_SWITCHES = PART_SWITCHES | HEALTH_SWITCHES

_NAMES_BEFORE_5_0 = {
    "Object Index": "IndexOB",
    "Material Index": "IndexMA",
    "Emission": "Emit",
    "Environment": "Env",
    "Ambient Occlusion": "AO",
    "Volume Direct": "VolumeDir",
    "Volume Indirect": "VolumeInd",
    **{
        f"{surface} {what}": short + what[:3]
        for surface, short in {
            "Diffuse": "Diff",
            "Glossy": "Gloss",
            "Transmission": "Trans",
        }.items()
        for what in ("Direct", "Indirect", "Color")
    },
}
_CHANNELS = {
    "Combined": "RGBA",
    "Depth": "Z",
    "Position": "XYZ",
    "Normal": "XYZ",
    "UV": "UVA",
    "Object Index": "X",
    "Material Index": "X",
    "Mist": "Z",
    "Vector": "XYZW",
    "Denoising Normal": "XYZ",
    "Denoising Depth": "Z",
    **dict.fromkeys(HEALTH_SWITCHES, "X"),
}
_KINDS = {
    "Z": "VALUE",
    "X": "VALUE",
    "XYZ": "VECTOR",
    "XYZW": "VECTOR",
    "UVA": "VECTOR",
    "RGB": "COLOR",
    "RGBA": "COLOR",
}


CYCLES_SWITCHES = {
    "Volume Direct": "use_pass_volume_direct",
    "Volume Indirect": "use_pass_volume_indirect",
    engine.CATCHER: "use_pass_shadow_catcher",
}
"""Passes that properties of Cycles' view layers switch on, where its add-on is on."""

_GROUP = "Combined_"
"""What Cycles' passes of light groups begin with."""

DENOISING = "denoising_store_passes"
"""Cycles' property of view layers that switches on all of `engine.DENOISING`."""

_BEFORE_DENOISING = {"Noisy Image": "Combined", "Noisy Shadow Catcher": engine.CATCHER}
"""Cycles' passes of what it denoises, and what they are where nothing is."""


def wanted_passes(view_layer: bpy.types.ViewLayer) -> frozenset[str]:
    """Names from `engine.PASSES` that are switched on, Combined always among them."""
    switches = BLENDER_SWITCHES | LIGHT_SWITCHES
    blenders = {name for name, switch in switches.items() if getattr(view_layer, switch)}
    ours = {name for name, switch in GLINT_SWITCHES.items() if getattr(view_layer.glint, switch)}
    cycles = getattr(view_layer, "cycles", None)
    theirs = {name for name, switch in CYCLES_SWITCHES.items() if getattr(cycles, switch, False)}
    denoising = engine.DENOISING if getattr(cycles, DENOISING, False) else ()
    return frozenset({"Combined", *denoising} | blenders | ours | theirs)


def crypto_ids(view_layer: bpy.types.ViewLayer) -> int:
    """How many things Cryptomatte passes tell of a pixel: two a pass of Blender's."""
    return -(-view_layer.pass_cryptomatte_depth // 2) * 2


def _crypto_name(name: str, number: int) -> str:
    return f"{name.replace(' ', '')}{number:02d}"


def blender_name(name: str) -> str:
    """What this Blender calls a pass; 5.0 renamed some."""
    return name if bpy.app.version >= (5, 0, 0) else _NAMES_BEFORE_5_0.get(name, name)


def channel_names(name: str, count: int) -> list[str]:
    """Of a film's pass in picture files: those that Blender 5 gives it, but that AOVs and light
    groups keep their films' names.
    """
    if name in engine.CRYPTOMATTES:
        return [f"{_crypto_name(name, k // 4)}.{'rgba'[k % 4]}" for k in range(count)]
    letters = _CHANNELS.get(name, {1: "X", 3: "RGB", 4: "RGBA"}[count])
    return [f"{name}.{letter}" for letter in letters]


def register_passes(
    render_engine: bpy.types.RenderEngine, scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> None:
    """Tell Blender which passes this view layer will get."""
    for name, channels in _passes_of(scene, view_layer):
        kind = _KINDS[channels.upper()]
        render_engine.register_pass(scene, view_layer, name, len(channels), channels, kind)


def unrendered_outputs(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> tuple[Note, ...]:
    """A note of the passes that a compositor takes and this view layer does not get."""
    report, there = Report(), {name for name, _ in _passes_of(scene, layer)}
    for name, node in linked_outputs(scene, layer.name).items():
        if name not in there:
            report.note(
                "Outputs of Render Layers nodes that are linked and not rendered hold nothing: {}; "
                "turn the pass on in View Layer properties, or unlink it",
                f"{node}: {name}",
            )
    return report.notes()


def _passes_of(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> Iterator[tuple[str, str]]:
    """Blender's names of a view layer's passes and their channels, in the order of
    `engine.PASSES`.
    """
    wanted = wanted_passes(view_layer)
    for name in engine.PASSES:
        if name in engine.CRYPTOMATTES and name in wanted:
            for number in range(crypto_ids(view_layer) // 2):
                yield _crypto_name(name, number), "rgba"
        elif name in wanted:
            yield blender_name(name), _CHANNELS.get(name, "RGB")
    linked = linked_outputs(scene, view_layer.name)
    if wanted.issuperset(engine.DENOISING):
        linked["Noisy Image"] = ""
    for name, same in _BEFORE_DENOISING.items():
        if name in linked and same in wanted:
            yield name, _CHANNELS.get(same, "RGB")
    for aov in aovs_of(view_layer):
        yield aov.name, "X" if aov.is_value else "RGBA"
    for name in LightGroups.of(view_layer).names:
        yield _GROUP + name, "RGB"


class Picture:
    """The render result of one view layer in one view; Blender's part begins with the first film,
    so that an error before it leaves nothing.

    size: (width, height) of the result, that is of the border if there is one. view: "" for the
    only one.
    """

    def __init__(
        self,
        render_engine: bpy.types.RenderEngine,
        layer: str,
        size: tuple[int, int],
        view: str = "",
    ) -> None:
        self._engine = render_engine
        self._layer, self._view = layer, view
        self._size = size
        self._result = None

    def show(self, film: engine.Film) -> None:
        """Fill Combined with a wave of the film and let Blender draw it."""
        self._fill(film, ("Combined",))
        self._engine.update_result(self._result)

    def finish(self, film: engine.Film) -> None:
        """Fill every pass and hand the result over."""
        if bpy.app.background:
            self._finish_unseen(film)
        else:
            self._fill(film, tuple(film.passes))
            self._end(cancel=False)

    def _finish_unseen(self, film: engine.Film) -> None:
        """Straight into the whole result, for which the end of any part of it makes room: a part of
        its size would be copied once more.
        """
        self._begin(1, 1)
        self._end(cancel=False)
        whole = self._engine.get_result()
        passes = whole.layers[self._layer].passes
        if self._view:
            number = [view.name for view in whole.views].index(self._view)
            passes = [some for some in passes if some.view_id == number]
        _fill_passes(passes, film, tuple(film.passes))

    def stamp(self, title: str, fields: dict[str, str]) -> None:
        """Make metadata of the files, as glint.<title>.<field>; after `finish`."""
        whole = self._engine.get_result()
        for field, value in fields.items():
            whole.stamp_data_add_field(f"glint.{title}.{field}", value)

    def describe(self, manifests: dict[str, str]) -> None:
        """Make Cryptomatte's metadata of the files: of each pass its manifest; after `finish`."""
        whole = self._engine.get_result()
        for name, manifest in manifests.items():
            title = f"{self._layer}.{name.replace(' ', '')}"
            for field, value in engine.crypto_metadata(title, manifest).items():
                whole.stamp_data_add_field(field, value)

    def discard(self) -> None:
        """Throw away what was begun."""
        if self._result is not None:
            self._end(cancel=True)

    def _fill(self, film: engine.Film, names: tuple[str, ...]) -> None:
        if self._result is None:
            self._begin(*self._size)
        _fill_passes(self._result.layers[0].passes, film, names)

    def _begin(self, width: int, height: int) -> None:
        of_view = {"view": self._view} if self._view else {}
        self._result = self._engine.begin_result(0, 0, width, height, layer=self._layer, **of_view)

    def _end(self, cancel: bool) -> None:
        self._engine.end_result(self._result, cancel=cancel)
        self._result = None


def _fill_passes(
    passes: Iterable[bpy.types.RenderPass], film: engine.Film, names: tuple[str, ...]
) -> None:
    """Passes that Blender has not are left out."""
    numbers = {
        known: values for name in names for known, values in _blenders(name, film.passes[name])
    }
    for target in passes:
        if target.name in numbers:
            values = numbers[target.name][..., : target.channels]
            target.rect.foreach_set(np.ascontiguousarray(values, dtype=np.float32).ravel())


def _blenders(name: str, values: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Blender's passes for one of ours."""
    if name.startswith(engine.AOV):
        yield name.removeprefix(engine.AOV), values
        return
    if name.startswith(engine.LIGHT_GROUP):
        yield _GROUP + name.removeprefix(engine.LIGHT_GROUP), values
        return
    if name not in engine.CRYPTOMATTES:
        yield blender_name(name), values
        yield from ((same, values) for same, own in _BEFORE_DENOISING.items() if own == name)
        return
    for number in range(values.shape[-1] // 4):
        yield _crypto_name(name, number), values[..., 4 * number : 4 * number + 4]
