"""Search for the fewest cones of an allowed area distortion; a search of a mesh is reused for any number of queries.

In the linear model, phi = phi_0 + sum_s k_s g_s with the Green's functions g_s of the cones, so choosing cones for a
small norm of phi is a sparse approximation. The literature has relaxations (Y. Soliman, D. Slepcev, K. Crane,
"Optimal cone singularities for conformal flattening", 2018; Q. Fang, W. Ouyang, M. Li, L. Liu, X.-M. Fu, "Computing
sparse cones with bounded distortion for conformal parameterizations", 2021) and moves of given cones (M. Li, Q. Fang,
Z. Zhang, L. Liu, X.-M. Fu, "Efficient cone singularity construction for conformal parameterizations", 2023). Here,
positions are exchanged as in subset selection, first on a dense coarse model, where this is cheap, and then with exact
energies. Cones that the mesh needs beyond those of the coarse model, as noisy ones do, are added where the derivative
of E^2 is largest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray
from ...base.defaults import DISTORTION, MAX_CONE_ANGLE, MIN_CONE_ANGLE
from ...base.progress import report_detail
from ...base.text import list_some, plural
from ...base.threads import concurrently
from ...errors import OptionError
from ...geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents, edge_lengths, mollify
from ...geometry.operators import vertex_areas, weighted_areas
from ...mesh.connectivity import TriangleMesh
from ...mesh.ties import tie_key
from ...stages import ConeSolution
from ..solution import TIE_TOLERANCE
from .dense_model import STALL_FACTOR, ConeSet
from .fine_model import FineModel
from .limits import MAX_SEARCHED, Limits
from .linear_model import LinearModel
from .starts import DenseStarts, StartsOf


@dataclass(frozen=True)
class SparseCones:
    """The result of a search for cones.

    Attributes:
        solution: the cones.
        distortion: E of the linear model, the area-weighted standard deviation of its log conformal factor.
    """

    solution: ConeSolution
    distortion: float


class ConeSearch:
    """A search for cones on a connected mesh; the Laplacian is factorized once for any number of queries.

    It is made by `from_mesh`. The distortion E is the area-weighted standard deviation of the linear log conformal
    factor. A boundary has phi = 0 and absorbs the remaining curvature. The best sets of each size are cached, so that
    later queries start from them.

        search = ConeSearch.from_mesh(mesh)
        search.fewest(0.2).solution.cones

    Attributes:
        fine: the model with the energies of sets on the mesh; its required cones are always cones.
        starts: the sets of a smaller model, on which cones are searched first.
        limits: bounds and sum of the curvatures.
        operator: the Laplacian of the vertices that can be cones.

    Notes:
        Sets of each size are found on a smaller model, by adding cones one at a time and exchanging members
        (`DenseModel`), and are then moved over the mesh (`FineModel.refine`). Matching pursuit adds the candidate
        that lowers E^2 most if all curvatures are fitted again; moves follow the gradient of E^2. References are in
        the docstring of the module.

    See Also:
        coneflat.cones.integer.search.quantise_cones: curvatures that are multiples of a quantum.
        coneflat.cones.greedy_cones: the search of the paper.
    """

    def __init__(self, linear: LinearModel, fine: FineModel, usable: BoolArray, starts_of: StartsOf) -> None:
        """Set up a search for cones at vertices.

        Args:
            linear: the linear model of the mesh.
            fine: the model of the sets on the mesh, with the required cones.
            usable: (n,) mask of the other vertices that may be cones.
            starts_of: returns the sets that the search starts from.

        Raises:
            CurvatureError: cones at these vertices cannot absorb the curvature.
        """
        self.operator, self.limits = linear.operator, fine.limits
        self._linear, self._usable, self._starts_of = linear, usable, starts_of
        self.limits.check_available(usable, self.operator.vertices[fine.unknowns[fine.fixed]])
        self.fine = fine.restricted(usable[self.operator.vertices])
        self.starts = starts_of(self.fine)
        # What the last refinement of each size started from, and the sizes that more cones hardly improve.
        self._refined = dict[int, tuple[float, ...]]()
        self._stalled = set[int]()

    @classmethod
    def of(
        cls,
        linear: LinearModel,
        euler_characteristic: float,
        *,
        min_cone_angle: float = MIN_CONE_ANGLE,
        max_cone_angle: float | None = MAX_CONE_ANGLE,
        positive_only: bool = False,
        required: Iterable[int] = (),
        allowed: BoolArray | None = None,
        max_angles: FloatArray | None = None,
        starts_of: StartsOf | None = None,
    ) -> ConeSearch:
        """Return a search on a linear model.

        Args:
            linear: the linear model of the mesh.
            euler_characteristic: chi of the mesh.
            min_cone_angle, max_cone_angle: bounds of the cone angles 2 pi - k, radians.
            positive_only: no cones of negative curvature (angles above 2 pi).
            required: vertices that are always cones.
            allowed: (n,) mask of the other vertices that may be cones; None: all.
            max_angles: (n,) largest cone angle at each vertex, radians, in addition to `max_cone_angle`; None: no
                further bound.
            starts_of: returns the sets that the search starts from; None: those on the coarse basis of the model.

        Raises:
            OptionError: an option is not valid.
            CurvatureError: no curvatures within the bounds have the sum that the surface needs.
        """
        is_boundary, operator = linear.is_boundary, linear.operator
        chi = None if is_boundary.any() else euler_characteristic
        limits = Limits.of_angles(chi, min_cone_angle, max_cone_angle, positive_only)
        if allowed is not None and allowed.shape != is_boundary.shape:
            raise OptionError(f"allowed must be {len(is_boundary):,} flags, got the shape {allowed.shape}")
        cones = required_vertices(required, is_boundary)
        usable = ~is_boundary if allowed is None else ~is_boundary & allowed
        limits.check_available(usable, cones)
        lower = np.full(len(operator.vertices), limits.lower)
        if max_angles is not None:
            lower = np.maximum(lower, np.minimum(math.tau - max_angles[operator.vertices], 0.0))
        if starts_of is None:  # before the fine model, as the coarse one is computed during the factorization
            starts_of = partial(DenseStarts, linear.coarse)
        fine = FineModel(linear, operator.unknowns_of(cones), limits, lower)
        # The fine model will need the score; it is computed while the smaller model is set up.
        with concurrently(lambda: linear.score, 2 * len(operator.vertices)):
            return cls(linear, fine, usable, starts_of)

    @classmethod
    def from_mesh(
        cls,
        mesh: TriangleMesh,
        lengths: FloatArray | None = None,
        weights: FloatArray | None = None,
        **options: Any,
    ) -> ConeSearch:
        """Return a search on a connected mesh; its boundary absorbs curvature without having cones.

        Args:
            mesh: see `coneflat.check_mesh`.
            lengths: (m, 3) side lengths; None: those of the vertex positions, mollified.
            weights: (n,) importance of each vertex; None: 1.
            options: keyword arguments of the class.
        """
        lengths = mollify(edge_lengths(mesh.vertices, mesh.faces), mesh)[0] if lengths is None else lengths
        count, is_boundary = len(mesh.vertices), mesh.is_boundary_vertex
        linear = LinearModel.of(
            cotangent_laplacian(mesh.faces, cotangents(lengths), count),
            angle_defect(mesh.faces, corner_angles(lengths), is_boundary),
            weighted_areas(vertex_areas(mesh.faces, lengths, count), weights),
            is_boundary,
            tie_key(mesh.vertices),
        )
        return cls.of(linear, mesh.euler_characteristic, **options)

    def restricted(self, allowed: BoolArray) -> ConeSearch:
        """Return the search for cones at allowed vertices (n,); Green's functions are shared.

        If these are the vertices of this search, it is returned itself, with the sets that it has found.

        Raises:
            CurvatureError: cones at these vertices cannot absorb the curvature.
        """
        usable = ~self._linear.is_boundary & allowed
        if np.array_equal(usable, self._usable):
            return self
        return ConeSearch(self._linear, self.fine, usable, self._starts_of)

    @cached_property
    def dense_starts(self) -> DenseStarts:
        """The sets on the coarse basis of the mesh."""
        return (
            self.starts
            if isinstance(self.starts, DenseStarts)
            else DenseStarts(self._linear.coarse, self.fine)
        )

    @cached_property
    def max_cones(self) -> int:
        """The largest number of cones searched for."""
        largest = min(MAX_SEARCHED + len(self.fine.fixed), self.starts.largest)
        return largest if self.limits.largest is None else min(largest, self.limits.largest)

    def fewest(self, distortion: float = DISTORTION, max_count: int | None = None) -> SparseCones:
        """Return the fewest cones found with E <= distortion, or the best `max_count` cones if more are needed.

        Args:
            distortion: the allowed E, positive.
            max_count: largest number of cones; None for no limit.

        Raises:
            OptionError: `distortion` or `max_count` is not valid.
            CurvatureError: `max_count` cones cannot absorb the curvature.
        """
        if not 0 < distortion < math.inf:
            raise OptionError(f"the distortion allowed must be a positive number, got {distortion:g}")
        if max_count is not None:
            self.limits.check_count(max_count, len(self.fine.fixed))
        max_count = self.max_cones if max_count is None else min(max_count, self.max_cones)
        goal = distortion * distortion
        count = self._find_sufficient(goal, max_count)
        while self._may_suffice(count - 1, goal) and self._refine(count - 1, goal) <= goal:
            count -= 1
        # If it is not reached: the fewest cones that are nearly as good as the best set.
        smallest_energy = self.fine.best.fewest(goal, max_count).energy
        return self._cones(
            self.fine.best.fewest(
                goal if smallest_energy <= goal else smallest_energy / STALL_FACTOR, max_count
            )
        )

    def best_of(self, count: int) -> SparseCones:
        """Return the cones of smallest E that were found, at most `count` of them.

        Args:
            count: largest number of cones.

        Raises:
            OptionError: `count` is not valid.
            CurvatureError: `count` cones cannot absorb the curvature.
        """
        self.limits.check_count(count, len(self.fine.fixed))
        count = min(count, self.max_cones)
        self.starts.find_best(count)
        self._refine(max(size for size in self.starts.best.sizes if size <= count))
        fewer = 2 * count // 3
        if self._refine(fewer) < math.inf:
            self.fine.refine(self.fine.extended(self.fine.best[fewer].members, 0.0, count))
        return self._cones(self.fine.best.fewest(-1.0, count))

    def curve(self, max_count: int) -> list[SparseCones]:
        """Return the best cones found for each number up to `max_count`, if their E is below that of fewer cones.

        Args:
            max_count: largest number of cones.
        """
        max_count = min(max_count, self.max_cones)
        self.starts.find_all(max_count)
        # First upwards, then downwards: the best set may be the next larger set without one of its cones.
        for count in (*range(max_count + 1), *range(max_count, -1, -1)):
            self._refine(count)
        curve: list[SparseCones] = []
        for count in self.fine.best.sizes:
            cones = self._cones(self.fine.best[count])
            if count <= max_count and (not curve or cones.distortion < curve[-1].distortion - TIE_TOLERANCE):
                curve.append(cones)
        return curve

    def _find_sufficient(self, goal: float, max_count: int) -> int:
        """Return how many cones reach E^2 <= goal on the mesh, or stall."""
        fine, best, excess = self.fine, self.fine.best, 0.0
        # On a noisy mesh E^2 exceeds that of the smaller model: a second search allows for it.
        for _ in range(2):
            cones = self.starts.find_fewest(goal - excess, max_count)
            energy = self._refine(len(cones), goal)
            excess = energy - cones.energy
            if energy <= goal or excess >= goal / 2:
                break
        while best.fewest(goal, max_count).energy > goal:
            start = max(size for size in best.sizes if size <= max_count)
            if start in {max_count, *self._stalled}:
                break
            added = fine.extended(best[start].members, goal, max_count)
            if not fine.refine(added) < STALL_FACTOR * best.energy(start):
                self._stalled |= {start, len(added)}
        return len(best.fewest(goal, max_count))

    def _may_suffice(self, count: int, goal: float) -> bool:
        """Return whether a set of a size may meet the goal on the mesh."""
        sets = self.starts.best
        is_bad = count in sets and sets.energy(count) > goal * self.starts.error
        return count >= max(self.limits.fewest, len(self.fine.fixed)) and not is_bad

    def _refine(self, count: int, goal: float = 0.0) -> float:
        """Refine the best set of a size on the mesh, until E^2 <= goal; return its E^2, infinite if there is none.

        It starts from the best of the set of the smaller model, the next larger set without one cone, and the next
        smaller set with one more.
        """
        report_detail(plural(count, "cone"))
        fine, starts = self.fine, []
        state = (self.starts.best.energy(count), fine.best.energy(count + 1), fine.best.energy(count - 1))
        if self._refined.get(count) == state:
            return fine.best.energy(count)
        self._refined[count] = state
        if count in self.starts.best:
            starts.append(fine.insert(self.starts.unknowns(count)))
        if count + 1 in fine.best:
            starts += fine.shrunk(fine.best[count + 1].members)
        if count - 1 in fine.best:
            starts.append(fine.extended(fine.best[count - 1].members, 0.0, count))
        if starts:
            fine.refine(min(starts, key=fine.energy), goal)
        return fine.best.energy(count)

    def _cones(self, best: ConeSet) -> SparseCones:
        """Return the cones of a set on the mesh; cones of zero curvature are removed unless they are required."""
        unknowns, required = self.fine.unknowns, len(self.fine.fixed)
        members = best.members[self.fine.in_order(best.members)]
        curvatures = self.fine.fit(members).curvatures
        is_kept = np.abs(curvatures) > TIE_TOLERANCE
        is_kept[:required] = True
        kept_curvatures = curvatures[is_kept]
        if self.limits.has_sum and len(kept_curvatures):
            # Correct the sum for rounding and for the removed cones: a metric must have exactly this sum.
            kept_curvatures += (self.limits.total - kept_curvatures.sum()) / len(kept_curvatures)
        return SparseCones(
            self.solution_of(unknowns[members[is_kept]], kept_curvatures), math.sqrt(best.energy)
        )

    def solution_of(self, unknowns: IntArray, curvatures: FloatArray) -> ConeSolution:
        """Return the solution of cones at unknowns (s,) with given curvatures (s,), radians."""
        return self._linear.solution_of(self.operator.vertices[unknowns], curvatures)


def required_vertices(required: Iterable[int], is_boundary: BoolArray) -> IntArray:
    """Return the required cones as an array of vertices; raise OptionError if one is not valid."""
    cones = np.array(list(required), dtype=np.int64)
    bad = cones[(cones < 0) | (cones >= len(is_boundary))]
    if len(bad):
        raise OptionError(f"required cones are not vertices of the mesh: {list_some(bad)}")
    if len(np.unique(cones)) < len(cones):
        raise OptionError("a required cone is repeated")
    if is_boundary[cones].any():
        raise OptionError(f"required cones lie on the boundary: {list_some(cones[is_boundary[cones]])}")
    return cones
