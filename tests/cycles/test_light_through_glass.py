"""What is behind glass is lit: straight through, as bright as a uniform sky makes it."""

import numpy as np
import pytest

import cycles_reference as cycles
from glint_picture import BACKENDS, render_glint, render_pair
from small_scenes import add, add_camera, add_light, cube, lambert, moved, new_material, plane

SIZE = 32, 24
SKY, BLACK = (0.3, 0.4, 0.5), (0.0, 0.0, 0.0)


def glass(color=(1.0, 1.0, 1.0), roughness=0.0, passed=True):
    material, tree, output = new_material("Glass")
    node = tree.nodes.new("ShaderNodeBsdfGlass")
    material.use_transparent_shadow = passed
    node.inputs["Color"].default_value = (*color, 1.0)
    node.inputs["Roughness"].default_value, node.inputs["IOR"].default_value = roughness, 1.45
    tree.links.new(node.outputs[0], output.inputs[0])
    return material


def covered_floor(world=SKY, sun=0.0, **of_glass):
    """A floor under a wide slab that the camera does not see; of_glass: of it, none for no slab."""
    scene = cycles.empty_scene(*SIZE)
    cycles.set_world(scene, world)
    add(scene, "Floor", plane(5.0, lambert((0.8, 0.8, 0.8))))
    if of_glass:
        slab = add(scene, "Slab", cube(glass(**of_glass)), moved(0, 0, 1.5, 20.0, 20.0, 0.2))
        slab.visible_camera = False
    add_camera(scene)
    if sun:
        add_light(scene, "SUN", (0, 0, 4), energy=sun)
    return scene


def picture(scene, backend="NATIVE", **settings):
    chosen = {"samples": 4, "light_samples": 16, "filter_width": 0.0, "max_bounces": 8}
    return render_glint(scene, backend, **(chosen | settings)).combined[..., :3].astype(float)


