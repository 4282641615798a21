"""Unwrapping for textures: the shortest seams for which a layout with free seams is nearly isometric.

What computes is imported on first use, so that commands and applications can declare their options fast.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .options import MAX_ENERGY, TextureOptions, UnwrapOptions

if TYPE_CHECKING:
    from .soup import UnwrappedSoup, unwrap_soup
    from .unwrapping import Unwrapper, unwrap, unwrap_source

__all__ = [
    "MAX_ENERGY", "TextureOptions", "UnwrapOptions", "UnwrappedSoup", "Unwrapper", "unwrap", "unwrap_soup",
    "unwrap_source",
]  # fmt: skip

_HOMES = {
    "Unwrapper": "unwrapping",
    "unwrap": "unwrapping",
    "unwrap_source": "unwrapping",
    "unwrap_soup": "soup",
    "UnwrappedSoup": "soup",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
