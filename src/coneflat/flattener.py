"""One mesh flattened again and again."""

from __future__ import annotations

from typing import Any

from numpy.typing import ArrayLike

from ._arrays import FloatArray
from .cones.choose import Surface
from .input.arrays import as_input
from .input.components import Source
from .input.symmetry import check_symmetry
from .kept import Last
from .mesh import TriangleMesh
from .options import Options, read_options
from .pipeline import Early, flatten_prepared
from .progress import Stages
from .result.flattening import Flattening
from .solver import fitting_solver


class Flattener:
    """Flattens one mesh again and again: what depends on it alone is found once, and kept.

    That is the checked mesh, its intrinsic Delaunay triangulation, its Laplacian, factorized, and the Green's functions
    of the cones used last. Results are those of `coneflat.flatten`, to the last bit. Other marked seams, a repair, or
    other lengths make another mesh of it, and what was kept goes. It serves one thread at a time.

        flattener = Flattener(vertices, faces)
        for curvature in (1.0, 1.5, 2.0):
            flattener.flatten(cones={7: curvature, 12: None, 80: None})

    Args:
        mesh, faces: as of `coneflat.flatten`; arrays must not change afterwards.

    Raises:
        MeshError: it is no mesh, or its file cannot be read.
    """

    def __init__(self, mesh: Any, faces: ArrayLike | None = None) -> None:
        self._source = Source(as_input(mesh, faces))
        self._surfaces: dict[tuple[int, bool], Surface] = {}
        self._solver: Last[str] = Last()
        self._solved_by: tuple[str, int] | None = None

    def flatten(self, *, early: Early | None = None, **options: Any) -> Flattening:
        """Return the flattening by the options, and with the errors, of `coneflat.flatten`.

        Args:
            early: called with the first layout that there is: one chart for each component, as the metric unfolds,
                before triangles are relaxed and overlaps parted; its own overlaps are not measured.
            options: those of `coneflat.flatten`.
        """
        return self.flatten_as(read_options(options), early)

    def flatten_as(self, options: Options, early: Early | None = None) -> Flattening:
        """Return the flattening by options that have been read; see `flatten`."""
        stages = Stages(options.progress)
        with stages("check"):
            prepared = self._source.prepared(options)
            check_symmetry(prepared.components, options)
        # Asked once, as what is kept is no longer free.
        count = len(prepared.checked.mesh.faces)
        solver = self._solver.of((count, options.solver), lambda: fitting_solver(count, options.solver))
        # Where anything else factorizes, the last digits are others.
        solved_by = solver, options.threads
        if solved_by != self._solved_by:
            self._surfaces, self._solved_by = {}, solved_by
        meshes = {id(part.mesh) for part in prepared.components}
        self._surfaces = {key: surface for key, surface in self._surfaces.items() if key[0] in meshes}
        try:
            return flatten_prepared(prepared, solver, self._surface, options, stages, early)
        finally:
            for surface in self._surfaces.values():
                surface.search = None

    def _surface(self, mesh: TriangleMesh, lengths: FloatArray, flips: bool) -> Surface:
        key = id(mesh), flips
        if key not in self._surfaces:
            self._surfaces[key] = Surface.of(mesh, lengths, flips)
            self._surfaces[key].is_kept = True
        return self._surfaces[key]
