"""The IES Texture: a luminaire's photometric web, looked up by direction."""

from __future__ import annotations

import hashlib
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ....engine.program.graph import Value
from ....engine.scene import Texture
from ..photometry import UNREADABLE, PhotometryError, read_web
from .reader import READERS, NodeInputs, Outputs


def _ies(view: NodeInputs) -> Outputs:
    """Straight down is −z of the vector, its azimuth counts from −y to −x, as in Cycles. Without a
    link it is the way to where the light is seen from.
    """
    given = view.value("Vector") if view.is_linked("Vector") else view.reader.object_incoming()
    power = _power(view, view.apply("vector_normalized", given)[0])
    factor = view.math("MULTIPLY", view.value("Strength"), power)
    return {"Fac": factor, "Factor": factor}


def _power(view: NodeInputs, unit: Value) -> Value:
    try:
        text = _text(view.node)
        table = _table(text)
    except (PhotometryError, OSError) as error:
        view.reader.note(
            f"The IES texture {_name(view.node)!r} of {{}} cannot be read ({error}): it is the "
            "same in every direction; choose another file"
        )
        return view.reader.graph.constant(UNREADABLE)
    rows, columns = table.shape
    x, y, z = view.apply("separate_xyz", unit)
    do = view.math
    down = do("ARCCOSINE", do("MULTIPLY", z, -1.0))
    u = do("MULTIPLY_ADD", do("ARCTAN2", x, y), 0.5 / math.pi, 0.5 + 0.5 / columns)
    v = do("MULTIPLY_ADD", down, (rows - 1) / rows / math.pi, 0.5 / rows)
    where = do.plane(u, v)
    key = ("IES", hashlib.sha256(text.encode()).hexdigest())
    texture = view.reader.images.made(key, lambda: _texture(_name(view.node), table))
    return view.apply("separate_xyz", view.apply("image", where, texture=texture)[0])[0]


def _text(node: Any) -> str:
    if node.mode == "INTERNAL":
        if node.ies is None:
            raise PhotometryError("no text is chosen")
        return node.ies.as_string()
    library = getattr(node.id_data, "library", None)
    path = Path(bpy.path.abspath(node.filepath, library=library))
    if not path.is_file():
        raise PhotometryError("there is no such file")
    return path.read_text("latin-1")


def _name(node: Any) -> str:
    if node.mode == "INTERNAL":
        return node.ies.name if node.ies is not None else ""
    return Path(node.filepath).name


@lru_cache(maxsize=8)
def _table(text: str) -> np.ndarray:
    return read_web(text).table()


def _texture(name: str, table: np.ndarray) -> Texture:
    pixels = np.ones((*table.shape, 4), np.float32)
    pixels[..., :3] = table[..., None]
    return Texture(name, pixels)


READERS["ShaderNodeTexIES"] = _ies
