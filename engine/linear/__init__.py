"""The linear algebra of the lecture notes (sections 2 and 5-7), in float64, vectorised over leading
axes.

Conventions: vectors are columns, so `a_from_c = a_from_b @ b_from_c`; the columns of a basis are
its vectors; angles are in radians. Matrices of the notes are homogeneous, (n + 1, n + 1); the
placements of `engine.scene` are their upper three rows, (3, 4).
"""

from .barycentric import (
    barycentric_by_areas,
    barycentric_by_solve,
    interpolate,
    is_inside,
    triangle_area,
)
from .decompositions import Inverse, affine_inverse, inverse, pseudo_inverse, svd, symmetric_eigen
from .frames import (
    basis_from_vector,
    basis_from_vectors,
    canonical_from_frame,
    coordinates_in,
    gram_schmidt,
    rigid_inverse,
)
from .transforms import (
    affine,
    homogeneous,
    normal_matrix,
    reflect,
    rotate,
    rotate_2d,
    rotate_by_frame,
    rotate_x,
    rotate_y,
    rotate_z,
    scale,
    shear,
    transform_directions,
    transform_normals,
    transform_points,
    translate,
    window,
)
from .vectors import (
    angle_between,
    cross,
    determinant,
    dot,
    length,
    lerp,
    piecewise_linear,
    project,
    projected_length,
    unit,
)
from .viewing import (
    camera_basis,
    camera_from_world,
    orthographic,
    perspective,
    viewport,
)

__all__ = [
    "Inverse",
    "affine",
    "affine_inverse",
    "angle_between",
    "barycentric_by_areas",
    "barycentric_by_solve",
    "basis_from_vector",
    "basis_from_vectors",
    "camera_basis",
    "camera_from_world",
    "canonical_from_frame",
    "coordinates_in",
    "cross",
    "determinant",
    "dot",
    "gram_schmidt",
    "homogeneous",
    "interpolate",
    "inverse",
    "is_inside",
    "length",
    "lerp",
    "normal_matrix",
    "orthographic",
    "perspective",
    "piecewise_linear",
    "project",
    "projected_length",
    "pseudo_inverse",
    "reflect",
    "rigid_inverse",
    "rotate",
    "rotate_2d",
    "rotate_by_frame",
    "rotate_x",
    "rotate_y",
    "rotate_z",
    "scale",
    "shear",
    "svd",
    "symmetric_eigen",
    "transform_directions",
    "transform_normals",
    "transform_points",
    "translate",
    "triangle_area",
    "unit",
    "viewport",
    "window",
]
