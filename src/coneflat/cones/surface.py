"""A surface on which cones are placed, with a cache of what repeated searches share."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ..base.threads import MEMORY_BOUND_TRIANGLES, concurrently
from ..geometry import edge_lengths
from ..geometry.operators import weighted_areas
from ..mesh.ties import mesh_tie_key
from ..stages import ConeSpec, Surface
from .sparse.coarse_search import CoarseSurface
from .sparse.limits import largest_cone_angles
from .sparse.linear_model import LinearModel
from .sparse.search import ConeSearch, required_vertices
from .sparse.starts import StartsOf

# Number of triangles up to which a search on a coarse mesh first takes no less time.
MAX_WITHOUT_COARSE_MESH = 20_000
# Mean difference, relative to the mean, up to which lengths are those of the positions: thin triangles are widened.
MAX_LENGTH_ERROR = 1e-2


@dataclass(eq=False)
class ConeSurface(Surface):
    """A surface on which cones are placed; it caches its latest linear model and its search for cones.

    The search is cached until `close_search`: if it fails because triangles cannot realise the angle of a cone, the
    next one forbids the vertex and shares the Green's functions. Sets of cones that were found for the same vertices
    are reused, so that results depend on earlier searches.

        surface = ConeSurface.of(mesh, lengths)
        find_cones(surface, spec)
    """

    _linear: LinearModel | None = field(default=None, init=False, repr=False)
    _search: ConeSearch | None = field(default=None, init=False, repr=False)

    def linear_model(self, spec: ConeSpec) -> LinearModel:
        """Return the linear model of cones at vertices that do not absorb curvature, with the weights of `spec` in E.

        The latest model is cached, since its factorization is valid for other weights, too; not on a huge mesh that is
        used once.
        """
        share, absorbs = weighted_areas(self.areas, spec.weights), spec.absorbs_curvature
        linear = self._linear
        if linear is not None and np.array_equal(linear.is_boundary, absorbs):
            linear = linear.with_weights(share)
        else:
            key = mesh_tie_key(self.mesh)
            linear = LinearModel.of(self.laplacian, self.curvature, share, absorbs, key)
        if self.is_reused or len(self.mesh.faces) <= MEMORY_BOUND_TRIANGLES:
            self._linear = linear
        return linear

    def search(self, spec: ConeSpec) -> ConeSearch:
        """Return a search for cones; the cached one is reused, restricted to the allowed vertices.

        Apart from these, distortion and count, `spec` must not change until the search is closed.

        Raises:
            CurvatureError: no cones at the allowed vertices have the sum of curvatures of the surface.
        """
        if self._search is not None:
            self._search = self._search.restricted(spec.is_allowed)
            return self._search
        mesh, linear = self.mesh, self.linear_model(spec)
        search = ConeSearch.of(
            linear,
            mesh.euler_characteristic,
            # A boundary corner of angle a has the curvature pi - a; inner cones use the same bound of curvature.
            min_cone_angle=spec.min_angle + (np.pi if spec.searches_corners else 0.0),
            max_cone_angle=spec.max_angle,
            positive_only=spec.positive_only,
            required=spec.required,
            allowed=spec.is_allowed,
            max_angles=largest_cone_angles(mesh, self.widest),
            starts_of=self._starts(linear, spec),
        )
        if len(mesh.faces) <= MEMORY_BOUND_TRIANGLES:  # else it would use too much memory
            self._search = search
        return search

    def _starts(self, linear: LinearModel, spec: ConeSpec) -> StartsOf | None:
        """Return what gives the sets of cones on a coarse mesh; None if the mesh needs none.

        The mesh needs none if it is small. Lengths that are not distances of its vertices do not fit a coarse mesh.
        """
        count = len(self.mesh.faces)
        if count <= MAX_WITHOUT_COARSE_MESH:
            return None
        distances = edge_lengths(self.mesh.vertices, self.mesh.faces)
        if np.abs(self.lengths - distances).mean() > MAX_LENGTH_ERROR * distances.mean():
            return None
        share, required = (
            weighted_areas(self.areas, spec.weights),
            required_vertices(spec.required, linear.is_boundary),
        )
        with concurrently(
            partial(CoarseSurface.of, self.mesh, share, linear.is_boundary, required), count
        ) as making:
            linear.operator.factorize()
            return making.result().starts

    def close_search(self) -> None:
        """Delete the cached search, which uses much memory and whose results later searches would reuse."""
        self._search = None
