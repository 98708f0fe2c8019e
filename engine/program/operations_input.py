"""Operations that read the shaded point."""

from __future__ import annotations

from enum import IntEnum

from .operations import Operation, Reference, sockets


class Shift(IntEnum):
    """Where an operation reads: at the point, or a tenth of a pixel beside it, along the first or
    the second of two axes in the plane of the face. What bumps take differences of.
    """

    NONE = 0
    FIRST = 1
    SECOND = 2

    def by(self, width: int) -> int:
        """The same so many thousandths of a pixel beside the point; 0 is a tenth of one."""
        return int(self) + 4 * width


OF_TRIANGLES = ("barycentric", "edge_distance", "pixel_step")
"""What points inside of media and of lights have not, beside attributes."""


class NormalSpace(IntEnum):
    """Blender's identifiers of what the colours of normal maps mean."""

    TANGENT = 0
    OBJECT = 1
    WORLD = 2
    BLENDER_OBJECT = 3
    BLENDER_WORLD = 4


class Space(IntEnum):
    """Blender's identifiers of what vectors are transformed from and to."""

    WORLD = 0
    OBJECT = 1
    CAMERA = 2


class VectorType(IntEnum):
    """Blender's identifiers of what kind of vector is transformed."""

    POINT = 0
    VECTOR = 1
    NORMAL = 2


WIDEST = 100_000
"""Thousandths of a pixel that reads are shifted at most."""
_SHIFT = (("shift", range(4 * (WIDEST + 1))),)

INPUTS = (
    Operation(
        "attribute",
        sockets(vector="vector", alpha="number"),
        settings=(("attribute", Reference.ATTRIBUTE), *_SHIFT),
        formula="the mesh's attribute: its first three channels, missing ones 0, and the fourth, "
        "1 where there is none; zeros where the mesh lacks it",
        reads_point=True,
    ),
    Operation(
        "uv",
        sockets(vector="vector"),
        settings=(("attribute", Reference.ATTRIBUTE), *_SHIFT),
        formula="(u, v, 0) of a UV map, the active one where the name is empty",
        reads_point=True,
    ),
    *(
        Operation(
            name,
            sockets(vector="vector"),
            (),
            _SHIFT,
            formula,
            reads_point=True,
            of_ray=name in ("camera_position", "window"),
        )
        for name, formula in (
            ("position", "the point in the world"),
            ("object_position", "the point in the object's space"),
            (
                "camera_position",
                "the point along right and up of the camera, and its depth; where nothing is, the "
                "direction",
            ),
            ("window", "(x, y, 0) in the picture, 0 to 1 from lower left"),
            ("barycentric", "weights of the triangle's corners, zeros off triangles"),
        )
    ),
    *(
        Operation(
            name,
            sockets(**outputs),
            formula=formula,
            reads_point=True,
            of_ray=name in ("incoming", "backfacing"),
        )
        for name, outputs, formula in (
            ("normal", {"vector": "vector"}, "the mesh's shading normal, turned to the viewer"),
            ("face_normal", {"vector": "vector"}, "the face's normal, turned to the viewer"),
            ("incoming", {"vector": "vector"}, "the unit direction to the viewer"),
            ("backfacing", {"value": "number"}, "1 where the inner side is seen"),
            (
                "object_normal",
                {"vector": "vector"},
                "the shading normal, turned to the viewer, in the object's space",
            ),
            ("object_location", {"vector": "vector"}, "the object's origin in the world"),
            (
                "reflection",
                {"vector": "vector"},
                "the direction of view mirrored at the shading normal",
            ),
        )
    ),
    Operation(
        "instance_value",
        sockets(vector="vector", alpha="number"),
        settings=(("attribute", Reference.ATTRIBUTE),),
        formula="the value of this name that `Instances.values` gives the placement; zeros where "
        "there is none",
        reads_point=True,
    ),
    Operation(
        "edge_distance",
        sockets(value="number"),
        settings=_SHIFT,
        formula="distance in the world to the nearest side of the triangle, the largest float off "
        "triangles",
        reads_point=True,
    ),
    Operation(
        "pixel_step",
        sockets(value="vector"),
        settings=(("axis", range(1, 3)),),
        formula="a tenth of what a pixel spans there, along the first or the second axis in the "
        "plane of the face; what is shifted sees the same",
        reads_point=True,
    ),
    Operation(
        "normal_to_world",
        sockets(normal="vector"),
        sockets(vector="vector"),
        formula="the unit normal in the world of one in the object's space",
        reads_point=True,
    ),
    Operation(
        "transform_vector",
        sockets(vector="vector"),
        sockets(vector="vector"),
        (("vector_type", VectorType), ("convert_from", Space), ("convert_to", Space)),
        "vector in another space: of the world, of the object, or along right, up and forward of "
        "the camera; a NORMAL by the inverse transpose of the object's matrix, and made unit",
        reads_point=True,
    ),
    Operation(
        "fresnel",
        sockets(value="number"),
        sockets(ior="number", normal="vector"),
        formula="reflectance of a dielectric of index ior entering, 1 / ior leaving, at the cosine "
        "between normal and the direction to the viewer",
        reads_point=True,
        of_ray=True,
    ),
    Operation(
        "layer_weight",
        sockets(fresnel="number", facing="number"),
        sockets(blend="number", normal="vector"),
        formula="Fresnel of the index 1 / (1 - blend); 1 - |n·v|^e, e = 2 blend below one half, "
        "else 1 / (2 - 2 blend)",
        reads_point=True,
        of_ray=True,
    ),
    Operation(
        "light_path",
        sockets(camera="number", shadow="number", bounced="number", scattered="number"),
        formula="1 for the kind of ray that meets the point: from the camera, to a light, mirrored "
        "or refracted, from a matt surface (of lights that are tables); else 0; rays to lights in "
        "directions of lobes are of two kinds",
        reads_point=True,
        of_ray=True,
    ),
    Operation(
        "ray_length",
        sockets(value="number"),
        formula="the distance in the world from the camera's clip_start, the surface that mirrors "
        "or refracts, or the lit point; the largest float to a SUN",
        reads_point=True,
    ),
    Operation(
        "ray_depth",
        sockets(depth="number", straight="number", refractions="number", refracted="number"),
        formula="bounces before the point, 1 of rays to lights; surfaces that dim and that the ray "
        "passed since; bounces that were refractions, up to 31; 1 where the last one was",
        reads_point=True,
        of_ray=True,
    ),
    Operation(
        "normal_map",
        sockets(normal="vector"),
        sockets(color="vector", strength="number"),
        (("space", NormalSpace), ("attribute", Reference.ATTRIBUTE)),
        "the shading normal that 2 color - 1 means; in tangent space along the tangent that the "
        "attribute is (its fourth channel the bitangent's sign), that times the normal, and the "
        "normal, where strength scales the first two and mixes the third with 1; elsewhere "
        "strength mixes it with the shading normal",
        reads_point=True,
    ),
    Operation(
        "bump",
        sockets(normal="vector"),
        sockets(
            height="number",
            first="number",
            second="number",
            strength="number",
            distance="number",
            normal="vector",
        ),
        (("width", range(WIDEST + 1)),),
        "the normal of a surface that is raised to the viewer by distance × height; first, second: "
        "the heights beside the point, as Shift.by(width) says (Mikkelsen 2020)",
        reads_point=True,
    ),
    Operation(
        "image",
        sockets(color="vector", alpha="number"),
        sockets(vector="vector"),
        (("texture", Reference.TEXTURE),),
        "the texture at x, y of vector",
        reads_point=True,
        of_ray=True,
    ),
)
