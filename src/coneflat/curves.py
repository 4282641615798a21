"""Search for cones without flattening, and the curve of area distortion against the number of cones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .base.arrays import FloatArray, IntArray
from .base.notes import warns
from .base.progress import component_at_work, stage, timing
from .base.threads import limit_threads
from .cones import ConeSearch, ConeSurface, SparseCones, coneless_solution, unmet_requests
from .errors import OptionError
from .geometry import double_areas
from .geometry.operators import area_distortion, weighted_areas
from .io.packages import as_input
from .options import CurveOptions, FindOptions, Options, read_options, takes
from .source import Component, Source


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
    """The area distortion of a whole mesh against the largest number of cones in each of its components.

    Attributes:
        counts: (k,) largest number of cones in each component, as the option `cone_count` sets it.
        distortions: (k,) area distortion E of the linear model of all components, decreasing.
        components: number of components, which marked seams also separate.
    """

    counts: IntArray
    distortions: FloatArray
    components: int

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
    """Find the cones of the largest component of a mesh, without flattening it; the borders of holes absorb curvature.

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
    with timing(chosen.progress), limit_threads():
        component = _largest_component(mesh, faces, chosen)
        with component_at_work("", 1.0), stage("cones"):
            search = _open_search(component)
            if isinstance(search, SparseCones):
                cones = search
            elif chosen.cone_count is None:
                cones = search.fewest(chosen.distortion)
            else:
                cones = search.best_of(chosen.cone_count)
    notes = unmet_requests(component.mesh, cones.solution.cones, cones.distortion, component.cones)
    return replace(_in_numbering_of_input(cones, component), notes=notes)


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
    with timing(chosen.progress), limit_threads():
        component = _largest_component(mesh, faces, chosen)
        with component_at_work("", 1.0):
            return _curve(component, parsed.most)


def whole_curve(mesh: Any, options: Options, max_count: int) -> WholeCurve:
    """Search for the best set of cones of each size, on all components of a mesh.

    Args:
        mesh: as for `coneflat.flatten`.
        options: parsed options of `coneflat.flatten`; `cone_count` is ignored.
        max_count: largest number of cones in each component.

    Returns:
        The area distortion of the whole mesh against the number of cones.

    Raises:
        ConeflatError: as for `coneflat.flatten`.
    """
    with timing(options.progress), limit_threads(options.threads):
        with stage("check"):
            components = Source(as_input(mesh)).prepared(options).components
        triangles = sum(len(component.faces) for component in components)
        curves = []
        for component in components:
            with component_at_work("", len(component.faces) / triangles):
                curves.append(_curve(component, max_count))
    smallest_count = max(curve.counts[0] for curve in curves)
    counts = np.unique(np.concatenate([[smallest_count], *(curve.counts for curve in curves)]))
    counts = counts[counts >= smallest_count]
    # If up to c cones are allowed, a component uses its best set of at most c cones.
    distortions = [
        curve.distortions[np.searchsorted(curve.counts, counts, side="right") - 1] for curve in curves
    ]
    areas = [double_areas(component.lengths).sum() for component in components]
    combined = np.sqrt(np.average(np.square(distortions), axis=0, weights=areas))
    return WholeCurve(counts, combined, len(components))


def _largest_component(mesh: Any, faces: ArrayLike | None, options: Options) -> Component:
    """Return the largest component of a mesh."""
    with stage("check"):
        components = Source(as_input(mesh, faces)).prepared(options).components
    return max(components, key=lambda component: len(component.faces))


def _curve(component: Component, max_count: int) -> ConeCurve:
    """Return the curve of a component."""
    with stage("cones"):
        search = _open_search(component)
        sets = [search] if isinstance(search, SparseCones) else search.curve(max_count)
    if not sets:
        raise OptionError(f"no set of up to {max_count} cones absorbs this surface's curvature; allow more")
    return ConeCurve(tuple(_in_numbering_of_input(cones, component) for cones in sets))


def _open_search(component: Component) -> ConeSearch | SparseCones:
    """Return a cone search on a component, or the solution without cones if no vertex may be one."""
    surface = ConeSurface.of(component.mesh, component.lengths)
    coneless = coneless_solution(surface, component.cones)
    if coneless is None:
        return surface.search(component.cones)
    share = weighted_areas(surface.areas, component.cones.weights)
    return SparseCones(coneless, area_distortion(coneless.log_scale, share))


def _in_numbering_of_input(cones: SparseCones, component: Component) -> FoundCones:
    vertices = component.cones.names[cones.solution.cones]
    return FoundCones(vertices, cones.solution.curvatures, cones.distortion)
