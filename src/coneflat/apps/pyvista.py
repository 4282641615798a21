"""The accessor `mesh.coneflat` of PyVista's surfaces, which PyVista imports by the entry point of this package."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista

from .. import Flattening, flatten, quads, unwrap
from ..base import inner_calls, warn_of

#: Where all notes are: PyVista's surfaces have no room for them.
NOTES = "`notes` of this warning"


@pyvista.register_dataset_accessor("coneflat", pyvista.PolyData)
class ConeflatAccessor:
    """Flattening of a PyVista surface; options are those of the functions of the same names.

    Examples:
        >>> sphere = pyvista.Sphere().coneflat.flatten()  # doctest: +SKIP
        >>> sphere.plot(texture=pyvista.examples.load_globe_texture())  # doctest: +SKIP
    """

    def __init__(self, mesh: pyvista.PolyData) -> None:
        self._mesh = mesh

    def flatten(self, **options: Any) -> pyvista.PolyData:
        """Return the surface with texture coordinates, by `coneflat.flatten`; points are repeated at seams.

        The data of its points and cells are kept; a polygon is several triangles.

        Raises:
            ConeflatError: as of `coneflat.flatten`.
        """
        with inner_calls():
            result = flatten(self._mesh, **options)
        warn_of(result.notes, NOTES)
        return self._with_data(result)

    def unwrap(self, **options: Any) -> pyvista.PolyData:
        """Return the surface with texture coordinates, by `coneflat.unwrap`; points are repeated at seams.

        Raises:
            ConeflatError: as of `coneflat.unwrap`.
        """
        with inner_calls():
            result = unwrap(self._mesh, **options)
        warn_of(result.notes, NOTES)
        return self._with_data(result)

    def quads(self, **options: Any) -> pyvista.PolyData:
        """Return a quad mesh of the surface, by `coneflat.quads`, without its data: points and faces are others.

        Raises:
            ConeflatError: as of `coneflat.quads`.
        """
        with inner_calls():
            mesh = quads(self._mesh, **options)
        warn_of(mesh.notes, NOTES)
        return pyvista.PolyData(mesh.vertices, np.insert(mesh.quads, 0, 4, axis=1).ravel())

    def _with_data(self, result: Flattening) -> pyvista.PolyData:
        """Return a result as a surface with the data of the input's points and cells; its measures are field data."""
        surface, cut = self._mesh, result.to_pyvista()
        vertex = np.asarray(result.vertex_origin)[cut.point_data["vertex"]]
        # A polygon of k corners becomes k - 2 triangles; the cells of a surface begin with its points and lines.
        sizes = np.diff(pyvista.convert_array(surface.GetPolys().GetOffsetsArray()))
        cell = (
            surface.n_verts
            + surface.n_lines
            + np.repeat(np.arange(len(sizes)), sizes - 2)[result.face_origin]
        )
        for source, target, at in (
            (surface.point_data, cut.point_data, vertex),
            (surface.cell_data, cut.cell_data, cell),
        ):
            target.update({name: np.asarray(source[name])[at] for name in source if name not in target})
        measures = ("qc_mean", "area_std", "flipped", "overlap", "charts")
        cut.field_data.update({name: [getattr(result.distortion, name)] for name in measures})
        return cut
