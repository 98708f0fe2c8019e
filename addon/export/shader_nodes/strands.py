"""Nodes that read particles and hair, of which nothing is known here: as Cycles gives them of what
is neither.
"""

from __future__ import annotations

import bpy
import numpy as np

from ..hashing import random_of
from .reader import READERS, NodeInputs, Outputs

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
    constant = view.reader.graph.constant
    names = ("Is Strand", "Intercept", "Length", "Thickness", "Random")
    return {**dict.fromkeys(names, constant(0.0)), "Tangent Normal": constant((0.0,) * 3)}


READERS["ShaderNodeParticleInfo"] = _particle_info
READERS["ShaderNodeHairInfo"] = _hair_info
