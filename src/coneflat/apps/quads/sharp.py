"""Layouts in which sharp edges lie along the axes: all of them, or as many as can.

The patches between sharp edges are flattened with straight sides, each alone, and relaxed together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import TriangleMesh
from ...base import ComplexArray, FloatArray, IntArray, Progress, list_some, plural, using_threads
from ...cones import ROOM, ConeSearch, quantise_cones
from ...errors import ConvergenceError, CurvatureError, GridError, MetricError, OptionError, SeamError
from ...geometry import as_complex, as_pairs, double_areas, edge_lengths, mollify, signed_double_areas
from ...io import as_input
from ...layout import Lines, PointConstraints, SeamChains, StretchEnergy, lay_out, relax
from ...mesh import NEXT, PREVIOUS, cut_open, tie_key
from ...metric import ExactChoices, exact_flat_metric, straight_boundary
from ...options import Options, read_options
from ...seams import find_seams
from ...source import Source
from ...stages import ConeSolution, Cut, Surface
from .features import (
    Opened,
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
from .layout import Layout, Sides, at_origin, find_sides, joined_charts

# What may be asked of the cones inside patches, and of the input; the rest is as grids of whole surfaces want it.
TAKEN = frozenset(
    (
        *("sharp_angle", "boundary", "min_cone_angle", "max_cone_angle", "distortion"),
        *("repair", "strict", "threads"),
    )
)
# Times that sharp edges are left out.
TRIES = 6


def sharp_layouts(
    mesh: Any,
    faces: ArrayLike | None,
    quads: float,
    size: float | None,
    given: Mapping[str, Any],
    usual: Mapping[str, Any],
    progress: Progress | None,
) -> Iterator[tuple[Layout, IntArray, tuple[str, ...]]]:
    """Yield layouts of a surface, each with fewer sharp edges along the axes than those before.

    And of each (k, 2) these sharp edges, as vertices of its mesh, and notes on which were left out.

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
    square = float(np.sqrt(area / quads) if size is None else np.ldexp(size, exponent))
    angle = options.sharp_angle
    sharp = np.empty(0, dtype=np.int64) if angle is None else sharp_edges(checked, angle)
    search = _Search(checked, sharp, square, area, options, progress)
    with using_threads(options.threads):
        for layout in search.layouts():
            mesh = TriangleMesh(np.ldexp(layout.mesh.vertices, -exponent), layout.mesh.faces)
            lengths, side = np.ldexp(layout.lengths, -exponent), float(np.ldexp(square, -exponent))
            in_units = replace(layout, mesh=mesh, lengths=lengths, size=side)
            yield in_units, search.mesh.edges[search.edges], (*prepared.notes, *search.notes())


def not_taken(given: Mapping[str, Any], usual: Mapping[str, Any]) -> list[str]:
    """Return the names of options that have no effect here, and differ from the usual ones."""
    options: Options = read_options({**usual, **given})
    before: Options = read_options(usual)
    pairs = ((name, getattr(options, name), getattr(before, name)) for name in given if name not in TAKEN)
    # Some may be arrays.
    return sorted(
        name
        for name, one, two in pairs
        if one is not two and not (type(one) is type(two) and np.array_equal(one, two))
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
        progress: Progress | None,
    ) -> None:
        self.square, self.options, self.progress = square, options, progress
        self.lengths = lengths_along(mesh, sharp)
        kept = without_stubs(mesh, sharp, 4 * square)
        self.mesh, self.edges, origin = split_for_features(
            mesh.vertices, mesh.faces, mesh.edges[sharp[kept]], np.sqrt(area) / 25
        )
        self.origin = kept[origin]
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

    def layouts(self) -> Iterator[Layout]:
        """Yield layouts; their features are `edges` of `mesh` until the next."""
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
                yield layout
                self.why = "there was no grid with them"
                self._drop_some(attempt)

    def _layout(self, attempt: int) -> Layout:
        def tell(patch: int, count: int) -> None:
            if self.progress is not None:
                done = (attempt + patch / count) / TRIES
                self.progress(f"patch {patch + 1:,} of {count:,} between sharp edges", done)

        for _ in range(4):
            lengths = self._side_lengths()
            try:
                cut = opened(self.mesh, self.edges, lengths)
                return _sharp_layout(cut, lengths, self.square, self.options, tell)
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
        self.edges, self.origin = np.delete(self.edges, which), np.delete(self.origin, which)
        kept = without_stubs(self.mesh, self.edges, 4 * self.square)
        self.edges, self.origin = self.edges[kept], self.origin[kept]


