"""What lobes read, in the native core, against closed forms: images and attributes."""

from __future__ import annotations

import numpy as np
import pytest

from glint.engine import scene as s
from glint.engine.native.packer import Packer
from glint.engine.native.packing_materials import pack_material
from glint.engine.program.graph import Graph
from glint.engine.program.program import compile_program
from glint.engine.program.table import BY_NAME
from native_tools import (
    color,
    needs_core,
    square,
)
from surface_scenes import ROUNDING, P, agree, plane

pytestmark = needs_core


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
TEXELS = np.array(
    [[[10, 20, 30, 255], [200, 100, 50, 0]], [[0, 255, 128, 51], [90, 91, 92, 102]]], np.uint8
)


def sampled(
    pixels: np.ndarray, u: np.ndarray, v: np.ndarray, extension: str, interpolation: str
) -> np.ndarray:
    """(..., 4) texels of (h, w, 4) values, written for clarity."""
    h, w = pixels.shape[:2]

    def texel(i: np.ndarray, j: np.ndarray) -> np.ndarray:
        outside = (i < 0) | (i >= w) | (j < 0) | (j >= h)
        if extension == "MIRROR":
            i, j = (
                np.abs(((i + w) % (2 * w)) - w + 0.5) - 0.5,
                np.abs(((j + h) % (2 * h)) - h + 0.5) - 0.5,
            )
        i, j = (
            (i % w, j % h)
            if extension == "REPEAT"
            else (np.clip(i, 0, w - 1), np.clip(j, 0, h - 1))
        )
        value = pixels[j.astype(int), i.astype(int)]
        return np.where((outside & (extension == "CLIP"))[..., None], 0, value)

    if interpolation == "CLOSEST":
        return texel(np.floor(u * w), np.floor(v * h))
    i, j = np.floor(u * w - 0.5), np.floor(v * h - 0.5)
    s_, t = (u * w - 0.5 - i)[..., None], (v * h - 0.5 - j)[..., None]
    return (1 - t) * ((1 - s_) * texel(i, j) + s_ * texel(i + 1, j)) + t * (
        (1 - s_) * texel(i, j + 1) + s_ * texel(i + 1, j + 1)
    )


def decode(codes: np.ndarray, encoding: str) -> np.ndarray:
    """Filtered codes from 0 to 1 as linear values."""
    c = codes.copy()
    if encoding == "SRGB":
        c[..., :3] = np.where(
            c[..., :3] <= 0.04045, c[..., :3] / 12.92, ((c[..., :3] + 0.055) / 1.055) ** 2.4
        )
    return c


@pytest.mark.parametrize("channel", ["COLOR", "ALPHA", "LUMINANCE"])
@pytest.mark.parametrize("interpolation", ["LINEAR", "CLOSEST"])
@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize("encoding", ["LINEAR", "SRGB"])
def test_texture(encoding: str, extension: str, interpolation: str, channel: str) -> None:
    transform = ((21.0, 3.0, -11.1), (-4.0, 17.0, -6.3))
    texture = s.Texture("texels", TEXELS, encoding, extension, interpolation)
    lobe = s.Lobe("EMISSION", (s.Input((2.0, 1.0, 0.5), 0, channel, uv_transform=transform),))
    picture = color(plane(lobe, lights=(), textures=(texture,)))
    u, v = (P[..., 0] + 5) / 10, (P[..., 1] + 5) / 10
    (a, b, c), (d, e, f) = transform
    codes = sampled(TEXELS / 255.0, a * u + b * v + c, d * u + e * v + f, extension, interpolation)
    rgba = decode(codes, encoding)
    rgb = {
        "COLOR": rgba[..., :3],
        "ALPHA": rgba[..., 3:],
        "LUMINANCE": rgba[..., :3] @ LUMINANCE[:, None],
    }[channel]
    # The float32 UVs of the corners are exact here; uv is then good to 1e-15 of a texel.
    assert np.abs(picture - rgb * [2.0, 1.0, 0.5]).max() <= 2 * ROUNDING


def test_float_texture_and_coordinates_out_of_all_bounds() -> None:
    pixels = np.array([[[5.0, 1e10, -1.0, 0.5]]], np.float32)
    lobe = s.Lobe("EMISSION", (s.Input(texture=0, uv_transform=((1e300, 0, 0), (0, 1, 0))),))
    agree(
        color(plane(lobe, lights=(), textures=(s.Texture("one", pixels),))),
        np.broadcast_to([5.0, 1e10, -1.0], (16, 16, 3)),
    )


@pytest.mark.parametrize("domain", [s.POINT, s.CORNER, s.FACE])
def test_attributes(domain: str) -> None:
    rows = {s.POINT: 4, s.CORNER: 6, s.FACE: 2}[domain]
    values = np.random.default_rng(3).random((rows, 4), np.float32)
    base = square(1.0)
    corners = np.arange(6, dtype=np.uint32).reshape(2, 3)
    mesh = s.Mesh(
        "painted",
        base.vertices,
        base.triangles,
        corners,
        attributes=(s.Attribute("paint", domain, values),),
    )
    picture = color(plane(s.Lobe("EMISSION", (s.Input(attribute="paint"),)), lights=(), mesh=mesh))
    u, v = (P[..., 0] + 1) / 2, (P[..., 1] + 1) / 2
    below = (v <= u)[..., None]
    if domain == s.FACE:
        truth = np.where(below, values[0], values[1])
    else:
        row = base.triangles if domain == s.POINT else corners
        weights = (np.stack([1 - u, u - v, v], -1), np.stack([1 - v, u, v - u], -1))
        truth = np.where(
            below, *[w @ values[r].astype(float) for w, r in zip(weights, row, strict=True)]
        )
    agree(picture, truth[..., :3], 2 * ROUNDING)
    alpha = color(
        plane(
            s.Lobe("EMISSION", (s.Input(attribute="paint", attribute_channel="ALPHA"),)),
            lights=(),
            mesh=mesh,
        )
    )
    agree(alpha, np.repeat(truth[..., 3:], 3, -1), 2 * ROUNDING)
    grey = s.Lobe("EMISSION", (s.Input(attribute="paint", attribute_channel="LUMINANCE"),))
    told = np.repeat(truth[..., :3] @ LUMINANCE[:, None], 3, -1)
    agree(color(plane(grey, lights=(), mesh=mesh)), told, 2 * ROUNDING)
    assert (
        color(plane(s.Lobe("EMISSION", (s.Input(attribute="none"),)), lights=(), mesh=mesh)).max()
        == 0
    )


def test_equal_programs_are_packed_once():
    def shown(value: float) -> s.Material:
        graph = Graph()
        x = graph.apply(BY_NAME["position"], shift=0)[0]
        moved = graph.apply(BY_NAME["product"], x, graph.constant((value, 1.0, 1.0)))
        return s.Material("shown", (s.Lobe("DIFFUSE"),), program=compile_program(graph, moved))

    packer = Packer()
    rows = [pack_material(packer, shown(value)) for value in (2.0, 3.0, 2.0, 4.0, 3.0)]
    assert [row[3] for row in rows] == [1, 2, 1, 3, 2]
    assert len(packer.programs) == 3 and len(packer.constants) == 3 * 3
