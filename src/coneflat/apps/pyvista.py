"""The accessor `mesh.coneflat` of PyVista's surfaces, which PyVista imports by the entry point of this package."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista

from .. import Flattening, flatten, quads, unwrap


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

        Raises:
            ConeflatError: as of `coneflat.flatten`.
        """
        return self._with_data(flatten(self._mesh, **options))

    def unwrap(self, **options: Any) -> pyvista.PolyData:
        """Return the surface with texture coordinates, by `coneflat.unwrap`; points are repeated at seams.

        Raises:
            ConeflatError: as of `coneflat.unwrap`.
        """
        return self._with_data(unwrap(self._mesh, **options))

    def quads(self, **options: Any) -> pyvista.PolyData:
        """Return a quad mesh of the surface, by `coneflat.quads`.

        Raises:
            ConeflatError: as of `coneflat.quads`.
        """
        found = quads(self._mesh, **options)
        return pyvista.PolyData(found.vertices, np.insert(found.quads, 0, 4, axis=1).ravel())

    def _with_data(self, result: Flattening) -> pyvista.PolyData:
        """Return a result as a surface, with the point data of the input, and its measures as field data."""
        mesh = result.to_pyvista()
        own = np.asarray(mesh.point_data["vertex"])
        origin = own if result.vertex_origin is None else result.vertex_origin[own]
        for name, values in self._mesh.point_data.items():
            if name not in mesh.point_data:
                mesh.point_data[name] = np.asarray(values)[origin]
        for name in ("qc_mean", "area_std", "flipped", "overlap", "charts"):
            mesh.field_data[name] = [getattr(result.distortion, name)]
        return mesh