class PatchError(GridError):
    """A patch cannot be flattened; `faces` are its triangles."""

    def __init__(self, faces: IntArray, why: str) -> None:
        super().__init__(why)
        self.faces = faces


class CoarseError(PatchError):
    """A patch cannot be flattened as some of its triangles, `faces`, are too coarse."""


def _sharp_layout(
    opened: Opened, lengths: FloatArray, size: float, options: Options, tell: Callable[[int, int], None]
) -> Layout:
    """Return a seamless layout of a mesh with sharp edges along the axes, in units of a grid.

    Args:
        opened: the mesh, opened along its sharp edges.
        lengths: (m, 3) side lengths of its triangles.
        size: of a square of the grid.
        options: what is asked of the cones inside patches.
        tell: called before each patch is flattened with its number and how many there are.

    Raises:
        CoarseError: triangles are too coarse.
        PatchError: a patch has no flat metric with angles of quarter turns.
        ConvergenceError: patches cannot be brought together, as far as is known.
        GridError: sides and seams, each turned to the nearest axis, contradict each other.
    """
    layout = _flat_patches(opened, lengths, size, options, tell)
    layout, component = joined_charts(replace(layout, points=_fitting(opened, layout)))
    flat = float(layout.double_areas().sum())
    points = layout.points * np.sqrt(float(double_areas(lengths).sum()) / flat) / size
    layout = replace(layout, points=points)
    return at_origin(replace(layout, sides=_all_sides(opened, layout, layout.chains())), component)


def _flat_patches(
    opened: Opened, lengths: FloatArray, size: float, options: Options, tell: Callable[[int, int], None]
) -> Layout:
    """Return all patches of an opened mesh, flattened at their own areas, that do not fit each other yet.

    Raises:
        CoarseError: triangles are too coarse.
        PatchError: a patch has no flat metric with angles of quarter turns.
    """
    corners = np.empty_like(opened.mesh.faces)
    points, cones, turned, count = [], [], [], 0
    parts = opened.cut.mesh.split_components()
    areas = double_areas(lengths)
    for number, (part, vertices, faces) in enumerate(parts):
        tell(number, len(parts))
        # What all have in common is the mean of squares by area, to which small ones add little.
        share = float(areas[faces].sum() / areas.mean() / len(areas))
        distortion = options.distortion * min(max(1.0, 1 / np.sqrt(len(parts) * share)), 3.0)
        try:
            plane, at, inside = _flat_patch(
                part, lengths[faces], opened.quarters[vertices], distortion, options
            )
        except (CurvatureError, MetricError, SeamError) as error:
            raise PatchError(faces, str(error)) from error
        turned.append(faces[signed_double_areas(plane[at]) <= 0])
        corners[faces] = at + count
        points.append(_along_axes(part, at, as_complex(plane)))
        cones.append(opened.cut.origin[vertices[inside]])
        count += len(plane)
    coarse = np.concatenate(turned)
    if len(coarse):
        raise CoarseError(
            coarse, f"{len(coarse)} of {len(corners):,} triangles are turned over on straight sides"
        )
    every = np.concatenate([*cones, opened.irregular])
    sides = Sides(np.setdiff1d(opened.nodes, opened.irregular))
    return Layout(opened.mesh, lengths, corners, np.concatenate(points), every, sides, size)


