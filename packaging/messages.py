"""Every note, warning and error that Glint can print, read off the code, with what to do about
each: `python packaging/messages.py` writes docs/manual/messages.md anew.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from dataclasses import dataclass

import tree
from message_remedies import REMEDIES

PAGE = tree.ROOT / "docs" / "manual" / "messages.md"
WHOLE = ("addon/export", "addon/render", "addon/viewport", "addon/ui/properties.py")
"""Where every sentence is a message, whatever becomes of it."""
NO_MESSAGES = (
    "addon/export/approximations",
    "addon/render/statistics",
    "addon/viewport/status",
    "engine/analysis/explain",
    "engine/linear",
    "engine/native/pack",
    "engine/native/programs",
    "engine/program",
)
"""What says what was done, is read as an answer, or checks what was checked before."""
FRAGMENTS = {"ImageError", "PhotometryError", "LookupError", "AttributeError", "KeyboardInterrupt"}
"""Exceptions whose texts are parts of a note."""
GROUPS = (
    ("Camera and frame", r"addon/export/(camera|panorama)"),
    ("Images", r"addon/export/(images|photometry)|shader_nodes/ies"),
    ("Materials and nodes", r"addon/export/(materials|shader_nodes)"),
    ("Lights and world", r"addon/export/(light|skies|world|darkness)"),
    ("Objects", r"addon/export|engine/scene/left_out|engine/evaluation/geometry"),
    ("The render", r"addon/|engine/native/(binding|job)"),
    ("Tools", r"operators/"),
    ("Scenes and settings made in Python", r"engine/"),
)
"""Heading, and which modules' messages stand under it: the first that fits."""
VERBS = re.compile(
    "add|bake|choose|clear|close|compare|compile|convert|decode|draw|enable|exclude|find|give|hide|"
    "install|keep|leave|let|link|look|make|move|name|put|raise|relocate|remove|render|repair|replace|"
    "restart|scale|set|simplify|start|subdivide|take|turn|unlink|unset|use|write"
)
"""With which a message's own remedy begins."""
_FEWEST, _FEWEST_TOLD = 4, 2
"""Spaces of a text that is a sentence, and of one that is told."""
_TEXTS = (ast.Constant, ast.JoinedStr, ast.BinOp)
_HEAD = """# Messages

Every warning, note and error that Glint prints, with what to do. Look a message up by its first
words; `…` stands for a name or a number. After a render they stand in Render properties →
**Statistics**. By what you see instead: [Troubleshooting](troubleshooting.md).

<!-- kept by packaging/messages.py -->
"""

_CORE = """
## The core's own checks

The core looks at everything again before it trusts it. What Python makes was checked before, so
none of these is seen in Blender: where one is, it is a fault of Glint's; send the file. A program
that fills the core's structures itself reads here what is wrong with them.

"""
_STRING = r'"(?:[^"\\\n]|\\.)*"'


@dataclass(frozen=True)
class Message:
    """group: the heading that it stands under. text: with … for what is filled in."""

    group: str
    text: str

    @property
    def split(self) -> tuple[str, str]:
        """What is said, and what to do about it: a remedy of the message's own, else of
        `REMEDIES`; "" where there is none.
        """
        if self.text in REMEDIES:
            return self.text, REMEDIES[self.text]
        ends = [m.end() for m in re.finditer(r"[;:] ", self.text)]
        for end in ends:
            if VERBS.fullmatch(self.text[end:].split(" ")[0]):
                return self.text[: end - 2], _sentence(self.text[end:])
        return self.text, ""


@functools.cache
def messages() -> list[Message]:
    """Each once, in the order of the groups, by their texts."""
    paths = [
        p for room in ("addon", "operators", "engine") for p in (tree.ROOT / room).rglob("*.py")
    ]
    trees = {str(p.relative_to(tree.ROOT)): ast.parse(p.read_text("utf-8")) for p in sorted(paths)}
    found = {
        Message(_group(name), text)
        for name, module in trees.items()
        if not name.startswith(NO_MESSAGES)
        for text in _texts(name, module)
    }
    order = [heading for heading, _ in GROUPS]
    return sorted(found, key=lambda m: (order.index(m.group), m.text.strip("…'\" ").lower()))


def core_messages() -> list[str]:
    """What the core's API refuses, each once."""
    paths = [*sorted((tree.CORE / "src" / "api").glob("*.cpp")), tree.CORE / "src/session/job.cpp"]
    texts = (text for path in paths for text in core_texts(path.read_text(encoding="utf-8")))
    return sorted(set(texts), key=str.lower)


def core_texts(source: str) -> list[str]:
    """The sentences in a C++ file, in the order in which they stand there."""
    bare = re.sub(r"//[^\n]*|#include[^\n]*|static_assert[^;]*;", "", source)
    strings = (match[0] for match in re.finditer(rf"{_STRING}(?:\s*{_STRING})*", bare))
    texts = ("".join(part[1:-1] for part in re.findall(_STRING, whole)) for whole in strings)
    return [re.sub(r"%\w+", "…", text) for text in texts if text.count(" ") >= _FEWEST_TOLD]


