"""coneflat in Blender: unwrap for textures, flatten conformally, convert to quads.

This file has the panels in the sidebars of the 3D view and the UV editor, the entries in the menu UV, and registration.
"""

from __future__ import annotations

from itertools import groupby
from typing import Any

import bpy

from .operators import COMMAND_OPERATORS, OPERATORS, Runner
from .settings import COMMANDS, GROUPS, Preferences, Settings


def _draw_main(self: Any, context: Any) -> None:
    """Draw what all commands share, and the progress."""
    layout, settings = self.layout, context.scene.coneflat
    layout.use_property_split, layout.use_property_decorate = True, False
    running = Runner.running
    if running is not None:
        text, fraction = running.progress
        layout.progress(factor=fraction, text=text)
        layout.label(text="Esc: stop")
    for name in ("marks", "sharp", "together", "mark", "select", "uv_map"):
        layout.prop(settings, name)


def _draw_command(operator: Any) -> Any:
    """Return the function that draws the panel of a command: its operator and its options, in groups."""

    def draw(self: Any, context: Any) -> None:
        layout, command = self.layout, operator.command
        layout.use_property_split, layout.use_property_decorate = True, False
        layout.operator(operator.bl_idname)
        group = getattr(context.scene.coneflat, command)
        for title, records in groupby(COMMANDS[command], lambda record: record["group"]):
            # What stands last is rarely used.
            is_rare = title == COMMANDS[command][-1]["group"]
            header, body = layout.panel(f"coneflat_{command}_{title}", default_closed=is_rare)
            header.label(text=title)
            for record in records if body is not None else ():
                if record["kind"] in ("weights", "vertices") and context.object is not None:
                    body.prop_search(group, record["name"], context.object, "vertex_groups")
                else:
                    body.prop(group, record["name"])
        if command == "quads":
            layout.prop(context.scene.coneflat, "modifiers")

    return draw


def _panels(space: str, prefix: str) -> list[type]:
    """Return the panels in the sidebar of an editor: one for all commands, and one in it for each."""
    place = {"bl_space_type": space, "bl_region_type": "UI", "bl_category": "coneflat"}
    main = f"{prefix}_PT_coneflat"
    panels = [type(main, (bpy.types.Panel,), {**place, "bl_label": "coneflat", "draw": _draw_main})]
    for operator in COMMAND_OPERATORS:
        body = {
            **place,
            "bl_label": operator.bl_label,
            "bl_parent_id": main,
            "bl_options": set() if operator.command == "unwrap" else {"DEFAULT_CLOSED"},
            "draw": _draw_command(operator),
        }
        panels.append(type(f"{main}_{operator.command}", (bpy.types.Panel,), body))
    return panels


PANELS = [*_panels("VIEW_3D", "VIEW3D"), *_panels("IMAGE_EDITOR", "IMAGE")]
#: The menus UV of the 3D view in edit mode and of the UV editor.
MENUS = ("VIEW3D_MT_uv_map", "IMAGE_MT_uvs")


def draw_menu(self: Any, context: Any) -> None:
    """Draw the entries of the menu UV."""
    self.layout.separator()
    self.layout.label(text="coneflat")
    for operator in COMMAND_OPERATORS:
        self.layout.operator(operator.bl_idname)


_CLASSES = (*GROUPS.values(), Settings, Preferences, *OPERATORS, *PANELS)


def register() -> None:
    """Add the classes, the settings of scenes and the entries of menus."""
    for registered in _CLASSES:
        bpy.utils.register_class(registered)
    bpy.types.Scene.coneflat = bpy.props.PointerProperty(type=Settings)
    for menu in MENUS:
        getattr(bpy.types, menu).append(draw_menu)


def unregister() -> None:
    """Remove them, after ending a running process."""
    if Runner.running is not None:
        Runner.running.cancel(bpy.context)
    for menu in MENUS:
        getattr(bpy.types, menu).remove(draw_menu)
    del bpy.types.Scene.coneflat
    for registered in reversed(_CLASSES):
        bpy.utils.unregister_class(registered)