def _flat_patch(
    mesh: TriangleMesh, lengths: FloatArray, quarters: IntArray, distortion: float, options: Options
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return a connected patch flattened conformally, with angles of whole quarter turns on its boundary.

    Points (u, 2) of the plane, (m, 3) that at each triangle corner, and cones, vertices inside. Triangles that are too
    coarse for straight sides may be turned over.

    Args:
        mesh: the patch.
        lengths: (m, 3) side lengths.
        quarters: (n,) the quarter turns of the angle at each vertex on the boundary.
        distortion: the area distortion allowed, the standard deviation of the log of the scale by area.
        options: what else is asked of the cones inside.

    Raises:
        CurvatureError: no cones inside make up for the corners.
        ConvergenceError, MetricError: no metric was found.
    """
    corners = np.where(mesh.is_boundary_vertex, (np.pi / 2) * (2 - quarters), 0.0)
    solution = _cones(mesh, lengths, corners, distortion, options)
    choices = ExactChoices(scale_at_cones=False, boundary=straight_boundary(mesh, solution.target))
    # Rotations along handles are no quarter turns yet, nor are loops of the boundary parallel: both come to be so when
    # patches are brought together.
    metric = exact_flat_metric(mesh, lengths, solution, choices)
    seams = find_seams(mesh, solution.cones, lengths.ravel()[mesh.edge_halfedges[:, 0]])
    laid_out = lay_out(metric, Cut(cut_open(mesh, seams).mesh, seams))
    return laid_out.points, laid_out.corners, solution.cones


def _cones(
    mesh: TriangleMesh, lengths: FloatArray, corners: FloatArray, distortion: float, options: Options
) -> ConeSolution:
    """Return cones inside a patch whose (n,) corners are given: these are taken off the curvature to be made up for."""
    surface = Surface.of(mesh, lengths)
    inside = ~mesh.is_boundary_vertex
    total = 4 * mesh.euler_characteristic - round(float(corners.sum()) / (np.pi / 2))
    room = ROOM * np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    try:
        search = ConeSearch(
            surface.laplacian,
            surface.curvature - corners,
            surface.areas,
            np.zeros(len(inside), dtype=bool),
            total / 4,
            tie_key=tie_key(mesh.vertices),
            min_cone_angle=options.min_cone_angle,
            max_cone_angle=options.max_cone_angle,
            allowed=inside,
            room=room.astype(np.float64),
        )
        found = quantise_cones(search, np.pi / 2, distortion=distortion).solution
    except CurvatureError as error:
        raise CurvatureError(
            f"a patch of {len(mesh.faces):,} triangles with corners of {corners.sum() / np.pi:.3g} pi in all: {error}"
        ) from error
    target = np.where(inside, found.target, corners)
    return ConeSolution(found.cones, target, found.log_scale)


def _along_axes(mesh: TriangleMesh, corners: IntArray, points: ComplexArray) -> ComplexArray:
    """Return points of a patch turned so that most of its boundary is along the axes."""
    border = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
    side = points[corners[:, PREVIOUS].ravel()[border]] - points[corners[:, NEXT].ravel()[border]]
    angle = float(np.angle((np.abs(side) * (side / np.abs(side)) ** 4).sum()) / 4)
    return points * np.exp(-1j * angle)


def _fitting(opened: Opened, layout: Layout) -> ComplexArray:
    """Return the points of patches relaxed so that sides are straight, along the axes, and quarter turns of each other.

    Raises:
        ConvergenceError: they cannot be without turning a triangle over, as far as is known.
        GridError: sides and seams, each turned to the nearest axis, contradict each other.
    """
    sides = _all_sides(opened, layout, layout.chains(quarter_turns=True))
    offsets = np.full(len(sides.axis), np.nan)
    constraints = PointConstraints(
        lines=Lines(sides.points, sides.side, sides.directions, offsets) if len(offsets) else None,
        quarter_turns=True,
        nodes=layout.whole,
    )
    # Patches of one size meet more easily.
    points, energy = as_pairs(layout.points), StretchEnergy(1.0)
    try:
        found = relax(
            layout.mesh, points, layout.corners, energy, constraints, lengths=layout.lengths, steps=200
        )
    except OptionError as error:
        raise GridError(f"sides and seams cannot all lie along the axes: {error}") from error
    return as_complex(found.points)


def _all_sides(opened: Opened, layout: Layout, chains: SeamChains) -> Sides:
    """Return the sides that lie along the axes: of the boundary, and the left ones of chains of features."""
    points = layout.points
    border = find_sides(layout, np.ones(len(points), dtype=bool))
    feature = opened.is_feature[chains.edges]
    left, chain = chains.left[feature], chains.chain[feature]
    along = points[left[:, 1]] - points[left[:, 0]]
    # Twice the direction, so that to and fro are the same.
    numbers, which = np.unique(chain, return_inverse=True)
    double = np.abs(along) * (along / np.abs(along)) ** 2
    sums = np.bincount(which, double.real, len(numbers))
    axis = np.where(sums >= 0, 1, 0)
    both = np.unique(np.stack([left.ravel(), which.repeat(2)], axis=1), axis=0)
    return Sides(
        layout.sides.corners,
        np.concatenate([border.points, both[:, 0]]),
        np.concatenate([border.side, both[:, 1] + len(border.axis)]),
        np.concatenate([border.axis, axis]),
    )
