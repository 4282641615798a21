"""Helpers that every package uses: arrays, compiled loops, threads, progress and messages.

Modules that need NumPy or numba are imported on first use, so that the commands print their help without them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .defaults import (
    BAKED_RESOLUTION,
    CHECKER_CELLS,
    DISTORTION,
    DOTS_PER_INCH,
    MAX_CONE_ANGLE,
    MAX_CONES,
    MIN_CONE_ANGLE,
    TYPED_TOLERANCE,
)
from .entry_points import EntryPoint
from .formats import FREESURFER, Use, endings, with_formats
from .notes import Unmet, inner_calls, warn_of, warns
from .progress import (
    Progress,
    Stopwatch,
    begin_step,
    cancel_with,
    check_cancelled,
    component_at_work,
    part_of_work,
    report_detail,
    stage,
    timing,
)
from .search_time import current_time, each_within_time, is_time_up, portion_of_time, search_time, within_time
from .text import MAX_LISTED, exit_text, list_some, plural, printable, short_repr
from .threads import THREADS, limit_threads

if TYPE_CHECKING:
    from .arrays import (
        BoolArray,
        ComplexArray,
        FloatArray,
        IntArray,
        as_floats,
        as_indices,
        dots,
        has_any,
        mask_of,
        unit_exponent,
    )
    from .jit import compiled
    from .kernel_cache import cache_folder, compilation

__all__ = [
    "BAKED_RESOLUTION", "BoolArray", "CHECKER_CELLS", "ComplexArray", "DISTORTION", "DOTS_PER_INCH", "EntryPoint",
    "FREESURFER", "FloatArray", "IntArray", "MAX_CONES", "MAX_CONE_ANGLE", "MAX_LISTED", "MIN_CONE_ANGLE",
    "Progress", "Stopwatch", "THREADS", "TYPED_TOLERANCE", "Unmet", "Use", "as_floats", "as_indices", "begin_step",
    "cache_folder", "cancel_with", "check_cancelled", "compilation", "compiled",
    "component_at_work", "current_time", "dots",
    "each_within_time", "endings", "exit_text", "has_any", "inner_calls", "is_time_up", "limit_threads", "list_some",
    "mask_of", "part_of_work", "plural", "portion_of_time", "printable", "report_detail", "search_time",
    "short_repr", "stage", "timing", "unit_exponent", "warn_of", "warns", "with_formats", "within_time",
]  # fmt: skip


# Modules that need numba, by name; the other names that are imported on first use are those of arrays.
_HOMES = {"compiled": "jit", "cache_folder": "kernel_cache", "compilation": "kernel_cache"}


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module(f".{_HOMES.get(name, 'arrays')}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
