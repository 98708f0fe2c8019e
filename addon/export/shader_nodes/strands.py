"""Nodes that read hair, points of clouds, and particles, of which nothing is known here: as Cycles
gives them of what is neither.
"""

from __future__ import annotations

import bpy
import numpy as np

from ....engine.program.graph import Value
from ....engine.program.operations_input import Space, VectorType
from ....engine.program.operations_vector import VectorMeasure, VectorOperation
from ..geometry.hashing import random_of
from .reader import FIBRE, HAIR, POINT_PLACE, POINT_SHAPE, READERS, NodeInputs, Outputs

_RANDOM = float(random_of(*np.zeros((2, 1), np.uint32))[0])
"""Of the particle 0."""


def _particle_info(view: NodeInputs) -> Outputs:
    if len(bpy.data.particles):
        view.reader.note("Particle Info is not known in {}: it is as where there are no particles")
    constant = view.reader.graph.constant
    vectors = dict.fromkeys(("Location", "Velocity", "Angular Velocity"), constant((0.0,) * 3))
    numbers = dict.fromkeys(("Index", "Age", "Lifetime", "Size"), constant(0.0))
    return {**vectors, **numbers, "Random": constant(_RANDOM)}


def _hair_info(view: NodeInputs) -> Outputs:
    told, strand = view.apply("attribute", attribute=HAIR, shift=0)
    intercept, length, random = view.apply("separate_xyz", told)
    thickness = view.apply("attribute", attribute=FIBRE, shift=0)[1]
    return {
        "Is Strand": strand,
        "Intercept": intercept,
        "Length": length,
        "Random": random,
        "Thickness": thickness,
        "Tangent Normal": across_fibre(view),
    }


def _point_info(view: NodeInputs) -> Outputs:
    """Zeros of what is no point of a cloud."""
    place, is_point = view.apply("attribute", attribute=POINT_PLACE, shift=0)
    told = view.apply("attribute", attribute=POINT_SHAPE, shift=0)[0]
    radius, random, _ = view.apply("separate_xyz", told)
    spaces = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}

    def moved(vector: Value, kind: VectorType) -> Value:
        return view.apply("transform_vector", vector, vector_type=kind, **spaces)[0]

    size = view.apply("vector_length", moved(view.vector_of(radius), VectorType.VECTOR))[0]
    position = view.apply("product", view.vector_of(is_point), moved(place, VectorType.POINT))[0]
    return {
        "Position": position,
        "Radius": view.math("MULTIPLY", size, 3.0**-0.5),
        "Random": random,
    }


def across_fibre(view: NodeInputs) -> Value:
    """The unit normal of a strand that faces the viewer: what is across the tangent of the
    direction to him; zero of what is no strand.
    """
    along = fibre(view)
    to_viewer = view.apply("incoming")[0]
    share = view.apply("vector_measure", along, to_viewer, measure=VectorMeasure.DOT_PRODUCT)[0]
    off = view.apply("product", view.vector_of(share), along)[0]
    zero = view.reader.graph.constant(0.0)
    subtract = VectorOperation.SUBTRACT
    rest = view.apply("vector_math", to_viewer, off, off, zero, operation=subtract)[0]
    is_strand = view.apply("attribute", attribute=HAIR, shift=0)[1]
    across = view.apply("vector_normalized", rest)[0]
    return view.apply("product", view.vector_of(is_strand), across)[0]


def fibre(view: NodeInputs) -> Value:
    """The unit tangent of a strand in the world; zero of what is none."""
    tangent = view.apply("attribute", attribute=FIBRE, shift=0)[0]
    spaces = {"convert_from": Space.OBJECT, "convert_to": Space.WORLD}
    turned = view.apply("transform_vector", tangent, vector_type=VectorType.VECTOR, **spaces)[0]
    return view.apply("vector_normalized", turned)[0]


READERS["ShaderNodeParticleInfo"] = _particle_info
READERS["ShaderNodeHairInfo"] = _hair_info
READERS["ShaderNodePointInfo"] = _point_info
