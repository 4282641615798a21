"""Textures of one model baked into the UVs of another; images need Pillow (`coneflat[figures]`)."""

from __future__ import annotations

from .transfer import ENDINGS, Baked, transfer

__all__ = ["ENDINGS", "Baked", "transfer"]
