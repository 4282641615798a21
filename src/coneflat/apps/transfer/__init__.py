"""Textures of one model baked into the UVs of another; images need Pillow (`coneflat[figures]`)."""

from __future__ import annotations

from .baking import ENDINGS, Baked, transfer
from .own_picture import own_picture

__all__ = ["ENDINGS", "Baked", "own_picture", "transfer"]
