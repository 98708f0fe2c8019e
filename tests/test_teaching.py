"""The numbers of the manual's page for lessons are those of the scene that it tells of."""

import re

import numpy as np

from documents import ROOT
from glint import engine
from glint.engine.scene import Camera, Input, Instances, Light, Lobe, Material, Scene, Spheres

PAGE = (ROOT / "docs" / "manual" / "teaching.md").read_text(encoding="utf-8")


def explained() -> tuple[str, ...]:
    """A red ball under one lamp, as on the blackboard."""
    at = np.c_[np.eye(3), [0, 0, 0]]

    def place(x, y, z):
        return np.c_[np.eye(3), [x, y, z]]

    color = Input((0.8, 0.1, 0.1))
    red = Material(
        "Red",
        (
            Lobe("AMBIENT", (color,)),
            Lobe("DIFFUSE", (color,)),
            Lobe("SPECULAR", (Input((0.5, 0.5, 0.5)),), exponent=64),
        ),
    )
    scene = Scene(
        Camera("PERSPECTIVE", place(0, 0, 5), (-0.4, 0.4, -0.3, 0.3), (160, 120)),
        (Spheres("Ball", np.zeros((1, 3), np.float32), np.ones(1, np.float32)),),
        (Instances("Ball", 0, at[None], (0,)),),
        (red,),
        lights=(Light("Lamp", "POINT", place(4, 4, 5), strength=1.0),),
        world=engine.scene.World(ambient=(0.1, 0.1, 0.1)),
    )
    settings = engine.Settings(samples=1, light_samples=1, illumination="CLASSIC")
    return engine.explanation_lines(engine.PixelExplainer(scene, settings).pixel(88, 72))


def test_the_text_of_a_pixel_is_what_glint_says():
    [shown] = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
    assert shown.split() == "\n".join(explained()).split()


def test_the_terms_add_up_to_the_colour():
    """k_a I_a + k_d I n·l + k_s I (n·h)^p, as the page has it."""
    text = "\n".join(explained())
    brings, ambient, diffuse, specular = (
        np.array([float(x) for x in re.search(pattern + r" ?\(([^)]*)\)", text)[1].split(", ")])
        for pattern in ("brings", "k_a I_a =", "k_d I n·l =", r"\(n·h\)\^p =")
    )
    np.testing.assert_allclose(brings, ambient + diffuse + specular, atol=2e-5)
