"""Shader nodes as expressions of `engine.program`: one function a node type, by family.

`READERS` is the registry; `reader` walks the trees.
"""

from . import atmosphere as atmosphere
from . import basic as basic
from . import colors as colors
from . import ies as ies
from . import inputs as inputs
from . import lamp as lamp
from . import math as math
from . import noise as noise
from . import normals as normals
from . import objects as objects
from . import patterns as patterns
from . import rays as rays
from . import sky as sky
from . import spectra as spectra
from . import strands as strands
from . import tangents as tangents
from . import vectors as vectors
from . import volume as volume
from . import voronoi as voronoi
from .reader import READERS as READERS
from .reader import TreeReader as TreeReader
