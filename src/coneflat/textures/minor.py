"""Cuts of many small components, searched for all of them at once: as one mesh that is not connected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..base import BoolArray, FloatArray, IntArray, check_cancelled, is_time_up, part_of_work, within_time
from ..geometry import double_areas, find_overlaps, signed_double_areas
from ..linalg import factorize
from ..mesh import open_along, tie_key
from ..mesh.connectivity import TriangleMesh, joined_meshes
from ..optimise import StretchEnergy, embedded_disks, relax
from ..seams import TIE_BREAK, find_seams
from ..source import is_large
from ..stages import Surface
from .candidates import TOLERANCE, Candidate, CutModel
from .free_seams import laid_out
from .options import ENERGY_PER_AREA, ISOMETRIC
from .search import FIRST_DISTORTION

# Number of times that cones are added.
MAX_ROUNDS = 12
# Fraction of the work that is left, for the progress, that a round is.
ROUND_SHARE = 0.3


def is_searchable_together(model: CutModel) -> bool:
    """Return whether a component may be cut together with others."""
    return bool(
        model.bound.is_finite
        and not is_large(model.component)
        and not model.component.seams.is_forbidden.any()
    )


def cuts_together(models: Sequence[CutModel]) -> list[Candidate | None]:
    """Return a candidate for each component; None for components with an energy above the bound.

    The next cone of a component is where its log conformal factor is the largest, if it is zero at the cones so far, as
    in Section 3.2 of the paper. Cones are added until the energy is within the bound.

    Args:
        models: the components, with the same bound.
    """
    group = _MinorComponents(models)
    return group.candidates_from(group.first_cones())


@dataclass(frozen=True, eq=False)
class _Cut:
    """A cut of all components with n vertices and m faces, and their layout.

    Attributes:
        cones: (n,) the flagged cones.
        seams: (k,) the edges that are cut.
        places: (m, 3, 2) the corners in the plane.
    """

    cones: BoolArray
    seams: IntArray
    places: FloatArray


class _MinorComponents:
    """Components as one mesh of n vertices and m faces, with the candidates for cones of all of them.

    Args:
        models: the c components, with the same bound.
    """

    def __init__(self, models: Sequence[CutModel]) -> None:
        components = [model.component for model in models]
        self._models, self._bound = models, models[0].bound
        vertex_counts = [len(component.vertices) for component in components]
        self._component_of_face = np.arange(len(models)).repeat(
            [len(component.faces) for component in components]
        )
        self._component_of_vertex = np.arange(len(models)).repeat(vertex_counts)
        self._first_vertex = np.cumsum([0, *vertex_counts])
        self._first_edge = np.cumsum([0, *(len(component.mesh.edges) for component in components)])
        self._mesh = joined_meshes([component.mesh for component in components])
        sides = 3 * np.cumsum([0, *(len(component.faces) for component in components)])
        self._kept_holes = [
            first + hole
            for first, component in zip(sides.tolist(), components, strict=False)
            for hole in component.with_kept_holes().kept_holes
        ]
        self._lengths = np.concatenate([component.lengths for component in components])
        self._areas = double_areas(self._lengths) / 2
        self._costs = np.concatenate([model.seam_costs for model in models])
        self._is_avoided = np.concatenate([component.seams.is_avoided for component in components])
        self._is_allowed = np.concatenate([component.cones.is_allowed for component in components])
        self._is_allowed &= ~self._mesh.is_boundary_vertex
        self._tie_break = 1 + TIE_BREAK * tie_key(self._mesh.vertices)
        self._surface = Surface.of(self._mesh, self._lengths)

    def candidates_from(self, cones: BoolArray) -> list[Candidate | None]:
        """Return a candidate for each component whose cones include flagged ones (n,); None if above the bound."""
        bound, count = self._bound, len(self._models)
        first = max(FIRST_DISTORTION, (bound.allowed / ENERGY_PER_AREA) ** 0.5)
        cut = _Cut(cones, np.empty(0, dtype=np.int64), np.zeros((len(self._component_of_face), 3, 2)))
        energies, distortion = np.full(count, np.inf), np.full(count, first)
        for number in range(MAX_ROUNDS):
            is_open = energies > bound.largest
            if not is_open.any():
                break
            with part_of_work(ROUND_SHARE, f"round {number + 1}"):
                search = partial(self._cut_further, cut, is_open, distortion)
                result = within_time(search) if number else search()
            if result is None:
                break
            cut, distortion = result
            energies = self._energies(cut.places)
            # The energy above that of an isometry is about a multiple of the square of the distortion.
            above = np.maximum(energies, bound.largest) - ISOMETRIC
            distortion *= np.sqrt(np.clip(bound.allowed / above, 0.5, 0.98))
        return self._separate_candidates(cut, energies, distortion)

    def _cut_further(self, cut: _Cut, is_open: BoolArray, distortion: FloatArray) -> tuple[_Cut, FloatArray]:
        """Return a cut with more cones in open components (c,), and the distortions (c,) for given ones."""
        cones, distortion = self._with_more_cones(cut.cones, is_open, distortion)
        seams = find_seams(
            self._mesh, np.flatnonzero(cones), self._costs, self._is_avoided, kept_holes=self._kept_holes
        )
        disk = open_along(self._mesh, seams).mesh
        return _Cut(cones, seams, self._with_laid_out(disk, cut.places, is_open)), distortion

    def _separate_candidates(
        self, cut: _Cut, energies: FloatArray, distortion: FloatArray
    ) -> list[Candidate | None]:
        """Return the candidate of each component without overlaps; None if its energy is above the bound.

        If the time of the search is up, candidates above the bound are returned as well, unless they are flipped.

        Args:
            cut: the cut of all components.
            energies, distortion: (c,) of each component.
        """
        places, seams, cones = cut.places, cut.seams, np.flatnonzero(cut.cones)
        width = 2 * np.abs(places).max() * self._component_of_face
        pairs = find_overlaps(places + np.stack([width, 0 * width], axis=1)[:, None]).pairs
        overlapping = set(self._component_of_face[pairs[:, 0]].tolist())
        places_of = np.split(places, np.flatnonzero(np.diff(self._component_of_face)) + 1)
        seams_of = np.split(seams, np.searchsorted(seams, self._first_edge[1:-1]))
        cones_of = np.split(cones, np.searchsorted(cones, self._first_vertex[1:-1]))
        candidates = list[Candidate | None]()
        for i, model in enumerate(self._models):
            marks = seams_of[i] - self._first_edge[i], cones_of[i] - self._first_vertex[i]
            layout = laid_out(model.component.mesh, model.component.lengths, places_of[i], *marks)
            cost, is_separated = model.cost_of(layout), i not in overlapping
            candidate = Candidate(layout, float(energies[i]), cost, float(distortion[i]), is_separated)
            if not is_separated:
                separated = model.separated(candidate)
                candidate = within_time(partial(model.settled, separated)) or separated
            suffices = model.is_within(candidate) or (np.isfinite(energies[i]) and is_time_up())
            candidates.append(candidate if suffices else None)
        return candidates

    def _with_laid_out(self, disk: TriangleMesh, places: FloatArray, is_open: BoolArray) -> FloatArray:
        """Return the corners (m, 3, 2) in the plane with those of open components laid out with free seams.

        Args:
            disk: the mesh cut open.
            places: (m, 3, 2) the corners before.
            is_open: (c,) the components to lay out.
        """
        moved = np.flatnonzero(is_open[self._component_of_face])
        vertices, corners = np.unique(disk.faces[moved], return_inverse=True)
        mesh, lengths = TriangleMesh(disk.vertices[vertices], corners.reshape(-1, 3)), self._lengths[moved]
        start = embedded_disks(mesh, self._component_of_face[moved], self._areas[moved])
        relaxed = relax(mesh, start, mesh.faces, StretchEnergy(1.0), lengths=lengths, tolerance=TOLERANCE)
        places = places.copy()
        places[moved] = relaxed.points[mesh.faces]
        return places

    def _energies(self, places: FloatArray) -> FloatArray:
        """Return (c,) the energy of each component with corners (m, 3, 2); infinite with flipped triangles."""
        with np.errstate(all="ignore"):  # flipped triangles
            energies = self._bound.energies(self._lengths, places)
        energies[~(signed_double_areas(places) > 0)] = np.inf
        of = self._component_of_face
        return np.asarray(np.bincount(of, energies) / np.bincount(of, self._areas))

    def first_cones(self) -> BoolArray:
        """Return (n,) one vertex of each closed component."""
        curvature, cones = self._surface.curvature, np.zeros(len(self._component_of_vertex), dtype=bool)
        on_boundary = self._mesh.is_boundary_vertex
        is_closed = np.bincount(self._component_of_vertex, on_boundary, len(self._models)) == 0
        cones[self._largest(curvature - curvature.min() + 1, is_closed)] = True
        return cones

    def _with_more_cones(
        self, cones: BoolArray, is_open: BoolArray, allowed: FloatArray
    ) -> tuple[BoolArray, FloatArray]:
        """Return cones for which the area distortion of open components is at most a value, and the distortion.

        Args:
            cones: (n,) the cones so far.
            is_open: (c,) the components that get more.
            allowed: (c,) the area distortion allowed.
        """
        of, curvature = self._component_of_vertex, self._surface.curvature
        is_searched, reached = is_open.copy(), np.zeros(len(is_open))
        cones, share = cones.copy(), self._surface.areas / np.bincount(of, self._surface.areas)[of]
        while True:
            check_cancelled()
            is_zero = cones | self._mesh.is_boundary_vertex
            inner, phi = np.flatnonzero(~is_zero & is_searched[of]), np.zeros(len(of))
            phi[inner] = factorize(self._surface.laplacian[inner][:, inner]).solve(-curvature[inner])
            mean = np.bincount(of, share * phi)
            reached[is_searched] = np.sqrt(np.bincount(of, share * (phi - mean[of]) ** 2))[is_searched]
            is_searched &= reached > allowed
            chosen = self._largest(np.where(is_zero, 0.0, np.abs(phi)), is_searched)
            if not len(chosen):
                return cones, reached
            cones[chosen] = True

    def _largest(self, values: FloatArray, is_chosen: BoolArray) -> IntArray:
        """Return the allowed vertex with the largest value in each chosen component, if one is positive."""
        values = np.where(self._is_allowed, values, 0.0) * self._tie_break
        largest = np.lexsort((values, self._component_of_vertex))[self._first_vertex[1:] - 1]
        return np.asarray(largest[is_chosen & (values[largest] > 0)])
