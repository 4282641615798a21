"""Area distortion against the number of cones, so that the knee can be chosen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ._arrays import FloatArray, IntArray
from .cones import ConeSolution
from .cones.choose import Surface, only_choice, search_on
from .errors import OptionError
from .geometry.operators import area_distortion, weighted_areas
from .input.components import Component, prepare
from .options import CurveOptions, FindOptions, Options, read_options, takes
from .progress import Stages
from .threads import using_threads

if TYPE_CHECKING:
    from .cones.sparse import ConeSearch


@dataclass(frozen=True, eq=False)
class FoundCones:
    """Cones of a mesh.

    Attributes:
        vertices: (s,) in the input's numbering.
        curvatures: (s,) radians.
        distortion: E of the linear model with them.
    """

    vertices: IntArray
    curvatures: FloatArray
    distortion: float


@dataclass(frozen=True, eq=False)
class ConeCurve:
    """The best cones found for each number of them.

    Attributes:
        sets: the cones, fewer first; the distortion falls.
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
        counts, distortions = self.counts, self.distortions
        across, down = np.ptp(counts), np.ptp(distortions)
        return int(counts[np.argmin(counts / (across or 1) + distortions / (down or 1.0))])


@takes(FindOptions)
def find_cones(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> FoundCones:
    """Find the cones of the largest component of a mesh, without flattening it.

    Args:
        mesh, faces: as for `coneflat.flatten`, and so are the errors.
        options: see below.
    """
    asked = read_options(options, FindOptions)
    chosen = Options(**vars(asked))
    stages = Stages(chosen.progress)
    with using_threads():
        opened = _open(mesh, faces, chosen, stages)
        if isinstance(opened, FoundCones):
            return opened
        search, part = opened
        with stages("cones"):
            count = chosen.cone_count
            found = search.fewest(chosen.distortion) if count is None else search.best_of(count)
    return _named(found.solution, found.distortion, part)


@takes(CurveOptions)
def cone_curve(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> ConeCurve:
    """Search for the best cones of every number of them, on the largest component of a mesh.

    Args:
        mesh, faces: as for `coneflat.flatten`, and so are the errors.
        options: see below.
    """
    asked = read_options(options, CurveOptions)
    chosen = Options(**{name: value for name, value in vars(asked).items() if name != "most"})
    stages = Stages(chosen.progress)
    with using_threads():
        opened = _open(mesh, faces, chosen, stages)
        if isinstance(opened, FoundCones):
            return ConeCurve((opened,))
        search, part = opened
        with stages("cones"):
            found = search.curve(asked.most)
    if not found:
        raise OptionError(f"no set of up to {asked.most} cones carries this surface's curvature; allow more")
    return ConeCurve(tuple(_named(each.solution, each.distortion, part) for each in found))


def _open(
    mesh: Any, faces: ArrayLike | None, options: Options, stages: Stages
) -> tuple[ConeSearch, Component] | FoundCones:
    """Return a search on the largest component, or what there is where no vertex of it may be a cone."""
    with stages("check"):
        part = max(prepare(mesh, faces, options).components, key=lambda each: len(each.faces))
    surface = Surface.of(part.mesh, part.lengths)
    only = only_choice(surface, part.constraints, options)
    if only is not None:
        share = weighted_areas(surface.areas, part.constraints.weights)
        return _named(only, area_distortion(only.log_scale, share), part)
    stages.share = 1.0
    with stages("cones", 0.3):
        return search_on(surface, part.constraints, options, stages), part


def _named(solution: ConeSolution, distortion: float, part: Component) -> FoundCones:
    return FoundCones(part.constraints.names[solution.cones], solution.curvatures, distortion)
