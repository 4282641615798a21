"""Cones of a quad mesh: few, for even sizes, and for grid lines along preferred directions.

The search starts from the singular vertices of the smoothest cross field. In the linear model of conformal maps, the
log conformal factor and the rotation of each triangle are linear functions of the cones' curvatures. The search adds a
quarter turn at one vertex and subtracts one at another as long as the cost decreases. This moves cones, and adds or
removes pairs of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse.csgraph import dijkstra

from ..base import ComplexArray, FloatArray, IntArray, Stopwatch, limit_threads
from ..errors import CurvatureError
from ..flattener import flatten
from ..geometry import coarse_mesh, double_areas, edge_lengths
from ..mesh import CheckedMesh
from ..mesh.connectivity import TriangleMesh
from ..options import read_options
from ..result import Flattening
from .alignment import has_area
from .cross_field import SHARP_ANGLE, directions_and_indices, is_mechanical, sharp_ends
from .features import lengths_along, split_around, split_chords, split_edges, vertex_graph, without_pillows
from .limits import COARSE_TRIANGLES, NO_LIMIT, SquareLimit
from .map_model import SAMPLES, MapModel
from .mirror_planes import MirrorPlane, at_seam_ends, on_seam
from .options import FLATTENING_OPTIONS, GRID_TOLERANCE, QuadOptions, flattening_defaults
from .sizes import extended

# Cost of an area distortion as large as allowed, at first, and of crosses off by 22.5 degrees, which is larger where
# sharp edges are required on grid lines; a cone costs 1 for each quarter turn, and a missing one more than all others.
COST_OF_AREAS, COST_OF_DIRECTIONS, TIMES_REQUIRED, COST_OF_MISSING = 15.0, 200.0, 5.0, 1e9
# Radii within which cones move, relative to the distance between the centres of regions, and tried places in each.
RADII, PLACES_NEAR = (1.0, 0.6, 0.35, 0.2), 10
# Largest number of pairs of places that a search compares, half a second of work or more: for each vertex, and of small
# meshes. Real models need up to 2,500 for each vertex, or 3 million. Surfaces with hundreds of spikes, nearly all of
# whose vertices are cones, would need a hundred times as many.
PAIRS_PER_VERTEX, MAX_PAIRS_OF_FEW = 6_000, 10_000_000
# Least decrease of the cost by a step of a descent, which thus ends.
MIN_GAIN = 1e-3
# Quarter turns: largest difference of the angle defect at a corner of the surface from the curvature of its cone.
MAX_CORNER_ERROR = 0.25
# Meshes of fewer triangles are split evenly.
MIN_TRIANGLES = 60
# Edges are split up to this length, relative to the root of the area, so often, in meshes of at most so many triangles
# before, and about so many after.
# Of six cylinders with caps that are fans, angles deviate by 2 to 3 degrees instead of 3 to 10, in the same time.
MAX_EDGE, MAX_EDGE_SPLITS = 0.1, 4
MAX_TRIANGLES_TO_SPLIT, MAX_SPLIT_TRIANGLES = 1100, 2500
# Bounds of the area distortion. Below, areas would cost more than missing cones; above, nothing.
MIN_DISTORTION, MAX_DISTORTION = 1e-3, 1e3
# How often the cost of areas is doubled to meet the bound, and the bound for a distortion of 1: the log of the ratio of
# the 95% and 5% quantiles of the areas of quads.
MAX_DOUBLINGS, SPREAD = 3, 10 * np.log(2.0)


def aligned_flattening(
    checked: CheckedMesh,
    price: float,
    is_split: bool,
    options: Mapping[str, Any],
    stages: Stopwatch,
    sharp_angle: float | None,
    log_scale: FloatArray | None,
    limit: SquareLimit,
    mirror: MirrorPlane | None = None,
) -> Flattening:
    """Return a flattening with cones quantised to quarter turns, and straight boundaries.

    Args:
        checked: the connected mesh.
        price: cost of a cone; see `aligned_cones`.
        is_split: split all edges of the mesh, for more places for cones.
        options: those of `integer_grid`.
        stages: the stopwatch.
        sharp_angle: dihedral angle of edges that are required on grid lines, or None.
        log_scale: (n,) the target log conformal factor at the vertices, or None for equal sizes.
        limit: largest number of squares of a grid.
        mirror: the plane at which a half of a symmetric surface continues, in model units; or None.

    Raises:
        GridError: a grid with cones at all corners of the surface has more squares.
        CurvatureError, MetricError, OptionError: as for `coneflat.flatten`.
    """
    cone_options = read_options(options, QuadOptions)
    mesh = _with_places(checked.mesh, is_split, SHARP_ANGLE if sharp_angle is None else sharp_angle)
    # The bounds of curvature in quarter turns; without a largest angle, there is none in effect.
    turns = [
        4 - angle / (np.pi / 2) for angle in (cone_options.max_cone_angle or 1e6, cone_options.min_cone_angle)
    ]
    bounds = int(np.ceil(turns[0] - GRID_TOLERANCE)), int(np.floor(turns[1] + GRID_TOLERANCE))
    target_scale = None if log_scale is None else extended(log_scale, mesh)
    plane = None if mirror is None else mirror.scaled(checked.exponent)
    with stages("cones"), limit_threads(cone_options.threads):
        quarters_at = aligned_cones(
            mesh, cone_options.distortion, *bounds, price, sharp_angle, target_scale, limit, plane
        )
    cones = {vertex: quarters * np.pi / 2 for vertex, quarters in quarters_at.items()}
    flattening_options = {name: choice for name, choice in options.items() if name not in FLATTENING_OPTIONS}
    flattening_options |= {**flattening_defaults({"cones": cones}), "cones": cones}
    if mesh.is_boundary_edge.any():
        flattening_options["boundary"] = "straight"
    for splits in range(3):
        with stages("flatten"):
            result = flatten(np.ldexp(mesh.vertices, -checked.exponent), mesh.faces, **flattening_options)
        # Large cones that are adjacent flip triangles.
        if splits == 2 or (is_flat := has_area(result)).all():
            break
        mesh = split_around(mesh, mesh.faces[~is_flat])
    return replace(result, notes=(*checked.notes, *result.notes))


def _with_places(mesh: TriangleMesh, is_split: bool, sharp_angle: float) -> TriangleMesh:
    """Return a mesh with vertices where cones may be needed, with all edges split if `is_split`."""
    if is_split:
        mesh = split_around(mesh, mesh.faces)
    if MIN_TRIANGLES <= len(mesh.faces) <= MAX_TRIANGLES_TO_SPLIT:
        mesh = _without_long_edges(mesh)
    while len(mesh.faces) < MIN_TRIANGLES:  # on a sphere, a grid has at least eight cones
        mesh = split_around(mesh, mesh.faces)
    mesh, _ = split_chords(mesh)
    finer, count = split_chords(mesh, sharp_ends(mesh, sharp_angle))
    # On coarse meshes these are most edges, and their triangles would get thin.
    return finer if 20 * count < len(mesh.edges) else mesh


def _without_long_edges(mesh: TriangleMesh) -> TriangleMesh:
    """Return a mesh of few triangles with its long edges split: the fan of a cap has no place but its centre."""
    mesh = without_pillows(mesh)
    longest = MAX_EDGE * float(np.sqrt(double_areas(edge_lengths(mesh.vertices, mesh.faces)).sum() / 2))
    for _ in range(MAX_EDGE_SPLITS):
        is_long = lengths_along(mesh, np.arange(len(mesh.edges))) > longest
        if len(mesh.faces) > MAX_SPLIT_TRIANGLES or not is_long.any():
            break
        mesh, _ = split_edges(mesh, is_long)
    return mesh


def aligned_cones(
    mesh: TriangleMesh,
    distortion: float,
    min_quarters: int = -2,
    max_quarters: int = 1,
    price: float = 1.0,
    sharp_angle: float | None = None,
    log_scale: FloatArray | None = None,
    limit: SquareLimit = NO_LIMIT,
    mirror: MirrorPlane | None = None,
) -> dict[int, int]:
    """Return cones of a connected mesh, and corners of its boundary, with their curvature in quarter turns.

    Args:
        mesh: connected mesh.
        distortion: area distortion that should not be exceeded: the standard deviation of the log conformal factor.
        min_quarters, max_quarters: bounds of the curvature of cones.
        price: cost of a cone, 1 by default.
        sharp_angle: dihedral angle of edges that grid lines must follow, radians; None: that from which on they prefer
            to, and other directions count as much unless the surface is mechanical.
        log_scale: (n,) the log conformal factor from which the distortion is measured, up to a constant; None for 0.
        limit: largest number of squares of a grid.
        mirror: the plane at which a half of a symmetric surface continues; or None.

    Raises:
        GridError: a grid with cones at all corners of the surface has more squares.
        CurvatureError: the mesh has too few vertices for the cones that it needs.
    """
    distortion = min(max(distortion, MIN_DISTORTION), MAX_DISTORTION)
    angle, origin = SHARP_ANGLE if sharp_angle is None else sharp_angle, np.arange(len(mesh.vertices))
    degrees = np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    if len(mesh.faces) > 2 * COARSE_TRIANGLES:
        coarse = coarse_mesh(mesh, COARSE_TRIANGLES)
        mesh, origin = coarse.mesh, coarse.vertices
    directions, start = directions_and_indices(mesh, angle)
    scale = None if log_scale is None else log_scale[origin]
    seam_masks = () if mirror is None else (on_seam(mesh, mirror), at_seam_ends(mesh, mirror))
    model = MapModel(
        mesh, directions.combined, min_quarters, max_quarters, degrees[origin], scale, *seam_masks
    )
    search = _Search(mesh, model, start, price, angle)
    limit.check_cones(search.fixed_quarters)
    follows_edges = sharp_angle is not None or is_mechanical(mesh, angle)
    along = COST_OF_DIRECTIONS * (TIMES_REQUIRED if follows_edges else 1.0)
    areas = COST_OF_AREAS
    for _ in range(MAX_DOUBLINGS + 1):
        search.descend_all(_Costs(areas / distortion**2, along))
        if model.spread <= SPREAD * distortion:
            break
        areas *= 2
    if search.indices[-1]:
        raise CurvatureError(f"{len(mesh.vertices):,} vertices are too few for the cones")
    coned = np.flatnonzero(search.indices[:-1])
    return dict(zip(origin[model.places[coned]].tolist(), search.indices[coned].tolist(), strict=True))


class _Costs(NamedTuple):
    """Costs of the squared area distortion, of crosses off by 22.5 degrees, and of a handle's rotation off by 45."""

    areas: float
    directions: float
    handles: float = 60.0


