"""The Blender extension: its files are those of `extension`, which run inside Blender without this package.

`build_extension` writes them into a zip, with the options of the commands as `options.json`, so that a default is
written once.
"""

from __future__ import annotations

import json
import zipfile
from os import PathLike
from pathlib import Path
from typing import Any

from ... import __version__
from ...io import atomic_write, checked_target
from ...options import Choice, Declaration, Direction, Number, Options, Weights, WordOrVertices, declarations
from ..unwrap.options import UnwrapOptions

_TEXTURE = ("seam_weights", "sharp_angle", "hide_seams", "resolution", "padding", "tiles", "up")
#: The options of each command that the extension shows.
SHOWN: dict[str, tuple[str, ...]] = {
    "unwrap": ("max_energy", "texel_density", *_TEXTURE),
    "flatten": ("distortion", "cone_count", "weights", "quantise", "boundary", "stretch", *_TEXTURE),
    "quads": (
        "quads", "size", "stretch", "boundary", "sharp_angle", "distortion", "cone_count", "weights", "smooth",
    ),
}  # fmt: skip
#: Files of the extension that are copied into the zip; its version is filled in.
_MANIFEST = "blender_manifest.toml"


def build_extension(path: str | PathLike[str]) -> Path:
    """Write the extension as a zip that Blender installs, and return its path.

    Args:
        path: the file, .zip.

    Raises:
        UnknownFormatError: the ending is not .zip.
        MeshFileError: the file cannot be written.
    """
    path = checked_target(path, (".zip",), "extensions are written as")
    folder = Path(__file__).parent / "extension"
    files = {file.name: file.read_text(encoding="utf-8") for file in sorted(folder.glob("*.py"))}
    manifest = (folder / _MANIFEST).read_text(encoding="utf-8")
    files[_MANIFEST] = manifest.replace("VERSION", __version__)
    files["options.json"] = json.dumps(option_records(), indent=1)
    with atomic_write(path) as stream, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            # A ZipInfo has a fixed time, so that the same version gives the same zip.
            archive.writestr(zipfile.ZipInfo(name), text, zipfile.ZIP_DEFLATED)
    return path


def option_records() -> dict[str, Any]:
    """Return the version, and the options of each command as records, for `options.json`."""
    from ..quads.options import QUADS, QuadOptions

    known = {"unwrap": UnwrapOptions, "flatten": Options, "quads": QuadOptions}
    found: dict[str, Any] = {"version": __version__, "commands": {}}
    for command, names in SHOWN.items():
        declared = declarations(known[command])
        found["commands"][command] = [_record(declared[name]) for name in names]
    number = next(each for each in found["commands"]["quads"] if each["name"] == "quads")
    number |= {"default": QUADS, "is_optional": False}
    return found


def _record(declaration: Declaration) -> dict[str, Any]:
    """Return an option as numbers and texts; numbers without a default have 0, words the first."""
    kind, default = declaration.kind, declaration.default
    record: dict[str, Any] = {"name": declaration.name, "group": declaration.group, "doc": declaration.doc}
    record["is_optional"] = isinstance(kind, Number) and default is None
    match kind:
        case Number():
            word = "angle" if kind.is_angle else "integer" if kind.is_integer else "number"
            least = 0 if kind.least < 0 else kind.least
            record |= {"kind": word, "default": default or 0, "least": least, "most": min(kind.most, 2**30)}
        case Choice() | WordOrVertices():
            record |= {"kind": "choice", "default": default, "words": list(kind.words)}
        case Direction():
            words = ["none", "x", "y", "z", "-x", "-y", "-z"]
            record |= {"kind": "choice", "default": words[0], "words": words}
        case Weights():
            record |= {"kind": "weights", "default": ""}
        case _:
            raise TypeError(f"{declaration.name} has no control in Blender")
    return record
