"""The options of the commands, and those of the extension alone, as properties; the preferences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from .environment import KNOWN, Environment

#: The options of each command, as records.
COMMANDS: dict[str, list[dict[str, Any]]] = KNOWN["commands"]


def _items(*rows: tuple[str, str, str]) -> list[tuple[str, str, str]]:
    return list(rows)


def _property(record: dict[str, Any]) -> Any:
    """Return the property of an option; 0 stands for no value."""
    title = record["name"].replace("_", " ").capitalize()
    doc = record["doc"].rstrip(".")
    look = {"name": title, "description": doc if record["default"] != 0 else f"{doc}. 0: no value"}
    match record["kind"]:
        case "integer":
            bounds = {"min": int(min(record["least"], record["default"])), "max": int(record["most"])}
            return IntProperty(**look, **bounds, default=int(record["default"]))
        case "number":
            bounds = {"min": min(record["least"], record["default"]), "max": record["most"]}
            return FloatProperty(**look, **bounds, default=record["default"], precision=3)
        case "angle":
            return FloatProperty(**look, min=0.0, default=record["default"], subtype="ANGLE")
        case "weights":
            look["description"] = f"Vertex group. {doc}"
            return StringProperty(**look)
    words = [(word, word.replace("_", " ").capitalize(), "") for word in record["words"]]
    return EnumProperty(**look, items=words, default=record["default"])


def _group(command: str) -> type:
    """Return the class of the options of a command."""
    annotations = {record["name"]: _property(record) for record in COMMANDS[command]}
    name = f"CONEFLAT_PG_{command}"
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotations})


GROUPS = {command: _group(command) for command in COMMANDS}

_OWN = {
    "marks": EnumProperty(
        name="Marked seams",
        description="Marked seams that are cut",
        items=_items(
            ("OWN", "Yours", "Cut the seams that you have marked, not those that coneflat has marked"),
            ("ALL", "All", "Cut all marked seams"),
            ("NONE", "None", "Ignore marked seams"),
        ),
    ),
    "sharp": BoolProperty(name="Cut sharp edges", description="Also cut edges that are marked as sharp"),
    "together": BoolProperty(
        name="One atlas",
        description="Put all selected objects into one atlas, at one texel density; otherwise each has its own",
        default=True,
    ),
    "uv_map": StringProperty(
        name="UV map", description="UV map to write, which is added if it does not exist. Empty: the active one"
    ),
    "mark": BoolProperty(
        name="Mark seams", description="Mark the cut edges as seams, instead of those marked last", default=True
    ),
    "select": EnumProperty(
        name="Select",
        description="What to select in the result",
        items=_items(
            ("NONE", "Unchanged", "Keep the selection"),
            ("SEAMS", "Seams", "Select the cut edges"),
            ("CONES", "Cones", "Select the cone vertices, which are the irregular vertices of quads"),
        ),
    ),
    "modifiers": BoolProperty(
        name="Apply modifiers",
        description="Make quads of the mesh with its modifiers and shape keys, in object mode",
        default=True,
    ),
}
_POINTERS = {command: PointerProperty(type=group) for command, group in GROUPS.items()}
#: All settings, which are stored with each scene.
Settings = type(
    "CONEFLAT_PG_settings", (bpy.types.PropertyGroup,), {"__annotations__": {**_OWN, **_POINTERS}}
)


class Preferences(bpy.types.AddonPreferences):
    """Where coneflat is, and how it is installed."""

    bl_idname = __package__
    __annotations__ = {
        "python": StringProperty(
            name="Python",
            description="Python executable, or folder of an environment, that has coneflat. Empty: the "
            "extension's own environment, or one on the PATH",
            subtype="FILE_PATH",
        ),
        "wheels": StringProperty(
            name="Folder of wheels",
            description="Install from the wheels in this folder, without a network. Empty: from the package index",
            subtype="DIR_PATH",
        ),
        "requirement": StringProperty(
            name="Package",
            description="What pip installs, for example coneflat[fast]. Empty: coneflat, this version or later",
        ),
    }
    #: The environment that was found last, and why there is none.
    found: Environment | None = None
    reason = "not checked yet"

    def draw(self, context: Any) -> None:
        """Draw the environment and how to change it."""
        found = type(self).found
        self.layout.label(
            text=str(found) if found else type(self).reason, icon="CHECKMARK" if found else "INFO"
        )
        for name in self.__annotations__:
            self.layout.prop(self, name)
        row = self.layout.row()
        row.operator("coneflat.check")
        row.operator("coneflat.install")


def preferences(context: Any) -> Any:
    """Return the preferences of the extension."""
    return context.preferences.addons[__package__].preferences


def own_folder() -> Path:
    """Return the folder of the extension's environment, which stays when the extension is updated."""
    return Path(bpy.utils.extension_path_user(__package__, path="environment", create=True))
