"""A colour configuration of the user's own, which Blender reads of the variable OCIO."""

from __future__ import annotations

import json

import numpy as np

from blender_process import REGISTER_TREE, Blender

ACESCG_FROM_REC709 = np.array(
    [
        [0.6131324, 0.3395381, 0.0474166],
        [0.0701247, 0.9163940, 0.0134515],
        [0.0205876, 0.1095745, 0.8697854],
    ]
)
ACES_FROM_ACESCG = [0.6954522, 0.1406787, 0.1638691, 0, 0.0447946, 0.8596711, 0.0955343, 0]
ACES_FROM_ACESCG += [-0.0055259, 0.0040252, 1.0015007, 0, 0, 0, 0, 1]
ACES_FROM_REC709 = [0.4396330, 0.3829887, 0.1773783, 0, 0.0897764, 0.8134394, 0.0967841, 0]
ACES_FROM_REC709 += [0.0175412, 0.1115466, 0.8709123, 0, 0, 0, 0, 1]
CONFIGURATION = f"""ocio_profile_version: 2
environment: {{}}
search_path: luts
strictparsing: false
roles:
  aces_interchange: Interchange
  scene_linear: Our Working Space
  rendering: Our Working Space
  default: Our Working Space
  default_byte: Our Curve
  default_float: Our Working Space
  default_sequencer: Our Curve
  data: Our Data
  color_picking: Our Curve
  texture_paint: Our Curve
  matte_paint: Our Curve
  color_timing: Our Curve
  compositing_log: Our Curve
file_rules:
  - !<Rule> {{name: Default, colorspace: default}}
displays:
  sRGB:
    - !<View> {{name: Standard, colorspace: Our Curve}}
active_displays: [sRGB]
active_views: [Standard]
colorspaces:
  - !<ColorSpace>
    name: Interchange
    bitdepth: 32f
  - !<ColorSpace>
    name: Our Working Space
    bitdepth: 32f
    to_scene_reference: !<MatrixTransform> {{matrix: {ACES_FROM_ACESCG}}}
  - !<ColorSpace>
    name: Our Curve
    bitdepth: 32f
    to_scene_reference: !<GroupTransform>
      children:
        - !<ExponentWithLinearTransform> {{gamma: [2.4, 2.4, 2.4, 1], offset: [0.055, 0.055, 0.055, 0]}}
        - !<MatrixTransform> {{matrix: {ACES_FROM_REC709}}}
  - !<ColorSpace>
    name: Our Data
    bitdepth: 32f
    isdata: true
"""  # noqa: E501 - a line of its format
READ = (
    REGISTER_TREE
    + """
from glint.addon.export.images import colorspace
from glint.addon.export.images.images import Images
from glint.addon.export.report import Report
picture = bpy.data.images.new("i", 4, 4)
picture.generated_color = (0.8, 0.1, 0.05, 1.0)
picture.filepath_raw, picture.file_format = str(FOLDER / "i.png"), "PNG"
picture.save()
found = {}
for name in SPACES:
    picture = bpy.data.images.load(str(FOLDER / "i.png"))
    picture.colorspace_settings.name = name
    report = Report()
    pixels = Images(report).pixels(picture, None)
    values = colorspace.as_float(pixels.pixels)[0, 0, :3].astype(float)
    values = colorspace.srgb_to_linear(values) if pixels.encoding == "SRGB" else values
    found[name] = [values.tolist(), list(report.notes())]
answer([found, colorspace.luma(), colorspace.from_rec709().tolist(), list(bpy.app.version)])
"""
)
STORED = np.array([204, 26, 13]) / 255


def _read(folder, spaces: list[str]) -> tuple:
    run = Blender(folder).run(READ.replace("SPACES", json.dumps(spaces)))
    assert run.returncode == 0, run.output
    return run.answer


def _linear(values: np.ndarray) -> np.ndarray:
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def test_a_configuration_of_ones_own_is_blenders(tmp_path, monkeypatch):
    (tmp_path / "config.ocio").write_text(CONFIGURATION)
    monkeypatch.setenv("OCIO", str(tmp_path / "config.ocio"))
    spaces = ["Our Curve", "Our Working Space", "Our Data"]
    found, luma, from_rec709, _ = _read(tmp_path, spaces)
    assert all(not notes for _, notes in found.values()), found
    curve = ACESCG_FROM_REC709 @ _linear(STORED)
    np.testing.assert_allclose(found["Our Curve"][0], curve, rtol=2e-3)
    for name in ("Our Working Space", "Our Data"):
        np.testing.assert_allclose(found[name][0], STORED, rtol=1e-6)
    np.testing.assert_allclose(luma, (0.2722, 0.6741, 0.0537), atol=0.01)
    np.testing.assert_allclose(from_rec709, ACESCG_FROM_REC709, atol=2e-3)


def test_every_space_that_blender_offers_is_known(tmp_path, monkeypatch):
    monkeypatch.delenv("OCIO", raising=False)
    offered = "[e.identifier for e in ALL.bl_rna.properties['name'].enum_items]"
    program = READ.replace("SPACES", offered.replace("ALL", "picture.colorspace_settings"))
    run = Blender(tmp_path).run(program)
    assert run.returncode == 0, run.output
    found = run.answer[0]
    assert len(found) > 10
    assert {name: notes for name, (_, notes) in found.items() if notes} == {}


def test_roles_name_spaces(tmp_path, monkeypatch):
    """Of Blender's configuration, where it offers them."""
    monkeypatch.delenv("OCIO", raising=False)
    found, luma, *_, version = _read(tmp_path, ["sRGB"])
    np.testing.assert_allclose(found["sRGB"][0], _linear(STORED), rtol=1e-5)
    assert luma == [0.2126, 0.7152, 0.0722]
    if tuple(version) >= (5, 0, 0):
        found = _read(tmp_path, ["scene_linear"])[0]
        np.testing.assert_allclose(found["scene_linear"][0], STORED, rtol=1e-6)
        assert not found["scene_linear"][1]
