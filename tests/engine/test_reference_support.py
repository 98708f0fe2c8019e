"""What the tests of the reference share: its passes in float64, a floor under a camera, a light, a
geometry.
"""

from __future__ import annotations

import numpy as np

from engine_scenes import at, camera, constant, grid_mesh, look_at
from glint import engine
from glint.engine import scene as s
from glint.engine.evaluation.geometry import Geometry, gather
from glint.engine.reference.cancellation import Cancellation
from glint.engine.reference.trace import Tracer
from glint.engine.scene.problems import scene_problems

PI = np.pi
ROUNDING = 1e-12
"""Some thousand roundings of float64 (1.1e-16 each)."""
PASSES = frozenset(engine.PASSES) - {"Combined"}


def values(scene: s.Scene, **settings) -> dict[str, np.ndarray]:
    """Passes in float64, (h, w, channels)."""
    assert scene_problems(scene) == []
    options = {"samples": 1, "light_samples": 1, "passes": PASSES} | settings
    tracer = Tracer(scene, engine.Settings(backend="NUMPY", **options), Cancellation(lambda: False))
    assert tracer.run()
    nx, ny = scene.camera.resolution
    return {name: array.T.reshape(ny, nx, -1) for name, array in tracer.picture.means().items()}


def color(scene: s.Scene, **settings) -> np.ndarray:
    return values(scene, **settings)["Combined"][..., :3]


def material(*lobes: s.Lobe) -> s.Material:
    return s.Material("m", lobes)


DIFFUSE = s.Lobe("DIFFUSE", constant(0.8, 0.5, 0.2))
K_D = np.array([0.8, 0.5, 0.2])
EYE = np.array([0.3, -2.6, 1.9])
VIEW = s.Camera("PERSPECTIVE", look_at(EYE, (0, 0, 0)), (-0.3, 0.3, -0.2, 0.2), (9, 6))


def floor(*lobes: s.Lobe, lights=(), camera=VIEW, world=None) -> s.Scene:
    """The plane z = 0 under a camera."""
    return s.Scene(
        camera,
        (grid_mesh(1, 50.0),),
        (s.Instances("f", 0, at(), (0,)),),
        (material(*lobes),),
        (),
        lights,
        world or s.World(),
    )


POINT = np.array([0.4, 0.7, 1.3])


def hard(kind: str, **more) -> s.Light:
    frame = look_at(POINT, (0.1, 0.2, 0.0))
    return s.Light(kind, kind, frame, (1.0, 0.6, 0.3), 7.0, **more)


def geometry_of(
    *meshes: s.Mesh | s.Spheres | s.Polygons, matrix: np.ndarray | None = None, **flags
) -> Geometry:
    placed = tuple(
        s.Instances(m.name, k, at() if matrix is None else matrix, (), **flags)
        for k, m in enumerate(meshes)
    )
    return gather(s.Scene(camera(), meshes, placed), np.zeros(3))
