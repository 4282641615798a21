"""coneflat in Blender: unwrap for textures, flatten conformally, convert to quads."""

from __future__ import annotations

import bpy

from .operators import OPERATORS, Runner
from .panel import MENUS, PANELS, draw_menu
from .settings import GROUPS, Preferences, Settings

_CLASSES = (*GROUPS.values(), Settings, Preferences, *OPERATORS, *PANELS)


def register() -> None:
    """Add the classes, the settings of scenes and the entries of menus."""
    for each in _CLASSES:
        bpy.utils.register_class(each)
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
    for each in reversed(_CLASSES):
        bpy.utils.unregister_class(each)
