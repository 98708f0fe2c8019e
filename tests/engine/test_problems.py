"""The check at the API boundary: a sound scene passes, every single fault is named, and odd but
drawable scenes are left alone.
"""

import dataclasses
import tracemalloc

import numpy as np
import pytest

from glint import engine
from glint.engine import scene as s
from glint.engine.scene.problems import scene_problems

F, U, H = np.float32, np.uint32, np.uint16
IDENTITY = np.eye(4)[:3]


def mesh(**changes):
    values = {
        "name": "Quad",
        "vertices": np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], F),
        "triangles": np.array([[0, 1, 2], [0, 2, 3]], U),
        "corners": np.arange(6, dtype=U).reshape(2, 3),
        "material_slots": np.array([0, 1], H),
        "normals": s.Attribute("normal", s.POINT, np.tile(F([0, 0, 1]), (4, 1))),
        "attributes": (
            s.Attribute("UVMap", s.CORNER, np.zeros((6, 2), F)),
            s.Attribute("tint", s.FACE, np.ones((2, 4), F)),
        ),
    }
    return s.Mesh(**values | changes)


def spheres(**changes):
    return s.Spheres(
        **{
            "name": "Balls",
            "centers": np.zeros((2, 3), F),
            "radii": np.ones(2, F),
            "material_slots": np.zeros(2, H),
        }
        | changes
    )


def polygons(**changes):
    values = {
        "vertices": np.eye(5, 3, dtype=F),
        "offsets": np.array([0, 3, 7], U),
        "indices": np.array([0, 1, 2, 1, 2, 3, 4], U),
    }
    return s.Polygons(**{"name": "Tiles"} | values | changes)


def instances(**changes):
    return s.Instances(
        **{
            "name": "Row",
            "geometry": 0,
            "world_from_object": np.stack([IDENTITY] * 3),
            "materials": (0,),
        }
        | changes
    )


def camera(**changes):
    values = {
        "kind": "PERSPECTIVE",
        "world_from_camera": IDENTITY,
        "window": (-1.0, 1.0, -1.0, 1.0),
        "resolution": (4, 4),
    }
    return s.Camera(**values | changes)


def texture(**changes):
    return s.Texture(
        **{"name": "Wood", "pixels": np.zeros((2, 2, 4), np.uint8), "encoding": "SRGB"} | changes
    )


def light(**changes):
    return s.Light(**{"name": "Lamp", "kind": "POINT", "world_from_light": IDENTITY} | changes)


def material(*lobes):
    return s.Material("Paint", lobes)


def scene(**changes):
    values = {
        "camera": camera(),
        "geometries": (mesh(), spheres(), polygons()),
        "instances": (instances(),),
        "materials": (material(s.Lobe("DIFFUSE", (s.Input(texture=0),))),),
        "textures": (texture(),),
        "lights": (light(),),
    }
    return s.Scene(**values | changes)


def with_factor(**changes):
    return scene(materials=(material(s.Lobe("DIFFUSE", (s.Input(**changes),))),))


def with_mesh(**changes):
    return scene(geometries=(mesh(**changes),))


NAN_AT = np.array(IDENTITY)
NAN_AT[1, 3] = np.nan

