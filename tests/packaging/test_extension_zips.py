"""What the two zips hold. Blender's validator has accepted each when it was packed."""

import io
import posixpath
import re
import shutil
import subprocess
import tomllib
import zipfile
from pathlib import PurePosixPath

import pytest

from documents import relative_links
from packed import pack

pytestmark = pytest.mark.once

DEVELOPMENT = (
    "tests/",
    "packaging/",
    "Makefile",
    "pyproject.toml",
    ".ci/",
    ".git",
    "build/",
    "engine/core/",
    "__pycache__",
)


def _open(edition: str) -> zipfile.ZipFile:
    return zipfile.ZipFile(pack(edition))


@pytest.mark.parametrize("edition", ["full", "python"])
def test_every_link_of_a_packed_document_leads_to_a_packed_file(edition):
    archive = _open(edition)
    names = set(archive.namelist())
    folders = {str(folder) for name in names for folder in PurePosixPath(name).parents}
    pages = [name for name in names if name.endswith(".md")]
    assert {"README.md", "ARCHITECTURE.md", "docs/semantics/README.md"} <= set(pages)
    broken = [
        f"{page}: {link}"
        for page in pages
        for link in relative_links(archive.read(page).decode())
        if posixpath.normpath(posixpath.join(posixpath.dirname(page), link)) not in names | folders
    ]
    assert not broken


def test_a_relative_link_is_told_from_an_address_and_an_anchor():
    text = "[a](b/c.md#d) ![e](f.png) [g](https://h.org/i) [j](#k)"
    assert relative_links(text) == ["b/c.md", "f.png"]


@pytest.mark.parametrize("edition", ["full", "python"])
def test_a_zip_holds_the_add_on_and_nothing_of_its_development(edition):
    names = _open(edition).namelist()
    assert {
        "__init__.py",
        "blender_manifest.toml",
        "LICENSE",
        "addon/render/render_engine.py",
        "engine/scene/model.py",
        "operators/__init__.py",
    } <= set(names)
    assert not [
        name
        for name in names
        for part in DEVELOPMENT
        if name.startswith(part) or f"/{part}" in name
    ]
    assert not [name for name in names if name.endswith((".cpp", ".h", ".pyc", ".so"))]


def test_only_the_full_zip_has_the_core():
    wheels = {
        edition: [name for name in _open(edition).namelist() if name.endswith(".whl")]
        for edition in ("full", "python")
    }
    assert len(wheels["full"]) == 1
    assert "py3-none-" in wheels["full"][0], "one wheel must serve every Python"
    assert wheels["python"] == []


def test_a_core_that_changed_has_another_version(tmp_path, monkeypatch):
    """Blender keeps the installed wheel of a version, whatever the new one holds."""
    import core_version  # `packed` knows where

    [name] = [name for name in _open("full").namelist() if name.endswith(".whl")]
    version = core_version.dynamic_metadata("version", {})
    assert f"/glint_core-{version}-py3-" in name
    shutil.copytree(core_version.ROOT / "engine" / "core", tmp_path / "engine" / "core")
    shutil.copy(core_version.ROOT / "blender_manifest.toml", tmp_path)
    monkeypatch.setattr(core_version, "ROOT", tmp_path)
    assert core_version.dynamic_metadata("version", {}) == version
    source = next((tmp_path / "engine" / "core" / "src").rglob("*.cpp"))
    source.write_text(source.read_text() + "// changed\n")
    changed = core_version.dynamic_metadata("version", {})
    assert changed != version and changed.split("+")[0] == version.split("+")[0]


@pytest.mark.skipif(
    not shutil.which("objdump"),
    reason="needs objdump, which says independently what a library asks for",
)
def test_the_wheel_is_named_after_the_c_library_that_it_needs(tmp_path):
    archive = _open("full")
    [name] = [name for name in archive.namelist() if name.endswith(".whl")]
    with zipfile.ZipFile(io.BytesIO(archive.read(name))) as wheel:
        library = wheel.extract("glint_core/libglint_core.so", tmp_path)
    table = subprocess.run(
        ["objdump", "-p", library], capture_output=True, text=True, check=True
    ).stdout
    needed = re.findall(r" GLIBC_(\d+)\.(\d+)", table)
    assert needed and not re.search("GLIBCXX|CXXABI|GCC_", table)
    major, minor = max((int(major), int(minor)) for major, minor in needed)
    assert f"-manylinux_{major}_{minor}_" in name


def test_the_manifest_says_what_the_add_on_does_with_files_and_clipboard():
    manifest = tomllib.loads(_open("full").read("blender_manifest.toml").decode())
    assert manifest["permissions"].keys() == {"files", "clipboard"}
    assert all(word in manifest["permissions"]["files"] for word in ("Reads", "writes"))


def test_the_manifests_differ_in_platform_and_wheel_alone():
    full, python = (
        tomllib.loads(_open(edition).read("blender_manifest.toml").decode())
        for edition in ("full", "python")
    )
    assert full.pop("wheels") == [
        f"./{name}" for name in _open("full").namelist() if name.endswith(".whl")
    ]
    assert len(full.pop("platforms")) == 1
    assert full == python
    assert (full["id"], full["blender_version_min"], full["license"]) == (
        "glint",
        "4.2.0",
        ["SPDX:GPL-3.0-or-later"],
    )


def test_the_names_say_version_and_edition():
    version = tomllib.loads(_open("python").read("blender_manifest.toml").decode())["version"]
    assert pack("python").name == f"glint-{version}-python.zip"
    assert pack("full").name.startswith(f"glint-{version}-linux_")