def passed(cosine, ior: float):
    """What a surface of a dielectric lets through at cosines of the angle of incidence."""
    g = np.sqrt(ior**2 - 1 + cosine**2)
    across = (g - cosine) / (g + cosine)
    along = (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    return 1 - across**2 * (1 + along**2) / 2


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("roughness", [0.0, 0.4])
def test_a_pane_lets_a_uniform_sky_through_as_fresnel_says(backend, roughness):
    """Twice at the same angle, of a cosine-weighted half of the sky."""
    below, bare = (
        picture(covered_floor(**slab), backend)[:12] for slab in ({"roughness": roughness}, {})
    )
    sine2 = (np.arange(4096) + 0.5) / 4096  # even in projected solid angle
    truth = (passed(np.sqrt(1 - sine2), 1.45) ** 2).mean()
    assert np.abs(below / bare / truth - 1).max() < 0.02


@pytest.mark.parametrize("backend", BACKENDS)
def test_colored_glass_colors_the_light_of_a_lamp_once_a_surface(backend):
    tint = np.array([0.9, 0.5, 0.2])
    bare = picture(covered_floor(BLACK, sun=3.0), backend)
    seen = picture(covered_floor(BLACK, sun=3.0, color=tuple(tint)), backend)
    np.testing.assert_allclose(seen, bare * (tint * passed(1.0, 1.45)) ** 2, rtol=1e-5)


def test_glass_without_transparent_shadows_casts_whole_ones():
    lit, dark = (picture(covered_floor(BLACK, sun=3.0, passed=passed)) for passed in (True, False))
    assert lit[:12].min() > 0 and dark.max() == 0


@pytest.mark.parametrize("backend", BACKENDS)
def test_bounced_light_comes_through_a_window(backend):
    """Of a ceiling under the slab, which the sun does not see, by a floor that it lights through
    that: as much of it as of the floor, where the slab itself throws none back.
    """

    def below(**slab):
        scene = covered_floor(BLACK, sun=3.0, **slab)
        ceiling = add(scene, "Ceiling", plane(0.5, lambert((0.8, 0.8, 0.8))), moved(0, 0, 1.0))
        for kind in ("camera", "shadow"):
            setattr(ceiling, f"visible_{kind}", False)
        more = {"diffuse_bounces": 2, "soft_light": "DEALT", "reflective_caustics": "OFF"}
        return picture(scene, backend), picture(scene, backend, **more)

    (bare, lit), (behind, thrown) = below(), below(roughness=0.0)
    assert (lit - bare).mean() > 0.01 * bare.mean()
    assert (thrown - behind).mean() / behind.mean() == pytest.approx(
        (lit - bare).mean() / bare.mean(), rel=0.02
    )


@pytest.mark.parametrize("passes", [True, False])
def test_shadows_of_what_is_clear_are_transparent_as_the_material_says(passes):
    """A pane of colour between a floor and a sun."""
    scene = cycles.empty_scene(*SIZE)
    add(scene, "Floor", plane(5.0, lambert((0.8, 0.8, 0.8))))
    material, tree, output = new_material("Clear")
    node = tree.nodes.new("ShaderNodeBsdfTransparent")
    node.inputs["Color"].default_value = (0.7, 0.4, 0.2, 1.0)
    tree.links.new(node.outputs[0], output.inputs[0])
    material.use_transparent_shadow = passes
    pane = add(scene, "Pane", plane(1.0, material), moved(0.3, 0.2, 1.0, 1.0, 1.0, 1.0))
    pane.visible_camera = False
    add_camera(scene)
    add_light(scene, "SUN", (0.5, 0.2, 4), energy=3.0)
    wanted, found = render_pair(scene, "NATIVE", "clear").colors()
    off = np.abs(found - wanted).max(-1)
    assert np.median(off) <= 1e-4 and (off > 0.01).mean() <= 0.05
    assert wanted.std() > 0.02


def under_a_card(sky: str, covered: bool = True):
    """A floor below a wide card of alpha .5, black, that casts whole shadows. sky: EVEN; SLOPE, of
    brightness along x; SUN, without one.
    """
    scene = cycles.empty_scene(8, 8)
    cycles.set_world(scene, BLACK if sky == "SUN" else (1.0, 1.0, 1.0))
    if sky == "SLOPE":
        tree = scene.world.node_tree
        nodes = [tree.nodes.new(f"ShaderNodeTex{name}") for name in ("Coord", "Gradient")]
        background = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground")
        tree.links.new(nodes[0].outputs["Generated"], nodes[1].inputs[0])
        tree.links.new(nodes[1].outputs[0], background.inputs[0])
    if sky == "SUN":
        add_light(scene, "SUN", (0, 0, 4), energy=3.0)
    add(scene, "Floor", plane(1.0, lambert((0.8, 0.8, 0.8))))
    if covered:
        material, tree, output = new_material("Card")
        material.use_transparent_shadow = False
        names = ("MixShader", "BsdfTransparent", "BsdfDiffuse")
        mix, clear, matt = (tree.nodes.new(f"ShaderNode{name}") for name in names)
        matt.inputs["Color"].default_value = (*BLACK, 1.0)
        tree.links.new(clear.outputs[0], mix.inputs[1])
        tree.links.new(matt.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], output.inputs[0])
        add(scene, "Card", plane(40.0, material), moved(0, 0, 1.0)).visible_camera = False
    add_camera(scene, (0, 0, 0.5), (0, 0, 0), lens=200)
    return scene


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(("sky", "off"), [("EVEN", 0.01), ("SLOPE", 0.15), ("SUN", 0.0)])
def test_what_casts_whole_shadows_lets_the_light_of_matt_lobes_pass(sky, off, backend):
    """An even sky Cycles finds by lobes alone, a sun by rays to it, others by both."""
    shares = []
    for draw in (
        lambda scene: cycles.render_cycles(scene, 1024)["Combined"][..., :3],
        lambda scene: picture(scene, backend, samples=64),
    ):
        below, bare = (draw(under_a_card(sky, covered)).mean() for covered in (True, False))
        shares.append(below / bare)
    assert abs(shares[1] - shares[0]) <= off * 0.5
    assert {"EVEN": 0.49, "SLOPE": 0.2, "SUN": -1}[sky] < shares[0] < 0.51


def basin(lit_by: str, gap: bool):
    """Water over a floor, which it touches or hovers over."""
    scene = cycles.empty_scene(*SIZE)
    cycles.set_world(scene, (1.0, 1.0, 1.0) if lit_by == "WORLD" else BLACK)
    grey = lambert((0.5, 0.5, 0.5))
    add(scene, "Floor", plane(20.0, grey))
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        wide = 0.5 if x else 5.0, 0.5 if y else 5.0
        add(scene, "Wall", cube(grey), moved(5.5 * x, 5.5 * y, 0.5, *wide, 0.8))
    low = 0.05 if gap else -0.1
    water = cube(glass())
    add(scene, "Water", water, moved(0, 0, 0.5 + low / 2, 5.05, 5.05, 0.5 - low / 2))
    if lit_by == "SUN":
        add_light(scene, "SUN", (1.5, -1, 4), energy=3.0, angle=0.3)
    add_camera(scene, (0, -4.5, 7), (0, 0, 0), lens=50)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("gap", [False, True])
@pytest.mark.parametrize("lit_by", ["SUN", "WORLD"])
def test_the_floor_of_a_basin_is_as_bright_as_in_cycles(lit_by: str, gap: bool, backend: str):
    """Light comes from a narrower cone in water that touches its floor."""
    scene = basin(lit_by, gap)
    ours = picture(scene, backend, light_samples=8)
    cycles.make_exact(scene, 1024)
    own = scene.cycles
    own.max_bounces = own.transmission_bounces = own.glossy_bounces = 8
    own.diffuse_bounces, own.caustics_refractive, own.blur_glossy = 1, True, 0.0
    theirs = cycles.render_passes(scene)["Combined"][..., :3]
    assert abs(ours[6:18].mean() / theirs[6:18].mean() - 1) < 0.06
