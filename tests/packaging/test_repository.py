"""An extension repository on the loopback address, used as a person would from Blender's
preferences: add it, install, upgrade, go offline, disable, remove.
"""

from __future__ import annotations

import functools
import http.server
import io
import shutil
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import packed
from blender_process import Blender, Run

# Blender's own operators of Preferences, Get Extensions.
USE = """
import sys
URL = sys.argv[-1]
AS_MODULE = not bpy.app.binary_path
bpy.context.preferences.system.use_online_access = True

def number():
    repos = bpy.context.preferences.extensions.repos
    return next(k for k, repo in enumerate(repos) if repo.name == "Glint test")

def module():
    return f"bl_ext.{bpy.context.preferences.extensions.repos[number()].module}.glint"

def installed():
    folder = pathlib.Path(bpy.context.preferences.extensions.repos[number()].directory) / "glint"
    manifest = folder / "blender_manifest.toml"
    lines = manifest.read_text().splitlines() if manifest.exists() else []
    return next((line.split('"')[1] for line in lines if line.startswith("version = ")), "")

def sync():
    bpy.ops.extensions.repo_sync(repo_index=number())

def enabled():
    return module() in bpy.context.preferences.addons

def begin():
    # bpy as a module starts without the saved preferences, and 4.2 crashes where it reads them
    if AS_MODULE:
        bpy.ops.preferences.extension_repo_add(name="Glint test", remote_url=URL, type="REMOTE")
        bpy.ops.preferences.addon_enable(module=module())

def settings():
    scene = bpy.context.scene
    final = scene.glint.final
    return [scene.render.engine, final.samples, final.light_samples, final.max_bounces]

def picture(name):
    scene = bpy.context.scene
    scene.render.filepath = str(FOLDER / name)
    bpy.ops.render.render(write_still=True)
    core = sys.modules.get("glint_core")
    return [(FOLDER / name).stat().st_size > 0, core.__file__ if core else ""]

# The environment of the tests has the core too: only what the extension brought may be found.
def own_core():
    sys.path[:] = [path for path in sys.path if str(FOLDER) in path or not (pathlib.Path(path) / "glint_core").is_dir()]
"""  # noqa: E501 - a script for another Blender

INSTALL = """
bpy.ops.preferences.extension_repo_add(name="Glint test", remote_url=URL, type="REMOTE")
sync()
bpy.ops.extensions.package_install(repo_index=number(), pkg_id="glint", enable_on_install=True)
own_core()
bpy.ops.wm.read_homefile(use_factory_startup=True)
bpy.context.scene.render.engine = "GLINT"
render = bpy.context.scene.render
render.resolution_x, render.resolution_y, render.resolution_percentage = 32, 24, 100
final = bpy.context.scene.glint.final
final.samples, final.light_samples, final.max_bounces = 3, 2, 7
bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "kept.blend"))
bpy.ops.wm.save_userpref()
answer({"version": installed(), "enabled": enabled(), "picture": picture("first.png")})
"""

UPGRADE = """
begin()
sync()
bpy.ops.extensions.package_upgrade_all()
own_core()
bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "kept.blend"))
bpy.ops.wm.save_userpref()
answer({"version": installed(), "enabled": enabled(), "settings": settings(), "picture": picture("second.png")})
"""  # noqa: E501 - a script for another Blender

OFFLINE = """
begin()
bpy.context.preferences.system.use_online_access = False
own_core()
bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "kept.blend"))
answer({"version": installed(), "enabled": enabled(), "settings": settings(), "picture": picture("third.png")})
"""  # noqa: E501 - a script for another Blender

REMOVE = """
begin()
bpy.ops.preferences.addon_disable(module=module())
disabled = not enabled() and installed()
try:
    bpy.context.scene.render.engine = "GLINT"
except TypeError:
    disabled = disabled and "and the engine has gone"
bpy.ops.extensions.package_uninstall(repo_index=number(), pkg_id="glint")
bpy.ops.wm.save_userpref()
answer({"disabled": disabled, "version": installed()})
"""


LEAVE = """
if AS_MODULE:  # 4.2 crashes in its own clean-up
    import os
    sys.stdout.flush()
    os._exit(0)
"""


class _Host:
    """A static file host: a folder over http."""

    def __init__(self, folder: Path) -> None:
        handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(folder))
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self.url = f"http://127.0.0.1:{self._server.server_port}/index.json"

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()


