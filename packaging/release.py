"""`make release`: everything that is handed out, in dist/release.

    repository/             a zip for each of six platforms, index.json and index.html: an extension
                            repository for any static file host
    glint-<version>-python.zip        for every other machine
    glint-<version>.cdx.json          what all of it is made of (CycloneDX)
    licences.txt            the texts of all licences
    platforms.txt            what was built, looked at and run
    SHA256SUMS              of all of these

Each core is looked at (binaries.py) and, where this machine can, run (foreign.py). The same sources
give the same bits: --twice builds a copy of them elsewhere and compares. --note writes what was
seen into the table of docs/releases.md.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import bill_of_materials
import environment
import extension_zips
import foreign
import tree
import wheels

RELEASE = tree.DIST / "release"
REPOSITORY = RELEASE / "repository"
SUMS = RELEASE / "SHA256SUMS"
TEMPLATE = Path(__file__).with_name("repository.html")
TABLE = tree.ROOT / "docs" / "releases.md"
COLUMNS = ("built", "linked", "built twice", "run", "the core's tests", "reference renders")
Seen = dict[str, dict[str, str]]
"""Platform → column → what was seen there."""


def make(blender: tree.Blender, platforms: list[str]) -> dict[str, Path]:
    """Build and pack; the wheel of each platform."""
    shutil.rmtree(RELEASE, ignore_errors=True)
    RELEASE.mkdir(parents=True)
    built = {platform: wheels.build(blender, platform) for platform in platforms}
    zips = extension_zips.split_zips(blender, built, REPOSITORY)
    python = RELEASE / extension_zips.python_zip(blender).name
    shutil.copy2(extension_zips.python_zip(blender), python)
    index(blender, REPOSITORY)
    version = tree.manifest()["version"]
    bill = bill_of_materials.cyclonedx(blender, [*zips, python], built)
    (RELEASE / f"glint-{version}.cdx.json").write_text(json.dumps(bill, indent=1) + "\n")
    (RELEASE / "licences.txt").write_text(bill_of_materials.licences(blender))
    return built


def index(blender: tree.Blender, folder: Path) -> None:
    """Make a folder of zips an extension repository. Blender lists them as the folder does, in any
    order; here in that of their names.
    """
    options = ("--repo-dir", folder, "--html", "--html-template", TEMPLATE)
    extension_zips.blender_extension(blender, "server-generate", *options)
    listing, page = folder / "index.json", folder / "index.html"
    content = json.loads(listing.read_text())
    content["data"].sort(key=lambda entry: entry["archive_url"])
    listing.write_text(json.dumps(content, indent=2))
    rows = r"((?:  <tr>\n    <td>.*?</tr>\n)+)"
    page.write_text(re.sub(rows, _sorted_rows, page.read_text(), flags=re.DOTALL))


def _sorted_rows(rows: re.Match[str]) -> str:
    return "".join(sorted(re.findall(r"  <tr>.*?</tr>\n", rows[1], re.DOTALL)))


def run(blender: tree.Blender, built: dict[str, Path]) -> Seen:
    """What was run; what cannot be run here says so."""
    foreign.record(blender)
    seen = {}
    for platform, wheel in built.items():
        try:
            ran = (
                foreign.run_tests(blender, platform, wheel),
                f"the same bits with {foreign.play(blender, platform, wheel)}",
            )
        except foreign.CannotRun as reason:
            ran = (f"not run: {reason}", "no")
        seen[platform] = dict(zip(COLUMNS[-2:], ran, strict=True))
        print(f"glint: {platform}: {'; '.join(ran)}", flush=True)
    return seen


def table(seen: Seen, before: str = "") -> str:
    """A row for each platform; before: a table whose cells stay where nothing was seen now."""
    cells: Seen = {}
    for line in before.splitlines()[2:]:
        platform, *row = line.strip("| ").split(" | ")
        cells[platform] = dict(zip(COLUMNS, row, strict=True))
    for platform, found in seen.items():
        cells[platform] = dict.fromkeys(COLUMNS, "no") | cells.get(platform, {}) | found
    rows = [f"| {' | '.join((p, *(row[name] for name in COLUMNS)))} |" for p, row in cells.items()]
    head = [f"| {' | '.join(('platform', *COLUMNS))} |", "|" + "---|" * (1 + len(COLUMNS))]
    return "\n".join([*head, *rows, ""])


def note(seen: Seen, page: Path = TABLE) -> None:
    """Put what was seen into the table of the page on releases."""
    text = page.read_text(encoding="utf-8")
    before = re.search(r"^\| platform \|.*\n(?:\|.*\n)+", text, re.MULTILINE)[0]
    page.write_text(text.replace(before, table(seen, before)), encoding="utf-8")


def add_up() -> str:
    """Write the checksums of all files, and return them."""
    files = sorted(path for path in RELEASE.rglob("*") if path.is_file() and path != SUMS)
    text = "".join(
        f"{bill_of_materials.sha256(path.read_bytes())}  {path.relative_to(RELEASE).as_posix()}\n"
        for path in files
    )
    SUMS.write_text(text)
    return text


def again(platforms: list[str]) -> str:
    """The checksums that a copy of the sources gives elsewhere."""
    other = tree.BUILD / "again" / "another" / "place"
    shutil.rmtree(other, ignore_errors=True)
    names = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=tree.ROOT,
        capture_output=True,
        check=True,
    ).stdout.decode()
    for name in filter(None, names.split("\0")):
        if (tree.ROOT / name).is_file():
            (other / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(tree.ROOT / name, other / name)
    for venv in tree.ROOT.glob(".venv*"):
        (other / venv.name).symlink_to(venv)
    command = [environment.find_python("3.11"), other / "packaging" / "release.py", "--only"]
    tree.call([*command, *platforms, "--build"], "The copy does not build.", cwd=other)
    return (other / SUMS.relative_to(tree.ROOT)).read_text()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bpy", default="")
    parser.add_argument("--only", nargs="*", choices=sorted(wheels.PLATFORMS), default=[])
    parser.add_argument("--build", action="store_true", help="run nothing")
    parser.add_argument("--twice", action="store_true", help="build a copy elsewhere and compare")
    parser.add_argument("--note", action="store_true", help="write the table of docs/releases.md")
    options = parser.parse_args()
    blender = environment.prepare(options.bpy)
    wheels.install_tools(blender)
    platforms = options.only or list(wheels.PLATFORMS)
    built = make(blender, platforms)
    day = f"{datetime.now(UTC):%Y-%m-%d}"
    seen = {platform: {"built": day, "linked": "as promised"} for platform in platforms}
    before = add_up()
    if options.twice:
        with tree.step("building a copy of the sources elsewhere"):
            after = again(platforms)
        other = sorted(set(before.splitlines()) ^ set(after.splitlines()))
        if other:
            raise tree.SetupError("\n".join(["building twice gives other bits:", *other]))
        print(f"glint: {len(before.splitlines())} files have the same bits when built twice")
        for row in seen.values():
            row["built twice"] = "the same bits"
    if not options.build:
        for platform, row in run(blender, built).items():
            ran = "no" if row[COLUMNS[-1]] == "no" else day
            seen[platform] |= {"run": ran} | row
        (RELEASE / "platforms.txt").write_text(table(seen))
        add_up()
    if options.note:
        note(seen)
    print(f"glint: {RELEASE.relative_to(tree.ROOT)} is ready")
    return 0


if __name__ == "__main__":
    tree.main(main)
