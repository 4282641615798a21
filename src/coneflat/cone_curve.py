"""Area distortion against the number of cones, so that the knee can be chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .base.arrays import FloatArray, IntArray
from .base.progress import Stopwatch
from .base.threads import using_threads
from .cones import only_choice, open_search
from .errors import OptionError
from .geometry import double_areas
from .geometry.operators import area_distortion, weighted_areas
from .io.packages import as_input
from .options import CurveOptions, FindOptions, Options, read_options, takes
from .source.parts import Part, Source
from .stages import ConeSolution, Surface

if TYPE_CHECKING:
    from .cones.sparse import ConeSearch


@dataclass(frozen=True, eq=False)
class FoundCones:
    """Cones of a mesh.

    Attributes:
        vertices: (s,) in the input's numbering.
        curvatures: (s,) radians.
        distortion: E of the linear model with them: the standard deviation of the log of the scale, by area.
    """

    vertices: IntArray
    curvatures: FloatArray
    distortion: float


@dataclass(frozen=True, eq=False)
class ConeCurve:
    """The best cones found for each number of them.

    Attributes:
        sets: the cones, fewer first; the distortion falls.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> curve = coneflat.cone_curve(vertices, faces)
        >>> curve.counts  # no fewer cones carry the curvature of a sphere
        array([3, 4])
        >>> curve.sets[-1].vertices
        array([0, 1, 2, 3])
    """

    sets: tuple[FoundCones, ...]

    @property
    def counts(self) -> IntArray:
        """(k,) numbers of cones."""
        return np.array([len(each.vertices) for each in self.sets])

    @property
    def distortions(self) -> FloatArray:
        """(k,) E of the linear model with so many."""
        return np.array([each.distortion for each in self.sets])

    @property
    def knee(self) -> int:
        """The number of cones beyond which more of them gain least: farthest below the chord of the curve."""
        return _knee(self.counts, self.distortions)


@dataclass(frozen=True, eq=False)
class WholeCurve:
    """The area distortion of a whole mesh with up to so many cones in each of its parts.

    Attributes:
        counts: (k,) cones in each part: as many are allowed as `cone_count` allows.
        distortions: (k,) E of the linear model of all parts, which falls.
        parts: how many there are: components, and what marked seams divide them into.
    """

    counts: IntArray
    distortions: FloatArray
    parts: int

    @property
    def knee(self) -> int:
        """The number of cones beyond which more of them gain least: farthest below the chord of the curve."""
        return _knee(self.counts, self.distortions)


def _knee(counts: IntArray, distortions: FloatArray) -> int:
    across, down = np.ptp(counts), np.ptp(distortions)
    return int(counts[np.argmin(counts / (across or 1) + distortions / (down or 1.0))])


@takes(FindOptions)
def find_cones(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> FoundCones:
    """Find the cones of the largest component of a mesh, without flattening it.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        options: see below.

    Returns:
        Vertices in the input's numbering, their curvatures in radians, and the area distortion that is left; without
        cones the arrays are empty.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        MeshFileError: its file cannot be read.
        CurvatureError: no cones that are allowed carry the curvature of the surface.
        OptionError: an option is unknown or makes no sense.
        MetricError: the computation found no finite result.
        TooLargeError: it does not fit into the memory that is free.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> found = coneflat.find_cones(vertices, faces)
        >>> found.vertices
        array([0, 1, 2, 3])
        >>> np.round(found.curvatures / np.pi, 6)
        array([1., 1., 1., 1.])
    """
    asked = read_options(options, FindOptions)
    chosen = Options(**vars(asked))
    stages = Stopwatch(chosen.progress)
    with using_threads():
        part = _largest(mesh, faces, chosen, stages)
        search = _open(part, stages)
        if isinstance(search, FoundCones):
            return search
        with stages("cones"):
            count = chosen.cone_count
            found = search.fewest(chosen.distortion) if count is None else search.best_of(count)
    return _named(found.solution, found.distortion, part)


@takes(CurveOptions)
def cone_curve(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> ConeCurve:
    """Search for the best cones of every number of them, on the largest component of a mesh.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        options: see below.

    Returns:
        One set of cones for each number that has one, up to `most`, fewer first. Vertices are in the input's
        numbering, curvatures in radians.

    Raises:
        MeshError: the mesh cannot be flattened; see `coneflat.errors` for its kinds.
        MeshFileError: its file cannot be read.
        CurvatureError: no cones that are allowed carry the curvature of the surface.
        OptionError: an option is unknown or makes no sense, or no set of up to `most` cones carries the curvature.
        MetricError: the computation found no finite result.
        TooLargeError: it does not fit into the memory that is free.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> curve = coneflat.cone_curve(vertices, faces, most=4)
        >>> for count, distortion in zip(curve.counts, curve.distortions):
        ...     print(count, f"{distortion:.3f}")
        3 0.785
        4 0.000
    """
    asked = read_options(options, CurveOptions)
    chosen = Options(**{name: value for name, value in vars(asked).items() if name != "most"})
    stages = Stopwatch(chosen.progress)
    with using_threads():
        return _curve(_largest(mesh, faces, chosen, stages), asked.most, stages)[0]


def whole_curve(mesh: Any, faces: ArrayLike | None, options: Options, most: int) -> WholeCurve:
    """Search for the best cones of every number of them, on all parts of a mesh.

    Args:
        mesh, faces: as for `coneflat.flatten`, and so are the errors.
        options: of `coneflat.flatten`, that have been read; their number of cones does not matter.
        most: the largest number of cones, in each part.
    """
    stages = Stopwatch(options.progress)
    with using_threads(options.threads):
        with stages("check"):
            parts = Source(as_input(mesh, faces)).prepared(options).parts
        total, curves = sum(len(part.faces) for part in parts), []
        for part in parts:
            stages.share = len(part.faces) / total
            curves.append(_curve(part, most, stages))
            stages.end_part()
    least = max(curve.counts[0] for curve, _ in curves)
    counts = np.unique(np.concatenate([[least], *(curve.counts for curve, _ in curves)]))
    counts = counts[counts >= least]
    # With so many cones allowed a part has the best set of so many or fewer.
    each = [curve.distortions[np.searchsorted(curve.counts, counts, side="right") - 1] for curve, _ in curves]
    areas = [area for _, area in curves]
    whole = np.sqrt(np.average(np.square(each), axis=0, weights=areas))
    return WholeCurve(counts, whole, len(parts))


def _largest(mesh: Any, faces: ArrayLike | None, options: Options, stages: Stopwatch) -> Part:
    """Return the largest component of a mesh, which then is all that there is to do."""
    with stages("check"):
        part = max(Source(as_input(mesh, faces)).prepared(options).parts, key=lambda each: len(each.faces))
    stages.share = 1.0
    return part


def _curve(part: Part, most: int, stages: Stopwatch) -> tuple[ConeCurve, float]:
    """Return the curve of a component, and its area, twice."""
    area, search = float(double_areas(part.lengths).sum()), _open(part, stages)
    if isinstance(search, FoundCones):
        return ConeCurve((search,)), area
    with stages("cones"):
        found = search.curve(most)
    if not found:
        raise OptionError(f"no set of up to {most} cones carries this surface's curvature; allow more")
    return ConeCurve(tuple(_named(each.solution, each.distortion, part) for each in found)), area


def _open(part: Part, stages: Stopwatch) -> ConeSearch | FoundCones:
    """Return a search on a component, or what there is where no vertex of it may be a cone."""
    surface = Surface.of(part.mesh, part.lengths)
    only = only_choice(surface, part.cones)
    if only is not None:
        share = weighted_areas(surface.areas, part.cones.weights)
        return _named(only, area_distortion(only.log_scale, share), part)
    with stages("cones", 0.3):
        return open_search(surface, part.cones, stages)


def _named(solution: ConeSolution, distortion: float, part: Part) -> FoundCones:
    return FoundCones(part.cones.names[solution.cones], solution.curvatures, distortion)