def page() -> str:
    """The page as it should be."""
    text = _HEAD
    for heading, _ in GROUPS:
        text += f"\n## {heading}\n\n| message | what to do |\n|---|---|\n"
        rows = (message.split for message in messages() if message.group == heading)
        text += "".join(f"| {_cell(said)} | {_cell(remedy)} |\n" for said, remedy in rows)
    return text + _CORE + "".join(f"- {_cell(said)}\n" for said in core_messages())


def _cell(text: str) -> str:
    return re.sub(r"([|*<>])", r"\\\1", text).replace("\n", " ")


def _sentence(text: str) -> str:
    return text[0].upper() + text[1:]


def _group(name: str) -> str:
    return next(heading for heading, pattern in GROUPS if re.search(pattern, name))


def _texts(name: str, module: ast.Module) -> Iterator[str]:
    """Of a module: what is noted, reported, raised and yielded, and in `WHOLE` all sentences."""
    silent = set(_silent(module))
    told = (t for node in _told(module) for t in _strings(node, silent))
    found = [t for t in told if t.count(" ") >= _FEWEST_TOLD]
    if name.startswith(WHOLE):
        found += (t for t in _strings(module, silent) if _is_sentence(t))
    yield from (text for text in map(_clean, found) if len(re.findall(r"\w+", text)) > 1)


def _told(module: ast.Module) -> Iterator[ast.AST]:
    """The expressions of which messages are made."""
    for node in ast.walk(module):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            if _called(node.exc) not in FRAGMENTS:
                yield from node.exc.args[:1]
        elif isinstance(node, ast.Call) and _called(node) == "report" and len(node.args) == 2:
            yield node.args[1]
        elif isinstance(node, ast.Call) and _called(node) == "note":
            yield from node.args[:1]
        elif isinstance(node, ast.Yield):
            value = node.value.elts[0] if isinstance(node.value, ast.Tuple) else node.value
            if isinstance(value, _TEXTS):
                yield value


def _silent(module: ast.Module) -> Iterator[int]:
    """Ids of the strings that nobody prints: documentation, tooltips, the log's, parts of others,
    fragments of notes.
    """
    for node in ast.walk(module):
        body = getattr(node, "body", None)
        for line in body if isinstance(body, list) else ():
            if isinstance(line, ast.Expr):
                yield id(line.value)
        if isinstance(node, ast.JoinedStr):
            yield from (id(part) for whole in node.values for part in ast.walk(whole))
        hidden = isinstance(node, ast.Call) and (
            _called(node) in {"info", "debug", "exception", "warning", *FRAGMENTS}
            or _called(node).endswith("Property")
            or _called(node) == "_part"
        )
        if hidden or (isinstance(node, ast.Assign) and _is_table_of_choices(node)):
            yield from (id(part) for part in ast.walk(node))


def _is_table_of_choices(node: ast.Assign) -> bool:
    return isinstance(node.targets[0], ast.Name) and node.targets[0].id.endswith("ITEMS")


def _called(call: ast.Call) -> str:
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def _strings(root: ast.AST, silent: set[int]) -> Iterator[str]:
    for node in ast.walk(root):
        if id(node) in silent:
            continue
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value
        elif isinstance(node, ast.JoinedStr):
            parts = (p.value if isinstance(p, ast.Constant) else "…" for p in node.values)
            yield "".join(map(str, parts))


def _clean(text: str) -> str:
    """With … for each name and number, and for several in a row."""
    filled = re.sub(r"'?\{\}'?", "…", text)
    return re.sub(r"(…\s*)+(?=…)", "", re.sub(r"'…'", "…", filled)).strip()


def _is_sentence(text: str) -> bool:
    begins = text[:1].isupper() or text.startswith(("'", "{}")) or "{}" in text
    return text.count(" ") >= _FEWEST and begins and "\n" not in text


def problems() -> list[str]:
    """What keeps the page from being right, a line each."""
    known = messages()
    texts = {message.text for message in known}
    missing = [m.text for m in known if not m.split[1]]
    lines = [f"packaging/message_remedies.py: no remedy for {text!r}" for text in missing]
    gone = [text for text in REMEDIES if text not in texts]
    lines += [f"packaging/message_remedies.py: nothing says {text!r} any more" for text in gone]
    if PAGE.read_text(encoding="utf-8") != page():
        lines.append("docs/manual/messages.md is stale: python packaging/messages.py writes it")
    return lines


def main() -> int:
    PAGE.write_text(page(), encoding="utf-8")
    found = problems()
    print(*found, sep="\n", end="\n" if found else "")
    return bool(found)


if __name__ == "__main__":
    tree.main(main)
