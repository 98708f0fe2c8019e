"""A Blender with one of the zips installed."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator

import pytest

from blender_process import Blender
from packed import INSTALL, pack


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Blender]]:
    """Edition → a Blender in which that zip is installed, as a user would."""
    made: dict[str, Blender] = {}

    def install(edition: str) -> Blender:
        if edition not in made:
            blender = Blender(tmp_path_factory.mktemp(edition))
            zip_path = blender.folder / "glint.zip"
            zip_path.write_bytes(pack(edition).read_bytes())
            run = blender.run(INSTALL, "--", blender.inside(zip_path))
            assert run.returncode == 0, run.output
            assert "bl_ext.user_default.glint" in run.answer, run.output
            made[edition] = blender
        return made[edition]

    yield install
    for blender in made.values():
        shutil.rmtree(blender.folder)
