"""Comparison of methods on one mesh, with the same cones and the same cut."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from coneflat import ConeflatError, Flattening
from coneflat.base import Progress
from coneflat.errors import OptionError

from .atlases import ATLAS_BASELINES, installed_baselines, run_baseline
from .methods import COMPARED_METHODS, METHODS, flatten_by

# Options that affect neither the cones nor the method from cones to a layout.
SHARED = (
    "repair", "strict", "seams", "no_seams", "sharp_angle", "hide_seams", "seam_weights", "charts", "resolution",
    "padding", "tiles", "up",
)  # fmt: skip
# Those of them that contain vertex indices of the input.
VERTEX_OPTIONS = ("seams", "no_seams", "seam_weights")
Drawn: TypeAlias = "tuple[tuple[str, Flattening], ...]"

# The stages from cones and cut to a layout.
TIMED = ("metric", "layout")


@dataclass(frozen=True, eq=False)
class Entry:
    """The result of one method.

    Attributes:
        method: name of the method.
        result: the flattening; None if the method failed.
        seconds: running time from the cones and the cut to the layout; of a baseline with its own cut, the total
            running time.
        note: differences from the other methods, or the error if there is no result.
    """

    method: str
    result: Flattening | None
    seconds: float
    note: str = ""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of several methods on one mesh.

    Attributes:
        entries: one for each method.
    """

    entries: tuple[Entry, ...]

    @property
    def drawn(self) -> Drawn:
        """The method and the result of each entry that has one."""
        return tuple((entry.method, entry.result) for entry in self.entries if entry.result is not None)

    def __getitem__(self, method: str) -> Entry:
        """Return the entry of a method."""
        return {entry.method: entry for entry in self.entries}[method]


def compare_methods(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    methods: Sequence[str] = COMPARED_METHODS,
    atlases: Iterable[str] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Comparison:
    """Flatten a mesh by several methods, with the same cones and the same cut.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        methods: names of `METHODS`.
        atlases: names of baselines with their own cut, from `ATLAS_BASELINES`; by default those installed.
        progress: called with the current step and the completed fraction.
        options: options of `coneflat.flatten`, with one chart by default. The cones and the cut are those of the method
            in the options, "exact" by default, and are used for all methods.

    Returns:
        The results of all methods.

    Raises:
        OptionError: a method is unknown or not installed.
        MeshError: the mesh cannot be flattened, or no cones were found.
    """
    methods, atlases = tuple(dict.fromkeys(methods)), _checked(methods, atlases)
    steps = ["cones", *methods, *atlases]

    def report(step: str) -> None:
        if progress is not None:
            progress(step, steps.index(step) / len(steps))

    report("cones")
    base_method = options.pop("method", "exact")
    _warm_up(base_method)
    base = flatten_by(base_method, mesh, faces, **options)
    shared = _shared_options(options, mesh, base)
    entries = []
    for method in methods:
        report(method)
        entries.append(
            entry_of(method, base, base)
            if method == base_method
            else _method_entry(method, base, mesh, faces, shared)
        )
    for name in atlases:
        report(name)
        entries.append(_atlas_entry(name, base))
    return Comparison(tuple(entries))


def _checked(methods: Sequence[str], atlases: Iterable[str] | None) -> tuple[str, ...]:
    """Return the baselines with their own cut, after a check of all names."""
    for name in methods or ("",):
        if name not in METHODS:
            raise OptionError(f"unknown method {name!r}: choose from {', '.join(METHODS)}")
    if atlases is None:
        return installed_baselines()
    names = tuple(dict.fromkeys(atlases))
    for name in names:
        if name not in ATLAS_BASELINES:
            raise OptionError(f"unknown baseline {name!r}: choose from {', '.join(ATLAS_BASELINES)}")
        if name not in installed_baselines():
            raise OptionError(f"{name} is not installed")
    return names


def _shared_options(options: dict[str, Any], mesh: Any, base: Flattening) -> dict[str, Any]:
    """Return the options that apply to all methods, with the cones of a result.

    Raises:
        OptionError: an option contains vertex indices, and those of the input do not identify the cones.
    """
    shared = {name: value for name, value in options.items() if name in SHARED}
    ambiguous = [name for name in VERTEX_OPTIONS if name in shared]
    if ambiguous and not _has_input_numbering(base):
        raise OptionError(
            "a cone is at a vertex that the repair split, so vertex indices of the input are ambiguous: leave out "
            f"{', '.join(ambiguous)}"
        )
    cones = dict(zip(base.cones.tolist(), base.curvatures.tolist(), strict=True))
    return {**shared, "cones": cones or "none"}


def _has_input_numbering(base: Flattening) -> bool:
    """Return whether the indices of the cones are those of the input.

    The copies of a vertex that a repair split have the same index in the input.
    """
    origin = base.vertex_origin
    return origin is None or np.array_equal(origin[base.cones], base.cones)


def _method_entry(
    method: str, base: Flattening, mesh: Any, faces: ArrayLike | None, shared: dict[str, Any]
) -> Entry:
    """Return the entry of a method with the cones of the base result, on the mesh whose vertices identify them."""
    if not _has_input_numbering(base):
        mesh, faces = base.vertices, base.faces
    _warm_up(method)
    try:
        return entry_of(method, flatten_by(method, mesh, faces, **shared), base)
    except ConeflatError as error:
        return _failed(method, error)


def _atlas_entry(name: str, base: Flattening) -> Entry:
    try:
        return Entry(name, *run_baseline(name, base), ATLAS_BASELINES[name].note)
    except ConeflatError as error:
        return _failed(name, error)


def _failed(method: str, error: ConeflatError) -> Entry:
    return Entry(method, None, math.nan, " ".join(str(error).split()))


def entry_of(method: str, result: Flattening, base: Flattening) -> Entry:
    """Return the entry of a method, without the notes on the input that are already on the base result."""
    repeated = () if result is base else base.notes
    notes = [note.rstrip(".") for note in result.notes if note not in repeated]
    if _cut_edges(result) != _cut_edges(base):
        notes.insert(0, "cut along other edges")
    return Entry(method, result, sum(result.seconds[stage] for stage in TIMED), "; ".join(notes))


def _cut_edges(result: Flattening) -> set[tuple[int, int]]:
    return {(min(pair), max(pair)) for pair in result.seams.tolist()}


def _warm_up(method: str) -> None:
    """Run a method on a tetrahedron, so that its time does not include loading of modules."""
    vertices, faces = np.eye(4)[:, :3] - 0.25, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    with suppress(ConeflatError):
        flatten_by(method, vertices, faces, cones=dict.fromkeys(range(4), np.pi))
