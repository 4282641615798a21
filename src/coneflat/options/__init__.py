"""Options: declared once, parsed at the door."""

from .combined import Options
from .declared import (
    CONED,
    LEAST_QUANTUM,
    METHODS,
    MOST_PREFERENCE,
    PAPER,
    UNFOLDED,
    VARIANTS,
    WIDEST_CONE,
    CurveOptions,
    FindOptions,
)
from .quads import QuadOptions
from .reading import declarations, read_options, settings, takes

__all__ = [
    "CONED",
    "LEAST_QUANTUM",
    "METHODS",
    "MOST_PREFERENCE",
    "PAPER",
    "UNFOLDED",
    "VARIANTS",
    "WIDEST_CONE",
    "CurveOptions",
    "FindOptions",
    "Options",
    "QuadOptions",
    "declarations",
    "read_options",
    "settings",
    "takes",
]
