"""The search for cones on a coarse mesh of a large one, from which the search on the large mesh starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray, mask_of
from ...errors import CurvatureError
from ...geometry import (
    angle_defect,
    coarse_mesh,
    corner_angles,
    cotangent_laplacian,
    cotangents,
    edge_lengths,
    mollify,
)
from ...mesh.connectivity import TriangleMesh
from ...mesh.ties import mesh_tie_key
from .dense_model import STALL_FACTOR, BestSets, ConeSet
from .fine_model import FineModel
from .linear_model import LinearModel
from .search import ConeSearch
from .starts import DenseStarts, Starts

# Number of triangles of the coarse mesh, and of unknowns of its own coarse basis. E of cones there differs by 2% from
# that on the mesh. With fewer unknowns, more cones are found; with more, the search takes longer.
COARSE_TRIANGLES, COARSE_UNKNOWNS = 4_000, 750


@dataclass(frozen=True, eq=False)
class CoarseSurface:
    """A coarse mesh of a surface.

    Attributes:
        linear: its linear model; the weight of a vertex in E is that of its cluster.
        vertices: (k,) the vertex of the surface for each of its vertices.
        clusters: (n,) its vertex that each vertex of the surface has collapsed to.
    """

    linear: LinearModel
    vertices: IntArray
    clusters: IntArray

    @classmethod
    def of(
        cls, mesh: TriangleMesh, share: FloatArray, is_boundary: BoolArray, required: IntArray
    ) -> CoarseSurface:
        """Return a coarse mesh of a connected mesh.

        Args:
            mesh: the mesh.
            share: (n,) weight of each vertex in E; the sum is 1.
            is_boundary: (n,) vertices that absorb curvature.
            required: (s,) vertices that are always cones; the coarse mesh keeps them.
        """
        coarse = coarse_mesh(mesh, COARSE_TRIANGLES, required)
        faces, size = coarse.mesh.faces, len(coarse.vertices)
        lengths = mollify(edge_lengths(coarse.mesh.vertices, faces), coarse.mesh)[0]
        linear = LinearModel.of(
            cotangent_laplacian(faces, cotangents(lengths), size),
            angle_defect(faces, corner_angles(lengths), coarse.mesh.is_boundary_vertex),
            np.bincount(coarse.clusters, weights=share, minlength=size).astype(np.float64),
            is_boundary[coarse.vertices],
            mesh_tie_key(mesh)[coarse.vertices],
            COARSE_UNKNOWNS,
        )
        return cls(linear, coarse.vertices, coarse.clusters)

    def starts(self, fine: FineModel) -> Starts:
        """Return the sets of cones on the coarse mesh for the required cones, usable vertices and limits of a model.

        If too few clusters have a usable vertex, they are sets on the coarse basis of the model.
        """
        places, is_usable = self._representatives(fine)
        operator = self.linear.operator
        required = operator.unknowns_of(self.clusters[fine.operator.vertices[fine.unknowns[fine.fixed]]])
        model = FineModel(self.linear, required, fine.limits, fine.lower_bounds[places])
        usable = mask_of(len(self.vertices), operator.vertices[is_usable])
        try:
            search = ConeSearch(self.linear, model, usable, partial(DenseStarts, self.linear.coarse))
        except CurvatureError:
            return DenseStarts(fine.linear.coarse, fine)
        return CoarseStarts(search, places)

    def _representatives(self, fine: FineModel) -> tuple[IntArray, BoolArray]:
        """Return (f,) the unknown of a model for each unknown here, and (f,) whether it may be a further cone.

        If the vertex that the coarse mesh has kept may not, and is no cone, it is the fittest of its cluster.
        """
        operator, fitness = self.linear.operator, fine.fitness
        clusters = operator.unknowns_of(self.clusters[fine.operator.vertices])
        places = fine.operator.unknowns_of(self.vertices[operator.vertices])
        is_open = fitness[places] == 0
        is_open[clusters[fine.unknowns[fine.fixed]]] = False
        candidates = np.flatnonzero((fitness > 0) & (clusters >= 0) & is_open[clusters])
        fittest = candidates[np.argsort(-fitness[candidates], kind="stable")]
        represented, first = np.unique(clusters[fittest], return_index=True)
        places[represented] = fittest[first]
        return places, fitness[places] > 0


class CoarseStarts:
    """Sets of cones on a coarse mesh."""

    error = 1.1

    def __init__(self, search: ConeSearch, places: IntArray) -> None:
        """Start from the sets of a search on the coarse mesh; places (f,) are the unknowns of the mesh for its own."""
        self._search, self._places = search, places

    @property
    def largest(self) -> int:
        """The largest number of cones."""
        return self._search.max_cones

    @property
    def best(self) -> BestSets[ConeSet]:
        """The best sets found."""
        return self._search.fine.best

    def unknowns(self, size: int) -> IntArray:
        """Return the unknowns (s,) of the mesh for the best set of a size, required cones first."""
        return self._places[self._search.fine.unknowns[self.best[size].members]]

    def find_fewest(self, goal: float, max_count: int) -> ConeSet:
        """Return the fewest cones with E^2 <= goal, or the fewest that are nearly as good as the best set."""
        self._search.fewest(math.sqrt(goal), max_count)
        cones = self.best.fewest(goal, max_count)
        return cones if cones.energy <= goal else self.best.fewest(cones.energy / STALL_FACTOR, max_count)

    def find_best(self, count: int) -> None:
        """Find sets of about `count` cones."""
        self._search.best_of(count)

    def find_all(self, max_count: int) -> None:
        """Find sets of all sizes up to `max_count`."""
        self._search.curve(max_count)
