"""The scene as plain values, the checks that it passes and what the core drops of it.

`model.py` and the modules model_… have the values, all of which are imported from here; `delta.py`
has what changed from one scene to the next; `problems.py` lists what is wrong with a scene at the
API boundary, the modules …_problems what is with its parts, by `checks.py` of single values;
`left_out.py` names what the core drops; `view_axes.py` turns scenes into a narrow view's axes.
"""

from .delta import SceneDelta, settled
from .model import CAMERAS, MISTS, Array, Camera, Lens, Mist, Scene, World
from .model_geometry import (
    CORNER,
    EVERYTHING,
    FACE,
    MOST_SETS,
    POINT,
    Attribute,
    Geometry,
    Instances,
    Mesh,
    Polygons,
    Spheres,
    Strands,
)
from .model_lights import LIGHT_SHAPES, LIGHTS, Emitters, Light, Openings, Rods
from .model_surfaces import (
    BUMP_SHADOWING,
    CHANNELS,
    DISTRIBUTIONS,
    ENCODINGS,
    EXTENSIONS,
    INTERPOLATIONS,
    Input,
    Lobe,
    Material,
    Medium,
    Texture,
)

__all__ = [
    "BUMP_SHADOWING",
    "CAMERAS",
    "CHANNELS",
    "CORNER",
    "DISTRIBUTIONS",
    "ENCODINGS",
    "EVERYTHING",
    "EXTENSIONS",
    "FACE",
    "INTERPOLATIONS",
    "LIGHTS",
    "LIGHT_SHAPES",
    "MISTS",
    "MOST_SETS",
    "POINT",
    "Array",
    "Attribute",
    "Camera",
    "Emitters",
    "Geometry",
    "Input",
    "Instances",
    "Lens",
    "Light",
    "Lobe",
    "Material",
    "Medium",
    "Mesh",
    "Mist",
    "Openings",
    "Polygons",
    "Rods",
    "Scene",
    "SceneDelta",
    "Spheres",
    "Strands",
    "Texture",
    "World",
    "settled",
]
