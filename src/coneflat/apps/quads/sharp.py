"""Layouts with sharp edges along the axes: all of them, or as many as possible.

Edges that prevent a layout are left out, and the remaining ones are tried again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import TriangleMesh
from ...base import FloatArray, IntArray, Progress, limit_threads, list_some, plural
from ...errors import ConvergenceError, GridError, OptionError
from ...geometry import double_areas, edge_lengths, mollify
from ...io import as_input
from ...options import Options, read_options
from ...source import Source
from . import features
from .layout import GridLayout
from .patch_layout import CoarseError, PatchError, sharp_layout

# Options of the cones inside patches and of the input that the user can set; all others have fixed values.
ACCEPTED_OPTIONS = (
    "sharp_angle", "boundary", "min_cone_angle", "max_cone_angle", "distortion", "repair", "strict", "threads",
)  # fmt: skip
# Largest number of attempts with fewer sharp edges each.
MAX_TRIES = 6


def sharp_layouts(
    mesh: Any,
    faces: ArrayLike | None,
    quads: float,
    size: float | None,
    given: Mapping[str, Any],
    defaults: Mapping[str, Any],
    progress: Progress | None,
) -> Iterator[tuple[GridLayout, IntArray, tuple[str, ...]]]:
    """Yield layouts of a surface, each with fewer sharp edges along the axes than the previous one.

    With each layout come (k, 2) these sharp edges, as vertices of its mesh, and notes on edges that were left out.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        quads: number of unit squares that cover the surface.
        size: edge length of a square in model units; replaces `quads`.
        given: options; without `sharp_angle` only the boundary is put along the axes.
        defaults: defaults of options that differ from those of `coneflat.flatten`.
        progress: called before each patch is flattened.

    Raises:
        OptionError: an option is invalid, or has no effect together with `sharp_angle`.
        MeshError: as for `coneflat.flatten`.
    """
    options: Options = read_options({**defaults, **given})
    if others := unsupported(given, defaults):
        raise OptionError(
            f"with sharp edges on grid lines, cones are found for each patch between them: {list_some(others)} cannot "
            "be given together with sharp_angle"
        )
    if options.boundary_kind not in ("free", "straight"):
        raise OptionError(f"sharp edges on grid lines need a straight boundary, not {options.boundary!r}")
    prepared = Source(as_input(mesh, faces)).prepared(replace(options, sharp_angle=None))
    checked, exponent = prepared.checked.mesh, prepared.checked.exponent
    area = float(double_areas(edge_lengths(checked.vertices, checked.faces)).sum()) / 2
    square = float(np.sqrt(area / quads) if size is None else np.ldexp(size, exponent))
    angle = options.sharp_angle
    sharp = np.empty(0, dtype=np.int64) if angle is None else features.sharp_edges(checked, angle)
    search = _Search(checked, sharp, square, area, options, progress)
    with limit_threads(options.threads):
        for layout in search.layouts():
            mesh = TriangleMesh(np.ldexp(layout.mesh.vertices, -exponent), layout.mesh.faces)
            lengths, side = np.ldexp(layout.lengths, -exponent), float(np.ldexp(square, -exponent))
            in_units = replace(layout, mesh=mesh, lengths=lengths, size=side)
            yield in_units, search.mesh.edges[search.edges], (*prepared.notes, *search.notes())


def unsupported(given: Mapping[str, Any], defaults: Mapping[str, Any]) -> list[str]:
    """Return the names of given options that have no effect here and differ from the defaults."""
    options: Options = read_options({**defaults, **given})
    before: Options = read_options(defaults)
    pairs = (
        (name, getattr(options, name), getattr(before, name))
        for name in given
        if name not in ACCEPTED_OPTIONS
    )
    # Values can be arrays.
    return sorted(
        name
        for name, one, two in pairs
        if one is not two and not (type(one) is type(two) and np.array_equal(one, two))
    )


class _Search:
    """The search for sharp edges that can lie on grid lines; each failure reduces their number."""

    def __init__(
        self,
        mesh: TriangleMesh,
        sharp: IntArray,
        square: float,
        area: float,
        options: Options,
        progress: Progress | None,
    ) -> None:
        self.square, self.options, self.progress = square, options, progress
        self.lengths = features.lengths_along(mesh, sharp)
        kept = features.without_stubs(mesh, sharp, 4 * square)
        self.mesh, self.edges, origin = features.split_for_features(
            mesh.vertices, mesh.faces, mesh.edges[sharp[kept]], np.sqrt(area) / 25
        )
        self.origin = kept[origin]
        self.why = ""
        while len(self.edges) and self._areas().min() < 1:
            self._drop(int(np.argmin(self._areas())))

    def notes(self) -> tuple[str, ...]:
        """Return a note on the sharp edges that were left out, if any."""
        left = np.ones(len(self.lengths), dtype=bool)
        left[self.origin] = False
        if not left.any():
            return ()
        share = 100 * self.lengths[left].sum() / self.lengths.sum()
        why = f": {self.why}" if self.why else ", too short for quads of this size"
        return (
            f"{plural(int(left.sum()), 'sharp edge')} of {len(left):,}, {share:.1f} % of their length, not on grid "
            f"lines{why}.",
        )

    def layouts(self) -> Iterator[GridLayout]:
        """Yield layouts; until the next one, the features of a layout are `edges` of `mesh`."""
        with_edges = True
        for attempt in range(MAX_TRIES):
            if not len(self.edges) and not (with_edges and self.mesh.is_boundary_edge.any()):
                return
            with_edges = len(self.edges) > 0
            try:
                layout = self._layout(attempt)
            except PatchError as error:
                self.why = str(error)
                _, patch = features.patches_of(self.mesh, self.edges)
                self._drop(int(patch[error.faces[0]]))
            except (ConvergenceError, GridError) as error:
                self.why = str(error)
                self._drop_some(attempt)
            else:
                yield layout
                self.why = "there was no grid with them"
                self._drop_some(attempt)

    def _layout(self, attempt: int) -> GridLayout:
        def tell(patch: int, count: int) -> None:
            if self.progress is not None:
                done = (attempt + patch / count) / MAX_TRIES
                self.progress(f"patch {patch + 1:,} of {count:,} between sharp edges", done)

        for _ in range(4):
            lengths = self._side_lengths()
            try:
                cut = features.opened(self.mesh, self.edges, lengths)
                return sharp_layout(cut, lengths, self.square, self.options, tell)
            except CoarseError as error:
                finer = features.split_faces(self.mesh, self.edges, self.origin, error.faces)
                coarse = error
            self.mesh, self.edges, self.origin = finer
        raise coarse

    def _side_lengths(self) -> FloatArray:
        return mollify(edge_lengths(self.mesh.vertices, self.mesh.faces))[0]

    def _areas(self) -> FloatArray:
        """Return the areas of patches, in squares."""
        count, patch = features.patches_of(self.mesh, self.edges)
        areas = double_areas(self._side_lengths()) / 2
        return np.bincount(patch, areas, count) / self.square**2

    def _drop_some(self, attempt: int) -> None:
        """Leave out dangling edges, or else the borders of the smallest patches, more of them in later attempts."""
        loose = features.dangling(self.mesh, self.edges)
        if len(loose):
            self._leave_out(loose)
            return
        for _ in range(max(1, 2 ** (attempt - 2))):
            if len(self.edges):
                self._drop(int(np.argmin(self._areas())))

    def _drop(self, patch: int) -> None:
        """Leave out the longest border between a patch and another one."""
        border = features.border_of(self.mesh, self.edges, patch)
        self._leave_out(border if len(border) else np.arange(len(self.edges)))

    def _leave_out(self, which: IntArray) -> None:
        self.edges, self.origin = np.delete(self.edges, which), np.delete(self.origin, which)
        kept = features.without_stubs(self.mesh, self.edges, 4 * self.square)
        self.edges, self.origin = self.edges[kept], self.origin[kept]
