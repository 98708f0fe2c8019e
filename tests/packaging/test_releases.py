"""What makes a release repeatable, and what it says of itself."""

import io
import json
import tomllib
import zipfile
from pathlib import Path

import pytest

from packed import bill_of_materials, blender, extension_zips, foreign, pack, release

pytestmark = pytest.mark.once

WHEELS = {
    "linux-x64": "glint_core-0.1.0+ab-py3-none-manylinux_2_17_x86_64.whl",
    "windows-arm64": "glint_core-0.1.0+ab-py3-none-win_arm64.whl",
    "macos-arm64": "glint_core-0.1.0+ab-py3-none-macosx_11_0_arm64.whl",
}


@pytest.fixture(scope="module")
def wheels(tmp_path_factory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("wheels")
    for name in WHEELS.values():
        (folder / name).write_text(name)
    return {platform: folder / name for platform, name in WHEELS.items()}


@pytest.fixture(scope="module")
def zips(tmp_path_factory, wheels) -> dict[str, Path]:
    found = extension_zips.split_zips(blender(), wheels, tmp_path_factory.mktemp("repository"))
    return dict(zip(wheels, found, strict=True))


def test_each_platform_gets_its_own_wheel(zips):
    for platform, path in zips.items():
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if name.endswith(".whl")]
            manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        assert names == [f"wheels/{WHEELS[platform]}"]
        assert manifest["build"]["generated"]["platforms"] == [platform]


def test_the_same_contents_are_the_same_zip(tmp_path):
    """Whatever their order, their times and their owners' rights."""
    made = []
    for name, order, when, mode in (("a", "xy", 1990, 0o600), ("b", "yx", 2020, 0o755)):
        path = tmp_path / f"{name}.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for entry in order:
                info = zipfile.ZipInfo(entry, (when, 1, 1, 0, 0, 0))
                info.external_attr = mode << 16
                archive.writestr(info, entry * 1000)
        made.append(path)
    assert made[0].read_bytes() != made[1].read_bytes()
    for path in made:
        extension_zips.same_bits(path)
    assert made[0].read_bytes() == made[1].read_bytes()
    with zipfile.ZipFile(made[0]) as archive:
        assert archive.namelist() == ["x", "y"] and archive.read("x") == b"x" * 1000


def test_no_file_tells_when_it_was_packed():
    """Neither in the zip of this machine's edition nor in the wheel inside."""
    with zipfile.ZipFile(pack("full")) as archive:
        [name] = [name for name in archive.namelist() if name.endswith(".whl")]
        entries = archive.infolist()
        with zipfile.ZipFile(io.BytesIO(archive.read(name))) as wheel:
            entries += wheel.infolist()
    assert {entry.date_time for entry in entries} == {(1980, 1, 1, 0, 0, 0)}


def test_a_repository_lists_its_zips_by_name(zips):
    folder = next(iter(zips.values())).parent
    release.index(blender(), folder)
    before = (folder / "index.json").read_bytes(), (folder / "index.html").read_bytes()
    data = json.loads(before[0])["data"]
    assert [entry["archive_url"] for entry in data] == sorted(f"./{p.name}" for p in zips.values())
    assert {entry["archive_hash"] for entry in data} == {
        f"sha256:{bill_of_materials.sha256(path.read_bytes())}" for path in zips.values()
    }
    places = [before[1].find(f"./{path.name}".encode()) for path in sorted(zips.values())]
    assert places == sorted(places) and places[0] > 0
    release.index(blender(), folder)
    assert ((folder / "index.json").read_bytes(), (folder / "index.html").read_bytes()) == before


def test_a_picture_that_differs_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(foreign, "PICTURES", tmp_path / "here.pictures")
    (tmp_path / "here.pictures").write_bytes(bytes(24))
    (tmp_path / "here.json").write_text('[["room", 0, 4], ["room", 3, 2]]')
    there = tmp_path / "there"
    there.write_bytes(bytes(24))
    assert foreign.differing(there) == []
    there.write_bytes(bytes(16) + b"\1" + bytes(7))
    assert foreign.differing(there) == ["room (pass 3)"]
    there.write_bytes(bytes(20))
    assert foreign.differing(there) == ["room (pass 3)", "the number of pictures"]


@pytest.mark.parametrize("platform", ["macos-x64", "macos-arm64", "windows-arm64"])
def test_what_nothing_here_runs_is_told(platform):
    with pytest.raises(foreign.CannotRun, match=f"runs programs for {platform}"):
        foreign.runner(platform)


def test_what_may_not_be_installed_is_told(monkeypatch):
    monkeypatch.setattr(foreign.os, "geteuid", lambda: 1000)
    with pytest.raises(foreign.CannotRun, match="apt-get install no-such-package"):
        foreign._program("no-such-program", "no-such-package")


def test_the_list_of_parts_is_of_the_files_alone(wheels, zips, tmp_path, monkeypatch):
    header = tmp_path / "lib" / "libcxx" / "include" / "__config"
    header.parent.mkdir(parents=True)
    header.write_text("#  define _LIBCPP_VERSION 210305\n")
    monkeypatch.setattr(bill_of_materials, "zig_folder", lambda _: tmp_path)
    files = list(zips.values())
    told = bill_of_materials.cyclonedx(blender(), files, wheels)
    assert told == bill_of_materials.cyclonedx(
        blender(), files[::-1], dict(reversed(wheels.items()))
    )
    parts = {part["bom-ref"]: part for part in told["components"]}
    for path in files:
        [told_hash] = parts[f"file:{path.name}"]["hashes"]
        assert told_hash["content"] == bill_of_materials.sha256(path.read_bytes())
    assert parts["library:libc++"]["version"] == "21.3.5"
    inside = {entry["ref"]: entry["dependsOn"] for entry in told["dependencies"]}
    assert "library:mingw-w64 runtime" in inside["core:windows-arm64"]
    assert "library:mingw-w64 runtime" not in inside["core:linux-x64"]
    assert all(ref in parts for refs in inside.values() for ref in refs)
    files[0].write_bytes(files[0].read_bytes() + b" ")
    after = bill_of_materials.cyclonedx(blender(), files, wheels)
    assert after["serialNumber"] != told["serialNumber"]


def test_the_table_of_the_page_is_what_releases_saw(tmp_path):
    """A release of some platforms changes their rows, and keeps what it did not look at."""
    text = release.TABLE.read_text(encoding="utf-8")
    page = tmp_path / "releases.md"
    page.write_text(text, encoding="utf-8")
    release.note({}, page)
    assert page.read_text(encoding="utf-8") == text
    release.note({"macos-x64": {"built": "1999-12-31", "built twice": "the same bits"}}, page)
    old, new = (t.splitlines() for t in (text, page.read_text(encoding="utf-8")))
    changed = [(a, b) for a, b in zip(old, new, strict=True) if a != b]
    assert [b for _, b in changed] == [
        "| macos-x64 | 1999-12-31 | as promised | the same bits | no | no | no |"
    ]
    rows = [line.split(" | ")[0] for line in text.splitlines() if line.startswith("| ")]
    assert {f"| {platform}" for platform in release.wheels.PLATFORMS} <= set(rows)