SOUND = {
    "everything": scene(),
    "nothing but a camera": s.Scene(camera()),
    "empty mesh": with_mesh(
        vertices=np.zeros((0, 3), F),
        triangles=np.zeros((0, 3), U),
        corners=np.zeros((0, 3), U),
        material_slots=np.zeros(0, H),
        normals=None,
        attributes=(),
    ),
    "lists for tuples": scene(
        geometries=[mesh(attributes=[])],
        lights=[light()],
        materials=[s.Material("Paint", [s.Lobe("DIFFUSE", [s.Input()])])],
    ),
    "bare mesh": with_mesh(corners=None, material_slots=None, normals=None, attributes=()),
    "non-finite vertices": with_mesh(
        vertices=np.array([[np.nan, 0, 0], [np.inf, 0, 0], [1, 1, 0], [3e38, 1, 0]], F)
    ),
    "non-finite spheres": scene(
        geometries=(spheres(centers=np.full((2, 3), np.nan, F), radii=np.array([np.nan, 1], F)),)
    ),
    "no polygons": scene(geometries=(polygons(offsets=np.zeros(1, U), indices=np.zeros(0, U)),)),
    "flattened and mirrored placements": scene(
        instances=(instances(world_from_object=np.stack([0 * IDENTITY, -1 * IDENTITY])),)
    ),
    "no placements": scene(
        instances=(instances(world_from_object=np.zeros((0, 3, 4)), materials=()),)
    ),
    "negative light": scene(lights=(light(strength=-10.0),)),
    "float texture": scene(
        textures=(texture(pixels=np.full((1, 1, 4), 1e9, F), encoding="LINEAR"),)
    ),
    "NumPy numbers": scene(
        camera=camera(
            resolution=(np.int64(4), np.int32(4)), window=tuple(np.float32([-1, 1, -1, 1]))
        )
    ),
    "a single pixel": scene(camera=camera(resolution=(1, 1))),
    "mirrored, scaled camera": scene(
        camera=camera(
            world_from_camera=np.array([[-1e-6, 0, 0, 1e7], [0, 3, 0, 0], [0, 0, 1e6, 0]])
        )
    ),
    "parallel view from behind its plane": scene(
        camera=camera(kind="ORTHOGRAPHIC", clip_start=-10.0, clip_end=10.0)
    ),
    "more corner rows than used": with_mesh(
        attributes=(s.Attribute("UVMap", s.CORNER, np.zeros((9, 2), F)),)
    ),
}


@pytest.mark.parametrize("name", SOUND)
def test_sound_scenes_have_no_problems(name):
    assert scene_problems(SOUND[name]) == []