def _raised(path: Path, version: str, folder: Path) -> Path:
    """A zip of Glint with another version in its manifest."""
    before = f'version = "{packed.tree.manifest()["version"]}"'
    content = io.BytesIO()
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as new:
        for info in old.infolist():
            data = old.read(info)
            if info.filename == "blender_manifest.toml":
                assert before.encode() in data
                data = data.replace(before.encode(), f'version = "{version}"'.encode(), 1)
            new.writestr(info, data)
    made = folder / f"glint-{version}.zip"
    made.write_bytes(content.getvalue())
    return made


def _for_another_platform(path: Path) -> None:
    """Beside a zip one of the same name and version that Blender must not choose here."""
    with zipfile.ZipFile(path) as old:
        manifest = old.read("blender_manifest.toml").decode()
    head, rest = manifest.split("platforms = [", 1)
    manifest = f'{head}platforms = ["macos-arm64"{rest[rest.index("]") :]}'
    assert '["macos-arm64"]' in manifest
    with zipfile.ZipFile(path.with_name(f"a-{path.name}"), "w") as new:
        new.writestr("blender_manifest.toml", manifest)
        new.writestr("__init__.py", "raise ImportError('this is for another platform')\n")
        new.writestr(manifest.split('wheels = ["./')[1].split('"')[0], "")


def _offer(folder: Path, version: str) -> Path:
    """Put a repository with this version of the full edition into the folder; its zip."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    zip_path = _raised(packed.pack("full"), version, folder)
    _for_another_platform(zip_path)
    packed.make_repository(folder)
    return zip_path


class _Story:
    """What happened to one Blender, chapter by chapter."""

    def __init__(self, blender: Blender, folder: Path) -> None:
        self.blender, folder = blender, folder / "repository"
        _offer(folder, "0.1.0")
        host = _Host(folder)
        try:
            self._url = host.url
            self.install = self._run(INSTALL)
            _offer(folder, "0.2.0")
            self.upgrade = self._run(UPGRADE)
            zip_path = _offer(folder, "0.3.0")
            honest = zip_path.read_bytes()
            changed = bytearray(honest)
            changed[len(changed) // 2] ^= 1
            zip_path.write_bytes(changed)
            self.tampered = self._run(UPGRADE)
            zip_path.write_bytes(honest)
            self.honest = self._run(UPGRADE)
        finally:
            host.stop()
        self.offline = self._run(OFFLINE)
        self.remove = self._run(REMOVE)

    def _run(self, program: str) -> Run:
        run = self.blender.run(USE + program + LEAVE, "--", self._url)
        assert run.returncode == 0, run.output
        return run


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Iterator[_Story]:
    blender = Blender(tmp_path_factory.mktemp("repository"))
    yield _Story(blender, tmp_path_factory.mktemp("host"))
    shutil.rmtree(blender.folder)


KEPT = ["GLINT", 3, 2, 7]


@pytest.mark.slow
def test_the_repository_is_added_and_installed_from(story):
    answer = story.install.answer
    assert (answer["version"], answer["enabled"]) == ("0.1.0", True), story.install.output
    drawn, core = answer["picture"]
    assert drawn and core.startswith(story.blender.inside(story.blender.folder))


def test_an_upgrade_keeps_scene_and_settings(story):
    answer = story.upgrade.answer
    assert (answer["version"], answer["enabled"]) == ("0.2.0", True), story.upgrade.output
    assert answer["settings"] == KEPT and answer["picture"][0]


def test_a_zip_that_was_tampered_with_is_refused(story):
    """One bit of the zip differs from what the listing promises: the version before stays, and
    goes on drawing. With that bit as it was the same zip is taken.
    """
    answer = story.tampered.answer
    assert (answer["version"], answer["enabled"]) == ("0.2.0", True), story.tampered.output
    assert "checksum mismatch" in story.tampered.output
    assert answer["settings"] == KEPT and answer["picture"][0]
    assert story.honest.answer["version"] == "0.3.0", story.honest.output


def test_it_works_without_a_network(story):
    answer = story.offline.answer
    assert (answer["version"], answer["enabled"]) == ("0.3.0", True), story.offline.output
    assert answer["settings"] == KEPT and answer["picture"][0]


def test_it_is_disabled_and_removed(story):
    answer = story.remove.answer
    assert answer["disabled"] == "and the engine has gone", story.remove.output
    assert answer["version"] == "", "its files are still there"