@dataclass(frozen=True, eq=False)
class _Block:
    """The model at some places, or its changes by steps to them.

    Attributes:
        places: (k,) indices of the places.
        scales: (r, k), as in the model, and squares: (k,) their squared norms.
        waves, loops: (s, k), (l, k) the unit complex numbers of the model's turns and loops.
    """

    places: IntArray
    scales: FloatArray
    squares: FloatArray
    waves: ComplexArray
    loops: ComplexArray


class _Search:
    """The descent.

    Attributes:
        indices: (p + 1,) the curvatures at the places in quarter turns; the last one is that without a place yet.
        fixed_quarters: (k,) the angles of cones that stay where they are, in quarter turns.
    """

    def __init__(
        self, mesh: TriangleMesh, model: MapModel, start: IntArray, price: float, sharp_angle: float
    ) -> None:
        self.model, self.graph, self.key = model, vertex_graph(mesh), model.key
        inside = np.clip(start[model.places], model.min_quarters[:-1], model.max_quarters[:-1])
        # Cones at corners of the surface, where sharp edges meet, stay there.
        edges_at = np.bincount(sharp_ends(mesh, sharp_angle).ravel(), minlength=len(mesh.vertices))[
            model.places
        ]
        is_corner = (inside != 0) & (edges_at > 2) & (np.abs(model.curvature - inside) < MAX_CORNER_ERROR)
        fixed = np.flatnonzero(is_corner)
        model.min_quarters[fixed] = model.max_quarters[fixed] = inside[fixed]
        is_border = mesh.is_boundary_vertex[model.places[fixed]]
        self.fixed_quarters = np.where(is_border, 2, 4) - inside[fixed]
        self._pairs_left = max(MAX_PAIRS_OF_FEW, PAIRS_PER_VERTEX * len(mesh.vertices))
        self.indices = np.append(inside, start.sum() - inside.sum())
        self.price = np.append(np.full(len(inside), price), COST_OF_MISSING)

    def descend_all(self, costs: _Costs) -> None:
        """Decrease the cost by steps between places all over the mesh, then by steps nearby."""
        self.model.linearise(self.indices)
        first = np.append(self.model.centres[:SAMPLES], len(self.indices) - 1)
        first = np.union1d(first, np.flatnonzero(self.indices))
        self._descend(first, first, costs)
        for radius in RADII:
            cones = np.flatnonzero(self.indices[:-1])
            if len(cones):
                self._descend(
                    cones, np.union1d(cones, self._places_near(cones, radius * self.model.spacing)), costs
                )
            self.model.linearise(self.indices)

    def _places_near(self, cones: IntArray, radius: float) -> IntArray:
        """Return some places near cones; both are indices of places."""
        places, lists = self.model.places, [cones]
        for row in dijkstra(self.graph, indices=places[cones], limit=radius)[:, places]:
            reached = np.flatnonzero(np.isfinite(row))
            order = np.lexsort((self.key[reached], np.round(row[reached] / self.model.spacing, 9)))
            chosen = np.unique(np.linspace(0, len(reached) - 1, PLACES_NEAR + 1).astype(np.int64))
            lists.append(reached[order[chosen]])
        return np.concatenate(lists)

    def _descend(self, pluses: IntArray, minuses: IntArray, costs: _Costs) -> None:
        """Decrease the cost by steps between a place of `one` and a place of `two`, in both directions."""
        first, second = self._block(pluses), self._block(minuses)
        gram = first.scales.T @ second.scales
        squares = first.squares[:, None] + second.squares - 2 * gram
        while self._pairs_left > 0:
            plus, minus = self._best_steps(first, second, squares, costs)
            self._pairs_left -= squares.size
            if not len(plus):
                return
            best, steps = 0, self._block(plus, minus)
            while True:
                self.indices[plus[best]] += 1
                self.indices[minus[best]] -= 1
                self._pairs_left -= len(plus)
                # Few places are all compared again after each step.
                change = self._changes(steps, costs) + self._price_of(1)[plus] + self._price_of(-1)[minus]
                best = int(np.argmin(np.round(change, 6)))
                if change[best] >= -MIN_GAIN or len(minuses) < SAMPLES // 2:
                    break

    def _best_steps(
        self, first: _Block, second: _Block, squares: FloatArray, costs: _Costs
    ) -> tuple[IntArray, IntArray]:
        """Return (k,) places where a quarter turn is added, and those where it is subtracted, by the best steps first.

        Of the steps to each place of one block, from any place of the other, only the best is among them.

        squares: the squared norms of the differences of the blocks' scales.
        """
        model = self.model
        scale, waves, loops = model.state(self.indices)
        now = _direction_cost(waves.sum()[None], loops.sum()[None], model, costs)[0]
        candidates = list[tuple[FloatArray, IntArray, IntArray]]()
        for to, of, square in ((first, second, squares), (second, first, squares.T)):
            change = costs.areas * (square + 2 * ((scale @ to.scales)[:, None] - scale @ of.scales)) - now
            change += self._price_of(1)[to.places][:, None] + self._price_of(-1)[of.places]
            change[to.places[:, None] == of.places] = np.inf
            # The cost of directions is not negative, and most of the time is for its products.
            may_gain = change < -MIN_GAIN
            may_gain[0, 0] = True
            rows, columns = np.flatnonzero(may_gain.any(axis=1)), np.flatnonzero(may_gain.any(axis=0))
            waves_of = (waves[:, None] * to.waves[:, rows]).T @ of.waves[:, columns].conj()
            loops_of = (loops[:, None] * to.loops[:, rows]).T @ of.loops[:, columns].conj()
            change = change[rows[:, None], columns] + _direction_cost(waves_of, loops_of, model, costs)
            best = np.round(change, 6).argmin(axis=1)
            candidates.append((change[np.arange(len(best)), best], to.places[rows], of.places[columns[best]]))
            if np.array_equal(to.places, of.places):
                break
        change, plus, minus = (np.concatenate(parts) for parts in zip(*candidates, strict=True))
        order = np.argsort(np.round(change, 6), kind="stable")[: int((change < -MIN_GAIN).sum())]
        return plus[order], minus[order]

    def _changes(self, steps: _Block, costs: _Costs) -> FloatArray:
        """Return (k,) the changes of the cost by steps between places, without the price of cones."""
        model = self.model
        scale, waves, loops = model.state(self.indices)
        now = _direction_cost(waves.sum()[None], loops.sum()[None], model, costs)[0]
        directions = _direction_cost(waves @ steps.waves, loops @ steps.loops, model, costs)
        return costs.areas * (steps.squares + 2 * scale @ steps.scales) + directions - now

    def _price_of(self, step: int) -> FloatArray:
        """Return (p + 1,) the change of the price of cones by a quarter turn more (1) or less (-1)."""
        model, indices = self.model, self.indices
        may = indices < model.max_quarters if step > 0 else indices > model.min_quarters
        return np.where(may, np.abs(indices + step) - np.abs(indices), np.inf) * self.price

    def _block(self, places: IntArray, origins: IntArray | None = None) -> _Block:
        """Return the model at places, or its changes by steps to them from their origins (k,)."""
        model = self.model
        scales, turns, loops = (
            matrix[:, places] if origins is None else matrix[:, places] - matrix[:, origins]
            for matrix in (model.scales, model.turns, model.loops)
        )
        return _Block(places, scales, (scales**2).sum(axis=0), np.exp(1j * turns), np.exp(1j * loops))


def _direction_cost(waves: ComplexArray, loops: ComplexArray, model: MapModel, costs: _Costs) -> FloatArray:
    """Return the cost of directions for sums of crosses over the samples, and of phases over the loops."""
    off = 1 - np.abs(waves) / model.weight
    return np.asarray(costs.directions * off + costs.handles * (len(model.loops) - loops.real) / 2)
