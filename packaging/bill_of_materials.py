"""What a release is made of: a CycloneDX list of its files and of the foreign code that is linked
into the cores, and the texts of their licences.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import re
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tree


@dataclass(frozen=True)
class Linked:
    """Code of others in the cores. licence: an SPDX expression. text: its file in Zig's package.
    systems: where it is linked.
    """

    name: str
    licence: str
    text: str
    systems: tuple[str, ...]


_ALL = ("linux", "windows", "macos")
_LLVM = "Apache-2.0 WITH LLVM-exception"
LINKED = (
    Linked("libc++", _LLVM, "lib/libcxx/LICENSE.TXT", _ALL),
    Linked("libc++abi", _LLVM, "lib/libcxxabi/LICENSE.TXT", _ALL),
    Linked("libunwind", _LLVM, "lib/libunwind/LICENSE.TXT", ("linux", "windows")),
    Linked("compiler-rt of Zig", "MIT", "LICENSE", _ALL),
    Linked("mingw-w64 runtime", "ZPL-2.1", "lib/libc/mingw/COPYING", ("windows",)),
)


def zig_folder(blender: tree.Blender) -> Path:
    return blender.bpy.parent / "ziglang"


def licences(blender: tree.Blender) -> str:
    """The texts of all licences, one after the other; the same text is told once."""
    texts: dict[str, list[str]] = {(tree.ROOT / "LICENSE").read_text(): ["Glint"]}
    for part in LINKED:
        text = (zig_folder(blender) / part.text).read_text()
        texts.setdefault(text, []).append(part.name)
    rule = "=" * 80
    return "\n".join(
        f"{rule}\n{', '.join(names)}\n{rule}\n\n{text.strip()}\n" for text, names in texts.items()
    )


def cyclonedx(blender: tree.Blender, files: list[Path], wheels: dict[str, Path]) -> dict[str, Any]:
    """The list, for the files of a release and the cores in them; the same for the same bits."""
    version = tree.manifest()["version"]
    when = datetime.datetime.fromtimestamp(tree.source_date(), datetime.UTC)
    product = _component("application", "glint", version, "GPL-3.0-or-later")
    zips = [_file(path) for path in sorted(files)]
    cores = [_core(platform, wheel) for platform, wheel in sorted(wheels.items())]
    parts = [_linked(blender, part) for part in LINKED]
    inside = {
        f"core:{platform}": [
            f"library:{part.name}" for part in LINKED if platform.split("-")[0] in part.systems
        ]
        for platform in sorted(wheels)
    }
    body = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "timestamp": when.strftime("%Y-%m-%dT%H:%M:%SZ"),
            "tools": {"components": [_zig()]},
            "component": product,
        },
        "components": [*zips, *cores, *parts],
        "dependencies": [
            {"ref": product["bom-ref"], "dependsOn": sorted(inside)},
            *({"ref": ref, "dependsOn": linked} for ref, linked in inside.items()),
        ],
    }
    number = uuid.uuid5(uuid.NAMESPACE_OID, json.dumps(body, sort_keys=True))
    return {**body, "serialNumber": f"urn:uuid:{number}"}


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _component(kind: str, name: str, version: str, licence: str) -> dict[str, Any]:
    plain = " " not in licence
    told = {"license": {"id": licence}} if plain else {"expression": licence}
    return {
        "type": kind,
        "bom-ref": f"{kind}:{name}",
        "name": name,
        "version": version,
        "licenses": [told],
    }


def _file(path: Path) -> dict[str, Any]:
    return {
        "type": "file",
        "bom-ref": f"file:{path.name}",
        "name": path.name,
        "hashes": [{"alg": "SHA-256", "content": sha256(path.read_bytes())}],
    }


def _core(platform: str, wheel: Path) -> dict[str, Any]:
    version = wheel.name.split("-")[1]
    part = _component("library", f"glint_core for {platform}", version, "GPL-3.0-or-later")
    hashes = [{"alg": "SHA-256", "content": sha256(wheel.read_bytes())}]
    return {**part, "bom-ref": f"core:{platform}", "hashes": hashes}


def _linked(blender: tree.Blender, part: Linked) -> dict[str, Any]:
    """LLVM's libraries have LLVM's version, the others that of Zig, which brings them."""
    version = _zig()["version"]
    if part.licence == _LLVM:
        header = (zig_folder(blender) / "lib/libcxx/include/__config").read_text()
        number = int(re.search(r"define _LIBCPP_VERSION (\d+)", header)[1])
        version = f"{number // 10000}.{number // 100 % 100}.{number % 100}"
    return _component("library", part.name, version, part.licence)


def _zig() -> dict[str, Any]:
    [pinned] = [
        name
        for name in tree.settings()["dependency-groups"]["wheels"]
        if name.startswith("ziglang")
    ]
    return {"type": "application", "name": "ziglang", "version": pinned.split("==")[1]}
