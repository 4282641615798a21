"""Cuts of many small components, searched for all of them at once: as one mesh that is not connected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base import TYPED_TOLERANCE, BoolArray, FloatArray, IntArray, check_cancelled
from ..cones import MAX_POLYHEDRON_CORNERS
from ..geometry import double_areas, find_overlaps, signed_double_areas
from ..linalg import factorize
from ..mesh import open_along, tie_key
from ..mesh.connectivity import TriangleMesh
from ..optimise import StretchEnergy, embedded_disks, joined, relax
from ..seams import TIE_BREAK, find_seams
from ..stages import Surface
from .free_seams import laid_out
from .options import ENERGY_PER_AREA, ISOMETRIC
from .search import FIRST_DISTORTION, TOLERANCE, Candidate, CutSearch

# Number of times that cones are added.
MAX_ROUNDS = 12


class MinorComponents:
    """The search for the cuts of several components.

    The next cone of a component is where its log conformal factor is the largest, if it is zero at the cones so far, as
    in Section 3.2 of the paper. Cones are added until the energy is within the bound. A polyhedron with few corners is
    also opened at all of them, and the cheaper cut is taken.

    Args:
        searches: the searches of the components.
    """

    def __init__(self, searches: Sequence[CutSearch]) -> None:
        self._searches, components = searches, [search.component for search in searches]
        self._of_face = np.arange(len(components)).repeat([len(component.faces) for component in components])
        self._of = np.arange(len(components)).repeat([len(component.vertices) for component in components])
        self._first = np.cumsum([0, *(len(component.vertices) for component in components)])
        self._first_edge = np.cumsum([0, *(len(component.mesh.edges) for component in components)])
        self._mesh = joined([component.mesh for component in components], self._first)
        self._lengths = np.concatenate([component.lengths for component in components])
        self._areas = double_areas(self._lengths) / 2
        self._costs = np.concatenate([search.seam_costs for search in searches])
        self._is_avoided = np.concatenate([component.seams.is_avoided for component in components])
        self._is_allowed = np.concatenate([component.cones.is_allowed for component in components])
        self._is_allowed &= ~self._mesh.is_boundary_vertex
        self._tie_break = 1 + TIE_BREAK * tie_key(self._mesh.vertices)
        self._surface = Surface.of(self._mesh, self._lengths)

    def candidates(self) -> list[Candidate | None]:
        """Return a candidate for each component; None for components with an energy above the bound."""
        candidates = self._candidates_from(self._first_cones())
        has_few = np.flatnonzero(self._corners_per_component() > 0).tolist()
        polyhedra = [i for i in has_few if (one := candidates[i]) is None or len(one.layout.seams)]
        if polyhedra:
            opened = MinorComponents([self._searches[i] for i in polyhedra])
            for i, at_corners in zip(polyhedra, opened._candidates_from(opened._corners()), strict=True):
                searched = candidates[i]
                if at_corners is not None and (searched is None or at_corners.cost < searched.cost):
                    candidates[i] = at_corners
        return candidates

    def _candidates_from(self, cones: BoolArray) -> list[Candidate | None]:
        """Return a candidate for each component whose cones include the given ones (n,); None if above the bound."""
        bound, count = self._searches[0].max_energy, len(self._searches)
        first = max(FIRST_DISTORTION, ((bound - ISOMETRIC) / ENERGY_PER_AREA) ** 0.5)
        distortion, energies = np.full(count, first), np.full(count, np.inf)
        places = np.zeros((len(self._of_face), 3, 2))
        for _ in range(MAX_ROUNDS):
            is_open = energies > bound
            if not is_open.any():
                break
            cones, distortion = self._with_more_cones(cones, is_open, distortion)
            seams = find_seams(self._mesh, np.flatnonzero(cones), self._costs, self._is_avoided)
            energies = self._lay_out(open_along(self._mesh, seams).mesh, places, is_open)
            # The energy above that of an isometry is about a multiple of the square of the distortion.
            above = np.maximum(energies, bound) - ISOMETRIC
            distortion *= np.sqrt(np.clip((bound - ISOMETRIC) / above, 0.5, 0.98))
        width = 2 * np.abs(places).max() * self._of_face
        pairs = find_overlaps(places + np.stack([width, 0 * width], axis=1)[:, None]).pairs
        overlapping = set(self._of_face[pairs[:, 0]].tolist())
        vertices = np.flatnonzero(cones)
        own_places = np.split(places, np.flatnonzero(np.diff(self._of_face)) + 1)
        own_seams = np.split(seams, np.searchsorted(seams, self._first_edge[1:-1]))
        own_cones = np.split(vertices, np.searchsorted(vertices, self._first[1:-1]))
        found = list[Candidate | None]()
        for i, search in enumerate(self._searches):
            cut = own_seams[i] - self._first_edge[i], own_cones[i] - self._first[i]
            layout = laid_out(search.component.mesh, search.component.lengths, own_places[i], *cut)
            cost, alone = search.cost_of(layout), i not in overlapping
            one = Candidate(layout, float(energies[i]), cost, float(distortion[i]), is_separated=alone)
            one = one if alone else search.settled(search.separated(one))
            found.append(one if one.energy <= bound else None)
        return found

    def _lay_out(self, disk: TriangleMesh, places: FloatArray, is_open: BoolArray) -> FloatArray:
        """Change the corners (m, 3, 2) in the plane of open components, and return the energy of each component."""
        of, moved = self._of_face, np.flatnonzero(is_open[self._of_face])
        used, corners = np.unique(disk.faces[moved], return_inverse=True)
        some, lengths = TriangleMesh(disk.vertices[used], corners.reshape(-1, 3)), self._lengths[moved]
        points = embedded_disks(some, of[moved], self._areas[moved])
        found = relax(some, points, some.faces, StretchEnergy(1.0), lengths=lengths, tolerance=TOLERANCE)
        places[moved] = found.points[some.faces]
        with np.errstate(all="ignore"):  # flipped triangles
            energies = self._searches[0].energies_of(self._lengths, places)
        energies[~(signed_double_areas(places) > 0)] = np.inf
        return np.asarray(np.bincount(of, energies) / np.bincount(of, self._areas))

    def _first_cones(self) -> BoolArray:
        """Return (n,) one vertex of each closed component."""
        curvature, cones = self._surface.curvature, np.zeros(len(self._of), dtype=bool)
        is_closed = np.bincount(self._of, self._mesh.is_boundary_vertex, len(self._searches)) == 0
        cones[self._largest(curvature - curvature.min() + 1, is_closed)] = True
        return cones

    def _corners(self) -> BoolArray:
        """Return (n,) the vertices with curvature."""
        return (np.abs(self._surface.curvature) > TYPED_TOLERANCE) & self._is_allowed

    def _corners_per_component(self) -> IntArray:
        """Return the number of corners of each component, 0 if it is more than `MAX_POLYHEDRON_CORNERS`."""
        counts = np.bincount(self._of, self._corners(), len(self._searches)).astype(np.int64)
        return np.where(counts <= MAX_POLYHEDRON_CORNERS, counts, 0)

    def _with_more_cones(
        self, cones: BoolArray, is_open: BoolArray, allowed: FloatArray
    ) -> tuple[BoolArray, FloatArray]:
        """Return cones for which the area distortion of each open component is at most a value, and the distortion."""
        of, curvature = self._of, self._surface.curvature
        left, reached = is_open.copy(), np.zeros(len(is_open))
        cones, share = cones.copy(), self._surface.areas / np.bincount(of, self._surface.areas)[of]
        while True:
            check_cancelled()
            is_zero = cones | self._mesh.is_boundary_vertex
            inner, phi = np.flatnonzero(~is_zero & left[of]), np.zeros(len(of))
            phi[inner] = factorize(self._surface.laplacian[inner][:, inner]).solve(-curvature[inner])
            mean = np.bincount(of, share * phi)
            reached[left] = np.sqrt(np.bincount(of, share * (phi - mean[of]) ** 2))[left]
            left &= reached > allowed
            chosen = self._largest(np.where(is_zero, 0.0, np.abs(phi)), left)
            if not len(chosen):
                return cones, reached
            cones[chosen] = True

    def _largest(self, values: FloatArray, is_chosen: BoolArray) -> IntArray:
        """Return the allowed vertex with the largest value in each chosen component, if one is positive."""
        values = np.where(self._is_allowed, values, 0.0) * self._tie_break
        largest = np.lexsort((values, self._of))[self._first[1:] - 1]
        return np.asarray(largest[is_chosen & (values[largest] > 0)])
