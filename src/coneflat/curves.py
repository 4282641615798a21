"""Search for cones without flattening, and the curve of area distortion against the number of cones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .base.arrays import FloatArray, IntArray
from .base.notes import warns
from .base.progress import Stopwatch
from .base.threads import limit_threads
from .cones import ConeSurface, coneless_solution, unmet_requests
from .errors import OptionError
from .geometry import double_areas
from .geometry.operators import area_distortion, weighted_areas
from .io.packages import as_input
from .options import CurveOptions, FindOptions, Options, read_options, takes
from .source import Component, Source
from .stages import ConeSolution

if TYPE_CHECKING:
    from .cones.sparse import ConeSearch


@dataclass(frozen=True, eq=False)
class FoundCones:
    """Cones of a mesh.

    Attributes:
        vertices: (s,) in the input's numbering.
        curvatures: (s,) radians.
        distortion: area distortion E: area-weighted standard deviation of the linear log conformal factor.
        notes: unmet requests, one sentence each.
    """

    vertices: IntArray
    curvatures: FloatArray
    distortion: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ConeCurve:
    """The best set of cones found for each number of cones.

    Attributes:
        sets: sets of cones in the order of their size; the distortion decreases.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> curve = coneflat.cone_curve(vertices, faces)
        >>> curve.counts  # no fewer cones absorb the curvature of a sphere
        array([3, 4])
        >>> curve.sets[-1].vertices
        array([0, 1, 2, 3])
    """

    sets: tuple[FoundCones, ...]

    @property
    def counts(self) -> IntArray:
        """(k,) numbers of cones."""
        return np.array([len(cones.vertices) for cones in self.sets])

    @property
    def distortions(self) -> FloatArray:
        """(k,) area distortion E of the linear model with each set of cones."""
        return np.array([cones.distortion for cones in self.sets])

    @property
    def knee(self) -> int:
        """The number of cones beyond which additional cones reduce E little: farthest below the chord of the curve."""
        return _knee(self.counts, self.distortions)


@dataclass(frozen=True, eq=False)
class WholeCurve:
    """The area distortion of a whole mesh against the largest number of cones in each of its parts.

    Attributes:
        counts: (k,) largest number of cones in each part, as the option `cone_count` sets it.
        distortions: (k,) area distortion E of the linear model of all parts, decreasing.
        parts: number of parts: components, and the pieces into which marked seams divide them.
    """

    counts: IntArray
    distortions: FloatArray
    parts: int

    @property
    def knee(self) -> int:
        """The number of cones beyond which additional cones reduce E little: farthest below the chord of the curve."""
        return _knee(self.counts, self.distortions)


def _knee(counts: IntArray, distortions: FloatArray) -> int:
    across, down = np.ptp(counts), np.ptp(distortions)
    return int(counts[np.argmin(counts / (across or 1) + distortions / (down or 1.0))])


@takes(FindOptions)
@warns("found.notes")
def find_cones(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> FoundCones:
    """Find the cones of the largest component of a mesh, without flattening it.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        options: see below.

    Returns:
        Vertices in the input's numbering, their curvatures in radians, and the remaining area distortion. The arrays
        are empty if there are no cones.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        MeshFileError: its file cannot be read.
        CurvatureError: no cones that are allowed absorb the curvature of the surface.
        OptionError: an option is unknown or invalid.
        MetricError: the computation found no finite result.
        TooLargeError: the mesh does not fit into the free memory.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> found = coneflat.find_cones(vertices, faces)
        >>> found.vertices
        array([0, 1, 2, 3])
        >>> np.round(found.curvatures / np.pi, 6)
        array([1., 1., 1., 1.])
    """
    parsed = read_options(options, FindOptions)
    chosen = Options(**vars(parsed))
    stages = Stopwatch(chosen.progress)
    with limit_threads():
        part = _largest(mesh, faces, chosen, stages)
        search = _open(part, stages)
        if isinstance(search, FoundCones):
            notes = unmet_requests(part.mesh, np.empty(0, np.int64), search.distortion, part.cones)
            return replace(search, notes=notes)
        with stages("cones"):
            count = chosen.cone_count
            search_result = search.fewest(chosen.distortion) if count is None else search.best_of(count)
    notes = unmet_requests(part.mesh, search_result.solution.cones, search_result.distortion, part.cones)
    return replace(_found_cones(search_result.solution, search_result.distortion, part), notes=notes)


@takes(CurveOptions)
def cone_curve(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> ConeCurve:
    """Search for the best set of cones of each size, on the largest component of a mesh.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        options: see below.

    Returns:
        One set of cones for each feasible number of cones up to `most`, in ascending order. Vertices are in the
        input's numbering, curvatures in radians.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        MeshFileError: its file cannot be read.
        CurvatureError: no cones that are allowed absorb the curvature of the surface.
        OptionError: an option is unknown or invalid, or no set of up to `most` cones has the required total curvature.
        MetricError: the computation found no finite result.
        TooLargeError: the mesh does not fit into the free memory.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> curve = coneflat.cone_curve(vertices, faces, most=4)
        >>> for count, distortion in zip(curve.counts, curve.distortions):
        ...     print(count, f"{distortion:.3f}")
        3 0.785
        4 0.000
    """
    parsed = read_options(options, CurveOptions)
    chosen = Options(**{name: value for name, value in vars(parsed).items() if name != "most"})
    stages = Stopwatch(chosen.progress)
    with limit_threads():
        return _curve(_largest(mesh, faces, chosen, stages), parsed.most, stages)[0]


def whole_curve(mesh: Any, options: Options, max_count: int) -> WholeCurve:
    """Search for the best set of cones of each size, on all parts of a mesh.

    Args:
        mesh: as for `coneflat.flatten`.
        options: parsed options of `coneflat.flatten`; `cone_count` is ignored.
        max_count: largest number of cones in each part.

    Returns:
        The area distortion of the whole mesh against the number of cones.

    Raises:
        ConeflatError: as for `coneflat.flatten`.
    """
    stages = Stopwatch(options.progress)
    with limit_threads(options.threads):
        with stages("check"):
            parts = Source(as_input(mesh)).prepared(options).components
        total, curves = sum(len(part.faces) for part in parts), []
        for part in parts:
            stages.share = len(part.faces) / total
            curves.append(_curve(part, max_count, stages))
            stages.end_component()
    smallest_count = max(curve.counts[0] for curve, _ in curves)
    counts = np.unique(np.concatenate([[smallest_count], *(curve.counts for curve, _ in curves)]))
    counts = counts[counts >= smallest_count]
    # If up to c cones are allowed, a part uses its best set of at most c cones.
    per_part = [
        curve.distortions[np.searchsorted(curve.counts, counts, side="right") - 1] for curve, _ in curves
    ]
    areas = [area for _, area in curves]
    distortions = np.sqrt(np.average(np.square(per_part), axis=0, weights=areas))
    return WholeCurve(counts, distortions, len(parts))


def _largest(mesh: Any, faces: ArrayLike | None, options: Options, stages: Stopwatch) -> Component:
    """Return the largest component of a mesh; progress counts this component alone."""
    with stages("check"):
        part = max(
            Source(as_input(mesh, faces)).prepared(options).components,
            key=lambda component: len(component.faces),
        )
    stages.share = 1.0
    return part


def _curve(part: Component, max_count: int, stages: Stopwatch) -> tuple[ConeCurve, float]:
    """Return the curve of a component and twice its area."""
    area, search = float(double_areas(part.lengths).sum()), _open(part, stages)
    if isinstance(search, FoundCones):
        return ConeCurve((search,)), area
    with stages("cones"):
        curve = search.curve(max_count)
    if not curve:
        raise OptionError(f"no set of up to {max_count} cones absorbs this surface's curvature; allow more")
    return ConeCurve(tuple(_found_cones(cones.solution, cones.distortion, part) for cones in curve)), area


def _open(part: Component, stages: Stopwatch) -> ConeSearch | FoundCones:
    """Return a cone search on a component, or the only possible set of cones if there is nothing to search."""
    surface = ConeSurface.of(part.mesh, part.lengths)
    coneless = coneless_solution(surface, part.cones)
    if coneless is not None:
        share = weighted_areas(surface.areas, part.cones.weights)
        return _found_cones(coneless, area_distortion(coneless.log_scale, share), part)
    with stages("cones", 0.3):
        return surface.search(part.cones)


def _found_cones(solution: ConeSolution, distortion: float, part: Component) -> FoundCones:
    return FoundCones(part.cones.names[solution.cones], solution.curvatures, distortion)
