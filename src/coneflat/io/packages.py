"""Results as meshes of other packages, which are imported when they are asked for."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import OptionError
from .split import split_at_seams

if TYPE_CHECKING:
    from ..result import Flattening


def to_trimesh(result: Flattening) -> Any:
    """Return a `trimesh.Trimesh`; see `Flattening.to_trimesh`."""
    trimesh = _imported("trimesh", "trimesh")
    split = split_at_seams(result)
    return trimesh.Trimesh(
        split.vertices,
        split.faces,
        visual=trimesh.visual.TextureVisuals(uv=split.uv),
        vertex_attributes={"vertex": split.own},
        face_attributes={"chart": result.seam_data.face_chart},
        process=False,
    )


def to_pyvista(result: Flattening) -> Any:
    """Return a `pyvista.PolyData`; see `Flattening.to_pyvista`."""
    pyvista = _imported("pyvista", "PyVista")
    split = split_at_seams(result)
    # Before each triangle stands its number of corners.
    padded = np.insert(split.faces, 0, 3, axis=1)
    mesh = pyvista.PolyData(split.vertices, padded.ravel())
    mesh.point_data["vertex"] = split.own
    mesh.cell_data["chart"] = result.seam_data.face_chart
    mesh.active_texture_coordinates = split.uv
    return mesh


def to_meshio(result: Flattening) -> Any:
    """Return a `meshio.Mesh`; see `Flattening.to_meshio`."""
    meshio = _imported("meshio", "meshio")
    split = split_at_seams(result)
    return meshio.Mesh(
        split.vertices,
        [("triangle", split.faces)],
        # The name by which meshio itself reads and writes them.
        point_data={"obj:vt": split.uv, "vertex": split.own},
        cell_data={"chart": [result.seam_data.face_chart]},
    )


def _imported(module: str, name: str) -> Any:
    try:
        return import_module(module)
    except ImportError as error:
        raise OptionError(f"meshes of {name} need {name}: pip install {module}") from error
