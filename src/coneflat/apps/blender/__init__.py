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
from ...options import Options
from ...quadmesh import QUADS, QuadOptions
from ...textures import UnwrapOptions
from ..controls import controls_of

#: The options of each command.
COMMANDS: dict[str, type] = {"unwrap": UnwrapOptions, "flatten": Options, "quads": QuadOptions}
#: The options of the commands that the extension does not show, by the reason.
HIDDEN = {
    "Blender has the mesh and takes the result": (
        "mesh", "output", "format", "texture", "uv_set", "project", "grid", "view",
    ),
    "the extension shows the measures and notes": ("report", "required", "verbosity"),
    "meshes are repaired, and objects that touch are not merged": ("repair", "strict", "weld"),
    "cones, method and charts have the same effect": ("paper",),
    "seams are marked in Blender; those of unwrap have a further word": ("flatten seams",),
}  # fmt: skip
#: What differs from the declarations of options.
_OTHERWISE: dict[str, dict[str, Any]] = {
    "seams": {"doc": "none: only marked seams and those that open each component, whatever the energy"},
    "quads": {"default": QUADS, "is_optional": False},
}
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
    """Return the version, and the controls of the options of each command, group by group, for `options.json`."""
    hidden = {name for names in HIDDEN.values() for name in names}
    commands = {}
    for command, options in COMMANDS.items():
        controls = controls_of(options, {name.removeprefix(f"{command} ") for name in hidden})
        commands[command] = [control | _OTHERWISE.get(control["name"], {}) for control in controls]
    return {"version": __version__, "commands": commands}
