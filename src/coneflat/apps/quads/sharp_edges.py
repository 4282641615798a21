"""Layouts in which sharp edges lie along the axes: all of them, or as many as can."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import TriangleMesh
from ...base import FloatArray, IntArray, Progress, list_some, plural, using_threads
from ...errors import ConvergenceError, GridError, OptionError
from ...geometry import double_areas, edge_lengths, mollify
from ...io import as_input
from ...options import Options, read_options
from ...source import Source
from .aligned import Layout
from .features import (
    border_of,
    dangling,
    lengths_along,
    opened,
    patches_of,
    sharp_edges,
    split_faces,
    split_for_features,
    without_stubs,
)
from .sharp import CoarseError, PatchError, sharp_layout

# What may be asked of the cones inside patches, and of the input; the rest is as grids of whole surfaces want it.
TAKEN = frozenset(
    (
        *("sharp_angle", "boundary", "min_cone_angle", "max_cone_angle", "distortion"),
        *("repair", "strict", "threads"),
    )
)

# Times that sharp edges are left out.
TRIES = 6


@dataclass(frozen=True, eq=False)
class SharpLayout:
    """A layout with sharp edges along the axes.

    Attributes:
        layout: in units of a grid.
        features: (k, 2) the sharp edges, as vertices of its mesh.
        notes: which were left out.
    """

    layout: Layout
    features: IntArray
    notes: tuple[str, ...]


def sharp_layouts(
    mesh: Any,
    faces: ArrayLike | None,
    quads: float | None,
    size: float | None,
    given: Mapping[str, Any],
    usual: Mapping[str, Any],
    progress: Progress | None = None,
) -> Iterator[SharpLayout]:
    """Yield layouts of a surface, each with fewer sharp edges along the axes than those before.

    Args:
        mesh, faces: as `coneflat.flatten` takes them.
        quads: unit squares that cover the surface.
        size: of a square in model units, instead.
        given: options; without `sharp_angle` the boundary alone comes to lie along the axes.
        usual: what they are where nothing is said of them, if that is not what `coneflat.flatten` has.
        progress: called before each patch is flattened.

    Raises:
        OptionError: an option makes no sense, or has no effect beside `sharp_angle`.
        MeshError: as `coneflat.flatten`.
    """
    options: Options = read_options({**usual, **given})
    others = not_taken(given, usual)
    if others:
        raise OptionError(
            f"with sharp edges on grid lines, cones are found for each patch between them: {list_some(others)} cannot "
            "be given beside sharp_angle"
        )
    if options.boundary_kind not in ("free", "straight"):
        raise OptionError(f"sharp edges on grid lines need a straight boundary, not {options.boundary!r}")
    prepared = Source(as_input(mesh, faces)).prepared(replace(options, sharp_angle=None))
    checked, exponent = prepared.checked.mesh, prepared.checked.exponent
    area = float(double_areas(edge_lengths(checked.vertices, checked.faces)).sum()) / 2
    if size is None:
        assert quads is not None
        square = float(np.sqrt(area / quads))
    else:
        square = float(np.ldexp(size, exponent))
    angle = options.sharp_angle
    given_edges = np.empty(0, dtype=np.int64) if angle is None else sharp_edges(checked, angle)

    def tell(tries: int, patch: int, count: int) -> None:
        if progress is not None:
            progress(f"patch {patch + 1:,} of {count:,} between sharp edges", (tries + patch / count) / TRIES)

    search = _Search(checked, given_edges, square, area, options, tell)
    with using_threads(options.threads):
        for layout, features in search.layouts():
            yield SharpLayout(
                _at_scale(layout, exponent, square), features, (*prepared.notes, *search.notes())
            )


def not_taken(given: Mapping[str, Any], usual: Mapping[str, Any]) -> list[str]:
    """Return the names of options that have no effect here, and differ from the usual ones."""
    options: Options = read_options({**usual, **given})
    before: Options = read_options(usual)
    return sorted(name for name in given if name not in TAKEN and _differ(options, before, name))


def _differ(one: Options, other: Options, name: str) -> bool:
    """Return whether options are not the same in one that may be an array."""
    first, second = getattr(one, name), getattr(other, name)
    return first is not second and not (type(first) is type(second) and np.array_equal(first, second))


def _at_scale(layout: Layout, exponent: int, square: float) -> Layout:
    """Return a layout with lengths in model units."""
    mesh = TriangleMesh(np.ldexp(layout.mesh.vertices, -exponent), layout.mesh.faces)
    return replace(
        layout,
        mesh=mesh,
        lengths=np.ldexp(layout.lengths, -exponent),
        size=float(np.ldexp(square, -exponent)),
    )


class _Search:
    """Sharp edges that lie on grid lines, fewer each time that there is no grid with them."""

    def __init__(
        self,
        mesh: TriangleMesh,
        sharp: IntArray,
        square: float,
        area: float,
        options: Options,
        tell: Callable[[int, int, int], None],
    ) -> None:
        self.square, self.options, self._tell = square, options, tell
        self.lengths = lengths_along(mesh, sharp)
        kept = without_stubs(mesh, sharp, 4 * square)
        finer = split_for_features(mesh.vertices, mesh.faces, mesh.edges[sharp[kept]], np.sqrt(area) / 25)
        self.mesh, self.edges = finer[0], finer[1]
        self.origin = kept[finer[2]]
        self.why = ""
        while len(self.edges) and self._areas().min() < 1:
            self._drop(int(np.argmin(self._areas())))

    def notes(self) -> tuple[str, ...]:
        """Return what was left out."""
        left = np.ones(len(self.lengths), dtype=bool)
        left[self.origin] = False
        if not left.any():
            return ()
        share = 100 * self.lengths[left].sum() / self.lengths.sum()
        why = f": {self.why}" if self.why else ", too short for quads of this size"
        return (
            f"{plural(int(left.sum()), 'sharp edge')} of {len(left):,}, {share:.1f} % of their length, on no grid "
            f"line{why}.",
        )

    def layouts(self) -> Iterator[tuple[Layout, IntArray]]:
        """Yield layouts and their features."""
        with_edges = True
        for attempt in range(TRIES):
            if not len(self.edges) and not (with_edges and self.mesh.is_boundary_edge.any()):
                return
            with_edges = len(self.edges) > 0
            try:
                layout = self._layout(attempt)
            except PatchError as error:
                self.why = str(error)
                _, patch = patches_of(self.mesh, self.edges)
                self._drop(int(patch[error.faces[0]]))
            except (ConvergenceError, GridError) as error:
                self.why = str(error)
                self._drop_some(attempt)
            else:
                yield layout, self.mesh.edges[self.edges]
                self.why = "there was no grid with them"
                self._drop_some(attempt)

    def _layout(self, attempt: int) -> Layout:
        def tell(patch: int, count: int) -> None:
            self._tell(attempt, patch, count)

        for _ in range(4):
            lengths = self._side_lengths()
            try:
                cut_open = opened(self.mesh, self.edges, lengths)
                return sharp_layout(cut_open, lengths, self.square, self.options, tell)
            except CoarseError as error:
                finer = split_faces(self.mesh, self.edges, self.origin, error.faces)
                coarse = error
            self.mesh, self.edges, self.origin = finer
        raise coarse

    def _side_lengths(self) -> FloatArray:
        return mollify(edge_lengths(self.mesh.vertices, self.mesh.faces))[0]

    def _areas(self) -> FloatArray:
        """Return the areas of patches, in squares."""
        count, patch = patches_of(self.mesh, self.edges)
        areas = double_areas(self._side_lengths()) / 2
        found: FloatArray = np.bincount(patch, areas, count) / self.square**2
        return found

    def _drop_some(self, attempt: int) -> None:
        """Leave out what dangles, or else what parts the smallest patches, more of them each time."""
        loose = dangling(self.mesh, self.edges)
        if len(loose):
            self._leave_out(loose)
            return
        for _ in range(max(1, 2 ** (attempt - 2))):
            if len(self.edges):
                self._drop(int(np.argmin(self._areas())))

    def _drop(self, patch: int) -> None:
        """Leave out what parts a patch from another one."""
        border = border_of(self.mesh, self.edges, patch)
        self._leave_out(border if len(border) else np.arange(len(self.edges)))

    def _leave_out(self, which: IntArray) -> None:
        kept = np.ones(len(self.edges), dtype=bool)
        kept[which] = False
        self.edges, self.origin = self.edges[kept], self.origin[kept]
        kept_on = without_stubs(self.mesh, self.edges, 4 * self.square)
        self.edges, self.origin = self.edges[kept_on], self.origin[kept_on]
