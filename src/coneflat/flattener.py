"""Repeated flattening of one mesh with cached operators."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from .base.arrays import FloatArray
from .base.notes import warns
from .cones import ConeSurface
from .flattening import Preview, flatten_source
from .io.packages import as_input
from .mesh.connectivity import TriangleMesh
from .options import Options, read_options
from .result import Flattening
from .source.parts import Source


class Flattener:
    """Flattens one mesh repeatedly and caches everything that depends on the mesh alone.

    The cache holds the checked mesh, its intrinsic Delaunay triangulation, its factorized Laplacian, and the Green's
    functions of the cones used last. Results are bitwise equal to those of `coneflat.flatten`. Other marked seams,
    other lengths or a different repair change the mesh and clear the cache. An object is not thread-safe.

        flattener = Flattener(vertices, faces)
        for curvature in (1.0, 1.5, 2.0):
            flattener.flatten(cones={7: curvature, 12: None, 80: None})

    Args:
        mesh, faces: as for `coneflat.flatten`; arrays must not be modified afterwards.

    Raises:
        MeshError: the input is not a mesh.
        MeshFileError: its file cannot be read.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> flattener = coneflat.Flattener(vertices, faces)
        >>> [len(flattener.flatten(cones=cones).cones) for cones in ([0, 1, 2], [0, 1, 2, 3])]
        [3, 4]
    """

    def __init__(self, mesh: Any, faces: ArrayLike | None = None) -> None:
        self._source = Source(as_input(mesh, faces))
        self._surfaces: dict[tuple[int, bool], ConeSurface] = {}
        self._threads: int | None = None

    @warns()
    def flatten(self, *, on_preview: Preview | None = None, **options: Any) -> Flattening:
        """Return the flattening for the given options.

        Args:
            on_preview: called with the first layout: one chart per part, before triangles are relaxed and overlaps
                are separated; its overlaps are not measured.
            options: those of `coneflat.flatten`.

        Raises:
            ConeflatError: as for `coneflat.flatten`.
        """
        return self.flatten_as(read_options(options), on_preview)

    @warns()
    def flatten_as(self, options: Options, on_preview: Preview | None = None) -> Flattening:
        """Return the flattening for parsed options; see `flatten`.

        Args:
            options: parsed options.
            on_preview: called with an early result, if given.
        """
        # The last digits of cached values depend on the number of threads.
        if options.threads != self._threads:
            self._surfaces, self._threads = {}, options.threads
        meshes = {id(part.mesh) for part in self._source.prepared(options).parts}
        self._surfaces = {key: surface for key, surface in self._surfaces.items() if key[0] in meshes}
        try:
            return flatten_source(self._source, options, self._surface, on_preview=on_preview)
        finally:
            self._close_searches()

    def _surface(self, mesh: TriangleMesh, lengths: FloatArray, flips: bool) -> ConeSurface:
        self._close_searches()
        key = id(mesh), flips
        if key not in self._surfaces:
            self._surfaces[key] = ConeSurface.of(mesh, lengths, flips)
            self._surfaces[key].is_reused = True
        return self._surfaces[key]

    def _close_searches(self) -> None:
        """Delete the searches for cones: the sets that they found must not affect later results."""
        for surface in self._surfaces.values():
            surface.close_search()
