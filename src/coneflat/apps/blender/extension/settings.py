"""The options of the commands, and those of the extension alone, as properties; the preferences."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from .environment import OPTIONS_FILE, Environment

#: The options of each command, as records.
COMMANDS: dict[str, list[dict[str, Any]]] = OPTIONS_FILE["commands"]


def _property(record: dict[str, Any]) -> Any:
    """Return the property of an option; 0 stands for no value."""
    title = record["name"].replace("_", " ").capitalize()
    is_group = record["kind"] in ("weights", "vertices")
    doc = record["doc"].rstrip(".") + (". 0: no value" if record.get("is_optional") else "")
    look = {"name": title, "description": f"Vertex group. {doc}" if is_group else doc}
    if record["kind"] in ("integer", "number"):
        kind, make = (int, IntProperty) if record["kind"] == "integer" else (float, FloatProperty)
        default = kind(record["default"])
        look |= {"min": min(kind(record["least"]), default), "max": kind(record["most"])}
        return make(**look, default=default)
    if record["kind"] == "angle":
        return FloatProperty(**look, min=0.0, default=record["default"], subtype="ANGLE")
    if is_group or record["kind"] == "text":
        suggested = {} if is_group else {"search": lambda item, context, text: record["words"]}
        return StringProperty(**look, **suggested, default=record["default"])
    if record["kind"] == "flag":
        return BoolProperty(**look, default=record["default"])
    words = [(word, word.capitalize(), "") for word in record["words"]]
    return EnumProperty(**look, items=words, default=record["default"])


def _group(name: str, properties: dict[str, Any]) -> type:
    """Return the class of a group of properties."""
    return type(f"CONEFLAT_PG_{name}", (bpy.types.PropertyGroup,), {"__annotations__": properties})


#: The classes of the options of each command.
GROUPS = {
    command: _group(command, {record["name"]: _property(record) for record in records})
    for command, records in COMMANDS.items()
}

_MARKS = [
    ("OWN", "Yours", "Cut the seams that you have marked, not those that coneflat has marked"),
    ("ALL", "All", "Cut all marked seams"),
    ("NONE", "None", "Ignore marked seams"),
]
_SELECTED = [
    ("NONE", "Unchanged", "Keep the selection"),
    ("SEAMS", "Seams", "Select the cut edges"),
    ("CONES", "Cones", "Select the cone vertices, which are the irregular vertices of quads"),
]
_ATLAS = "Put all selected objects into one atlas, at one texel density; otherwise each has its own"
_MAP = (
    "UV map to write, which is added if it does not exist. Empty: the active one, or Lightmap for a lightmap"
)
_MARK = "Mark the cut edges as seams, instead of those that coneflat has marked before"
_APPLY = "Make quads of the mesh with its modifiers and shape keys, in object mode"
_MAP_SETTINGS = {
    "marks": EnumProperty(name="Marked seams", description="Marked seams that are cut", items=_MARKS),
    "sharp": BoolProperty(name="Cut sharp edges", description="Also cut edges that are marked as sharp"),
    "together": BoolProperty(name="One atlas", description=_ATLAS, default=True),
    "uv_map": StringProperty(name="UV map", description=_MAP),
    "mark": BoolProperty(name="Mark seams", description=_MARK, default=True),
    "select": EnumProperty(name="Select", description="What to select in the result", items=_SELECTED),
    "modifiers": BoolProperty(name="Apply modifiers", description=_APPLY, default=True),
}
_POINTERS = {command: PointerProperty(type=group) for command, group in GROUPS.items()}
#: All settings, which are stored with each scene.
Settings = _group("settings", {**_MAP_SETTINGS, **_POINTERS})


_PYTHON = "Python or environment that has coneflat. Empty: the extension's own, or one on the PATH"
_WHEELS = "Folder of wheels of coneflat and what it needs, from which Install makes its environment"
_PACKAGE = "What pip installs, for example a wheel. Empty: coneflat, this version or later, from the folder of wheels"

#: The properties of the preferences, in the order in which they are drawn.
_SHOWN = {
    "python": StringProperty(name="Python", description=_PYTHON, subtype="FILE_PATH"),
    "wheels": StringProperty(name="Folder of wheels", description=_WHEELS, subtype="DIR_PATH"),
    "requirement": StringProperty(name="Package", description=_PACKAGE),
}


class Preferences(bpy.types.AddonPreferences):
    """Where coneflat is, and how it is installed."""

    bl_idname = __package__
    __annotations__ = dict(_SHOWN)
    #: The environment that was found last, why there is none, and the Python that was named then.
    environment: ClassVar[Environment | None] = None
    reason: ClassVar[str] = "not checked yet"
    named: ClassVar[str] = ""

    def draw(self, context: Any) -> None:
        """Draw the environment and how to change it."""
        environment = type(self).environment
        self.layout.label(
            text=str(environment or type(self).reason), icon="CHECKMARK" if environment else "INFO"
        )
        for name in _SHOWN:
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
