"""What documents name: links, commands of the Makefile, files and folders of the tree."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("engine/**/*.md")])

_BASES = (ROOT, ROOT / "engine" / "core")
"""Where a name may start: documents write `src/bvh` for engine/core/src/bvh."""
_FOLDERS = (".ci", "addon", "bench", "docs", "engine", "include", "operators", "packaging", "src")
_FOLDERS += ("tests",)
_BLOCK = re.compile(r"```.*?```", re.DOTALL)
_SOURCE = re.compile(r"[\w*]+\.(py|h|cpp|cmake|md|sh|toml)")


def relative_links(text: str) -> list[str]:
    """Targets of links and pictures that are no addresses, without their anchors."""
    links = re.findall(r"\]\(([^)#]+)", text)
    return [link for link in links if "://" not in link]


def make_targets(text: str) -> set[str]:
    """Targets that a text calls with make, in backticks or at the start of a line of a block."""
    blocks = "".join(_BLOCK.findall(text))
    quoted = re.findall(r"`make ([a-z-]+)", text)
    return {*quoted, *re.findall(r"^make ([a-z-]+)", blocks, re.MULTILINE)}


def missing_paths(text: str) -> list[str]:
    """Names of files and folders in backticks that the tree lacks; globs count as names.

    Of several names in one pair of backticks the later ones lie beside the first: `engine/film.py
    scene.py`. A file without a folder may lie anywhere in the tree. Blocks of code are left out.
    """
    prose = _BLOCK.sub("", text)
    return [
        name for quoted in re.findall(r"`([^`]+)`", prose) for name in _missing_of_quoted(quoted)
    ]


def missing_names(text: str) -> list[str]:
    """Dotted names in backticks that the tree lacks, such as `engine.analysis.trade.measure`.

    Of a name in a module only the first part is looked for, as a word of the source.
    """
    dotted = re.findall(r"`((?:addon|engine|operators)(?:\.[A-Za-z]\w*)+)", _BLOCK.sub("", text))
    return [name for name in dotted if not _is_defined(name)]


def _is_defined(dotted: str) -> bool:
    place, parts = ROOT, dotted.split(".")
    while parts and (place / parts[0]).is_dir():
        place /= parts.pop(0)
    if parts and (place / f"{parts[0]}.py").is_file():
        module = place / f"{parts.pop(0)}.py"
    else:
        module = place / "__init__.py"
    words = re.findall(r"\w+", module.read_text(encoding="utf-8"))
    return not parts or parts[0] in words


def _missing_of_quoted(quoted: str) -> list[str]:
    words = [re.sub(r"^\w+=|[:,;].*$", "", word) for word in quoted.split()]
    folder, missing = None, []
    for word in words:
        if word.split("/")[0] in _FOLDERS and "/" in word:
            folder = Path(word).parent
            found = _exists(word)
        elif _SOURCE.fullmatch(word):
            found = _exists(str(folder / word)) if folder else _is_anywhere(word)
        else:
            continue
        if not found:
            missing.append(word)
    return missing


def _exists(pattern: str) -> bool:
    return any(next(base.glob(pattern.rstrip("/")), None) for base in _BASES)


def _is_anywhere(name: str) -> bool:
    folders = [ROOT / folder for folder in _FOLDERS if (ROOT / folder).is_dir()]
    return bool(next(ROOT.glob(name), None)) or any(
        next(folder.rglob(name), None) for folder in folders
    )