FAULTS = {
    # Meshes
    "geometry of no kind": (
        scene(geometries=([1, 2],)),
        "scene: geometries holds a list: use Mesh or Spheres or Polygons",
    ),
    "geometry without a comma": (
        scene(geometries=mesh()),
        "scene: geometries is a Mesh: use a tuple of Mesh or Spheres or Polygons",
    ),
    "no camera": (scene(camera=None), "scene: camera is a NoneType: use Camera"),
    "lamps for materials": (
        scene(materials=(light(),)),
        "scene: materials holds a Light: use Material",
    ),
    "lobe without a comma": (
        scene(materials=(s.Material("Paint", s.Lobe("DIFFUSE")),)),
        "lobes is a Lobe: use a tuple of Lobe",
    ),
    "a colour as a factor": (
        scene(materials=(material(s.Lobe("DIFFUSE", (1.0, 0.5, 0.5))),)),
        "lobe 0: factors holds a float: use Input",
    ),
    "material without a comma": (
        scene(instances=(instances(materials=0),)),
        "materials is 0: use a tuple of whole numbers",
    ),
    "normals as an array": (
        scene(geometries=(mesh(normals=np.zeros((4, 3), F)),)),
        "normals holds a ndarray: use Attribute",
    ),
    "attributes by name": (
        scene(geometries=(mesh(attributes={"UVMap": None}),)),
        "attributes is a dict: use a tuple of Attribute",
    ),
    "float64 vertices": (
        with_mesh(vertices=np.zeros((4, 3))),
        "mesh 'Quad': vertices has dtype float64: use float32",
    ),
    "swapped bytes": (
        with_mesh(triangles=np.array([[0, 1, 2], [0, 2, 3]], ">u4")),
        "triangles has dtype >u4: use uint32",
    ),
    "vertices as a list": (
        with_mesh(vertices=[[0, 0, 0]]),
        "mesh 'Quad': vertices is a list: use a NumPy array",
    ),
    "flat vertices": (
        with_mesh(vertices=np.zeros(12, F)),
        "vertices has shape (12,): use (any, 3)",
    ),
    "signed triangles": (
        with_mesh(triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32)),
        "triangles has dtype int32: use uint32",
    ),
    "quads": (
        with_mesh(triangles=np.array([[0, 1, 2, 3]], U)),
        "triangles has shape (1, 4): use (any, 3)",
    ),
    "vertex index": (
        with_mesh(triangles=np.array([[0, 1, 2], [0, 2, 4]], U)),
        "triangles holds 4 but vertices has 4 rows",
    ),
    "corner count": (
        with_mesh(corners=np.zeros((1, 3), U)),
        "mesh 'Quad': corners has shape (1, 3): use (2, 3)",
    ),
    "corner index": (
        with_mesh(corners=np.array([[0, 1, 2], [3, 4, 6]], U)),
        "attribute 'UVMap' has 6 rows on CORNER: use 7",
    ),
    "slot count": (
        with_mesh(material_slots=np.zeros(3, H)),
        "material_slots has shape (3,): use (2), one for each triangle",
    ),
    "slot type": (
        with_mesh(material_slots=np.zeros(2, U)),
        "material_slots has dtype uint32: use uint16, one for each triangle",
    ),
    "normals per face": (
        with_mesh(normals=s.Attribute("n", s.FACE, np.zeros((2, 3), F))),
        "the domain of normals is 'FACE': use one of POINT, CORNER",
    ),
    "normals in 2D": (
        with_mesh(normals=s.Attribute("n", s.POINT, np.zeros((4, 2), F))),
        "normals has 2 columns: use 3",
    ),
    "too few normals": (
        with_mesh(normals=s.Attribute("n", s.POINT, np.zeros((3, 3), F))),
        "normals has 3 rows on POINT: use 4",
    ),
    "non-finite normals": (
        with_mesh(normals=s.Attribute("n", s.POINT, np.full((4, 3), np.nan, F))),
        "normals has a value that is not finite",
    ),
    "corner attribute without corners": (
        with_mesh(corners=None),
        "attribute 'UVMap' is on corners and the mesh has none",
    ),
    "domain": (
        with_mesh(attributes=(s.Attribute("a", "EDGE", np.zeros((4, 2), F)),)),
        "the domain of attribute 'a' is 'EDGE'",
    ),
    "attribute type": (
        with_mesh(attributes=(s.Attribute("a", s.POINT, np.zeros((4, 2))),)),
        "attribute 'a' has dtype float64",
    ),
    "attribute width": (
        with_mesh(attributes=(s.Attribute("a", s.POINT, np.zeros((4, 1), F)),)),
        "attribute 'a' has 1 columns: use 2 or 3 or 4",
    ),
    "attribute rows": (
        with_mesh(attributes=(s.Attribute("a", s.FACE, np.zeros((4, 2), F)),)),
        "attribute 'a' has 4 rows on FACE: use 2",
    ),
    "attribute inf": (
        with_mesh(attributes=(s.Attribute("a", s.FACE, F([[0, 0], [-np.inf, 0]])),)),
        "attribute 'a' has a value that is not finite",
    ),
    "name twice": (
        with_mesh(attributes=(s.Attribute("a", s.FACE, np.zeros((2, 2), F)),) * 2),
        "several attributes called 'a'",
    ),
    # Spheres and polygons
    "sphere centres": (
        scene(geometries=(spheres(centers=np.zeros((2, 3))),)),
        "spheres 'Balls': centers has dtype float64",
    ),
    "sphere radii": (
        scene(geometries=(spheres(radii=np.ones(3, F)),)),
        "spheres 'Balls': radii has shape (3,): use (2)",
    ),
    "negative radius": (
        scene(geometries=(spheres(radii=np.array([1, -1], F)),)),
        "radii has a negative value: use 0 or more",
    ),
    "sphere slots": (
        scene(geometries=(spheres(material_slots=np.zeros(1, H)),)),
        "one for each sphere",
    ),
    "two corners": (
        scene(geometries=(polygons(offsets=np.array([0, 2, 7], U)),)),
        "polygons 'Tiles': polygon 0 has 2 corners: use at least 3",
    ),
    "falling offsets": (
        scene(geometries=(polygons(offsets=np.array([0, 4, 3, 7], U)),)),
        "offsets falls after polygon 1",
    ),
    "offsets end": (
        scene(geometries=(polygons(offsets=np.array([0, 3, 6], U)),)),
        "offsets runs not from 0 to the 7 indices",
    ),
    "offsets start": (
        scene(geometries=(polygons(offsets=np.array([1, 4, 7], U)),)),
        "offsets runs not from 0 to the 7 indices",
    ),
    "no offsets": (
        scene(geometries=(polygons(offsets=np.zeros(0, U)),)),
        "offsets runs not from 0",
    ),
    "polygon index": (
        scene(geometries=(polygons(indices=np.array([0, 1, 2, 1, 2, 3, 5], U)),)),
        "indices holds 5 but vertices has 5 rows",
    ),
    "polygon slots": (
        scene(geometries=(polygons(material_slots=np.zeros(3, H)),)),
        "one for each polygon",
    ),
    # Instances
    "no such geometry": (
        scene(instances=(instances(geometry=3),)),
        "instances 'Row': geometry is 3 but the scene has 3 geometries: use 0 to 2",
    ),
    "negative geometry": (scene(instances=(instances(geometry=-1),)), "geometry is -1"),
    "an index too large": (
        scene(instances=(instances(object_index=2**31),)),
        "object_index is 2147483648: use a whole number of 32 bits",
    ),
    "no such material": (
        scene(instances=(instances(materials=(0, 1)),)),
        "a material is 1 but the scene has 1 materials: use 0 to 0",
    ),
    "no materials at all": (
        scene(materials=()),
        "a material is 0 but the scene has 0 materials: add one of the materials",
    ),
    "one matrix": (
        scene(instances=(instances(world_from_object=IDENTITY),)),
        "world_from_object has shape (3, 4): use (any, 3, 4)",
    ),
    "float32 matrices": (
        scene(instances=(instances(world_from_object=np.zeros((1, 3, 4), F)),)),
        "world_from_object has dtype float32: use float64",
    ),
    "non-finite matrix": (
        scene(instances=(instances(world_from_object=NAN_AT[None]),)),
        "instances 'Row': world_from_object has a value that is not finite",
    ),
    "pass index": (
        scene(instances=(instances(object_index=1.5),)),
        "object_index is 1.5: use a whole number",
    ),
    # Surfaces
    "lobe": (
        scene(materials=(material(s.Lobe("SHINY")),)),
        "material 'Paint': lobe 0: kind is 'SHINY': use one of AMBIENT, DIFFUSE",
    ),
    "fresnel and schlick": (
        scene(materials=(material(s.Lobe("SPECULAR", fresnel=True, schlick=True)),)),
        "is times two of fresnel, schlick and edge: use one of them",
    ),
    "exponent": (
        scene(materials=(material(s.Lobe("SPECULAR", exponent=-1.0)),)),
        "exponent is -1.0: use a finite number, 0 to 1e+30",
    ),
    "index of refraction": (
        scene(materials=(material(s.Lobe("MIRROR"), s.Lobe("REFRACTION", ior=0.0)),)),
        "lobe 1: ior is 0.0: use a finite number, 1e-30 to 1e+30",
    ),
    "large index of refraction": (
        scene(materials=(material(s.Lobe("REFRACTION", ior=1e31)),)),
        "ior is 1e+31: use a finite number, 1e-30 to 1e+30",
    ),
    "large exponent": (
        scene(materials=(material(s.Lobe("SPECULAR", exponent=1e31)),)),
        "exponent is 1e+31: use a finite number, 0 to 1e+30",
    ),
    "material index": (
        scene(materials=(s.Material("Paint", (), index=None),)),
        "material 'Paint': index is None: use a whole number",
    ),
    "value": (
        with_factor(value=(1.0, np.nan, 0.0)),
        "value is (1.0, nan, 0.0): use 3 finite numbers",
    ),
    "grey value": (with_factor(value=0.5), "value is 0.5: use 3 finite numbers"),
    "no such texture": (
        with_factor(texture=1),
        "texture is 1 but the scene has 1 textures: use -1 to 0",
    ),
    "texture below none": (with_factor(texture=-2), "texture is -2"),
    "channel": (with_factor(channel="RED"), "channel is 'RED': use one of COLOR, ALPHA, LUMINANCE"),
    "attribute channel": (
        with_factor(attribute_channel="RED"),
        "attribute_channel is 'RED': use one of COLOR, ALPHA",
    ),
    "uv transform": (
        with_factor(uv_transform=((1.0, 0.0, np.inf), (0.0, 1.0, 0.0))),
        "a row of uv_transform is (1.0, 0.0, inf)",
    ),
    "uv rows": (with_factor(uv_transform=((1.0, 0.0, 0.0),)), "uv_transform has 1 rows: use 2"),
    "no alpha": (
        scene(textures=(texture(pixels=np.zeros((2, 2, 3), np.uint8)),)),
        "texture 'Wood': pixels has shape (2, 2, 3): use (any, any, 4)",
    ),
    "double pixels": (
        scene(textures=(texture(pixels=np.zeros((2, 2, 4))),)),
        "pixels has dtype float64: use uint8 or float32",
    ),
    "no pixels": (
        scene(textures=(texture(pixels=np.zeros((0, 2, 4), np.uint8)),)),
        "pixels has shape (0, 2, 4): use at least one pixel",
    ),
    "float sRGB": (
        scene(textures=(texture(pixels=np.zeros((2, 2, 4), F)),)),
        "encoding SRGB is for uint8",
    ),
    "non-finite pixels": (
        scene(textures=(texture(pixels=np.full((2, 2, 4), np.inf, F), encoding="LINEAR"),)),
        "pixels has a value that is not finite",
    ),
    "encoding": (
        scene(textures=(texture(encoding="ACES"),)),
        "encoding is 'ACES': use one of LINEAR, SRGB",
    ),
    "extension": (scene(textures=(texture(extension="WRAP"),)), "extension is 'WRAP'"),
    "interpolation": (
        scene(textures=(texture(interpolation="SINC"),)),
        "interpolation is 'SINC'",
    ),
    # Light and view
    "light kind": (
        scene(lights=(light(kind="GLOW"),)),
        "light 'Lamp': kind is 'GLOW': use one of POINT, SUN, SPOT, AREA, DOME",
    ),
    "light shape": (scene(lights=(light(shape="SQUARE"),)), "shape is 'SQUARE'"),
    "light matrix": (
        scene(lights=(light(world_from_light=np.eye(4)),)),
        "world_from_light has shape (4, 4): use (3, 4)",
    ),
    "light matrix inf": (
        scene(lights=(light(world_from_light=NAN_AT),)),
        "light 'Lamp': world_from_light has a value that is not finite",
    ),
    "scaled light": (
        scene(lights=(light(world_from_light=2 * IDENTITY),)),
        "columns that are not orthonormal",
    ),
    "light colour": (
        scene(lights=(light(color=(1.0, 1.0)),)),
        "color is (1.0, 1.0): use 3 finite numbers",
    ),
    "light strength": (
        scene(lights=(light(strength=np.nan),)),
        "strength is nan: use a finite number",
    ),
    "light radius": (
        scene(lights=(light(radius=-0.1),)),
        "radius is -0.1: use a finite number, 0 or more",
    ),
    "light size": (scene(lights=(light(size_y=np.inf),)), "size_y is inf"),
    "light angle": (
        scene(lights=(light(angle=7.0),)),
        "angle is 7.0: use a finite number, 0 to 6.28319",
    ),
    "spot size": (scene(lights=(light(spot_size=-1.0),)), "spot_size is -1.0"),
    "spot blend": (
        scene(lights=(light(spot_blend=1.5),)),
        "spot_blend is 1.5: use a finite number, 0 to 1",
    ),
    "camera kind": (
        scene(camera=camera(kind="FISHEYE")),
        "camera: kind is 'FISHEYE': use one of PERSPECTIVE, ORTHOGRAPHIC",
    ),
    "camera inf": (
        scene(camera=camera(world_from_camera=NAN_AT)),
        "camera: world_from_camera has a value that is not finite",
    ),
    "camera float32": (
        scene(camera=camera(world_from_camera=F(IDENTITY))),
        "world_from_camera has dtype float32",
    ),
    "flattened camera": (
        scene(camera=camera(world_from_camera=np.diag([1.0, 1, 0, 0])[:3])),
        "camera: world_from_camera is flattened",
    ),
    "camera axes in a plane": (
        scene(camera=camera(world_from_camera=np.ones((3, 4)))),
        "camera: world_from_camera is flattened",
    ),
    "window of no width": (
        scene(camera=camera(window=(1.0, 1.0, -1.0, 1.0))),
        "has no area: use l different from r and b from t",
    ),
    "non-finite window": (
        scene(camera=camera(window=(-np.inf, 1.0, -1.0, 1.0))),
        "window is (-inf, 1.0, -1.0, 1.0): use 4 finite numbers",
    ),
    "no pixels in a row": (
        scene(camera=camera(resolution=(0, 4))),
        "resolution is (0, 4): use two whole numbers, 1 or more",
    ),
    "half a pixel": (scene(camera=camera(resolution=(4.5, 4))), "resolution is (4.5, 4)"),
    "resolution of one number": (scene(camera=camera(resolution=4)), "resolution is 4"),
    "clip behind the eye": (
        scene(camera=camera(clip_start=-1.0)),
        "clip_start is -1.0: use 0 or more",
    ),
    "clip crossed": (
        scene(camera=camera(clip_start=2.0, clip_end=1.0)),
        "leave nothing between: use a smaller clip_start",
    ),
    "clip NaN": (scene(camera=camera(clip_end=np.nan)), "leave nothing between"),
    "ambient": (
        scene(world=s.World(ambient=(np.nan, 0.0, 0.0))),
        "world: ambient is (nan, 0.0, 0.0): use 3 finite numbers",
    ),
    "background": (
        scene(world=s.World(background=())),
        "world: background is (): use 3 finite numbers",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_once_with_its_remedy(name):
    faulty, expected = FAULTS[name]
    problems = scene_problems(faulty)
    assert len(problems) == 1, problems
    assert expected in problems[0]


def test_every_problem_is_listed_in_one_error():
    both = scene(camera=camera(clip_start=-1.0), lights=(light(strength=np.nan),))
    with pytest.raises(engine.SceneError) as caught:
        engine.render(both)
    assert str(caught.value).splitlines() == scene_problems(both)
    assert len(scene_problems(both)) == 2


def test_the_check_changes_and_keeps_nothing():
    sound = scene()
    before = [
        np.copy(getattr(sound.geometries[0], f.name))
        for f in dataclasses.fields(s.Mesh)
        if f.name in ("vertices", "triangles")
    ]
    scene_problems(sound)
    np.testing.assert_array_equal(before[0], sound.geometries[0].vertices)
    np.testing.assert_array_equal(before[1], sound.geometries[0].triangles)


def big_mesh(count):
    corners = np.arange(3 * count, dtype=U).reshape(-1, 3)
    attributes = (s.Attribute("UVMap", s.CORNER, np.zeros((3 * count, 2), F)),)
    normals = s.Attribute("n", s.CORNER, np.ones((3 * count, 3), F))
    return s.Mesh(
        "Big",
        np.zeros((3 * count, 3), F),
        corners,
        corners,
        np.zeros(count, H),
        normals,
        attributes,
    )


def test_meshes_are_not_copied():
    whole = scene(geometries=(big_mesh(100_000),))
    assert scene_problems(whole) == []  # and the modules are loaded
    tracemalloc.start()
    try:
        scene_problems(whole)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # a copy of the smallest array, the slots, would take twice that; reductions take a buffer of
    # 8192 values
    assert peak < 100_000


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"world_from_object": np.full((1, 3, 4), np.nan)}, "not finite"),
        ({"world_from_object": np.zeros((1, 4, 3))}, "shape"),
        ({"world_from_object": np.zeros((1, 3, 4), F)}, "dtype"),
        ({"geometry": 0.0}, "geometry is 0.0"),
        ({"materials": (0.0,)}, "a material is 0.0"),
        ({"materials": [7]}, "a material is 7"),
    ],
)
def test_one_bad_group_among_many_alike_is_named(changes, text):
    groups = [instances(name=f"Row {k}") for k in range(5)]
    groups[3] = instances(name="Odd", **changes)
    assert scene_problems(scene(instances=tuple(groups[:3]))) == []
    found = scene_problems(scene(instances=tuple(groups)))
    assert len(found) == 1
    assert "'Odd'" in found[0]
    assert text in found[0]
