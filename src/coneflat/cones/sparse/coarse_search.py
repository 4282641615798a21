"""The search for cones on a coarse mesh of a large one, from which the search on the large mesh starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...base.arrays import BoolArray, FloatArray, IntArray, mask_of
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
from .dense_model import BestSets, ConeSet
from .fine_model import FineModel
from .linear_model import LinearModel
from .search import ConeSearch
from .starts import DenseStarts

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

    def starts(self, fine: FineModel) -> CoarseStarts:
        """Return the sets of cones on the coarse mesh for the required cones, usable vertices and limits of a model.

        Raises:
            CurvatureError: cones at the usable vertices cannot absorb the curvature.
        """
        operator = self.linear.operator
        clusters = operator.unknowns_of(self.clusters[fine.operator.vertices])
        places = fine.operator.unknowns_of(self.vertices[operator.vertices])
        is_usable = fine.fitness[places] > 0
        # A vertex that cannot be a cone is represented by the fittest one of its cluster.
        others = np.flatnonzero((fine.fitness > 0) & (clusters >= 0) & ~is_usable[clusters])
        fittest = others[np.argsort(-fine.fitness[others], kind="stable")]
        replaced, first = np.unique(clusters[fittest], return_index=True)
        required = clusters[fine.unknowns[fine.fixed]]
        replaced, first = replaced[~np.isin(replaced, required)], first[~np.isin(replaced, required)]
        places[replaced] = fittest[first]
        is_usable[replaced] = True
        model = FineModel(self.linear, required, fine.limits, fine.lower_bounds[places])
        usable, starts_of = (
            mask_of(len(self.vertices), operator.vertices[is_usable]),
            partial(DenseStarts, self.linear.coarse),
        )
        return CoarseStarts(ConeSearch(self.linear, model, usable, starts_of), places)


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

    def find_fewest(self, goal: float, max_count: int) -> None:
        """Find sets of all sizes up to slightly more than E^2 <= goal needs."""
        self._search.fewest(math.sqrt(goal), max_count)

    def find_best(self, count: int) -> None:
        """Find sets of about `count` cones."""
        self._search.best_of(count)

    def find_all(self, max_count: int) -> None:
        """Find sets of all sizes up to `max_count`."""
        self._search.curve(max_count)
