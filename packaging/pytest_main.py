"""pytest, left without Blender's own clean-up: once tests have registered classes outside an
add-on, bpy 4.2 crashes and bpy 4.5 waits for ever in the destructors of its static objects (it
frees panels after Python has gone).
"""

from __future__ import annotations

import os
import sys

import pytest

code = int(pytest.main(sys.argv[1:]))
sys.stdout.flush()
sys.stderr.flush()
os._exit(code)
