"""Conformal flattening of triangle meshes with automatic cone singularities.

Names are imported on first use, so that `import coneflat` is fast.

Examples:
    Flatten a file. Every triangle corner gets a point in the plane:

    >>> import coneflat
    >>> result = coneflat.flatten(coneflat.sample_path())
    >>> result.uv[result.uv_faces].shape
    (10600, 3, 2)

    `PAPER` holds the options of the published method:

    >>> coneflat.PAPER["cones"], coneflat.PAPER["method"]
    ('greedy', 'linear')
    >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> coneflat.flatten(vertices, faces, **coneflat.PAPER).settings["method"]
    'linear'

    `__version__` is the version of the package as a string:

    >>> len(coneflat.__version__.split("."))
    3
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

# Module of each public name.
_HOMES = {
    "flatten": "flattener",
    "Flattener": "flattener",
    "Flattening": "result",
    "Distortion": "measures.distortion",
    "SeamData": "measures.seam_data",
    "PAPER": "options",
    "read_mesh": "io",
    "read_flattening": "io",
    "MeshFile": "io.mesh_file",
    "sample_path": "sample",
    "find_cones": "curves",
    "cone_curve": "curves",
    "ConeCurve": "curves",
    "check_mesh": "mesh.check",
    "TriangleMesh": "mesh.connectivity",
    "measure": "measures.distortion",
    "measure_uv": "apps.uv_measures",
    "pattern": "apps.patterns.making",
    "Pattern": "apps.patterns.result",
    "quads": "quadmesh.quad_meshing",
    "repack": "repacking",
    "unwrap": "textures.unwrapping",
    "QuadMesh": "quadmesh.quad_mesh",
    "measure_quads": "quadmesh.quality",
    "integer_grid": "quadmesh.quad_meshing",
    "IntegerGrid": "quadmesh.integer_map",
    "make_figure": "apps.view",
    "save_figure": "apps.view",
    "studio": "apps.studio.notebook",
    "ConeflatError": "errors",
    "GuaranteeWarning": "errors",
}

#: Modules by name: first those in `__all__`, then the packages for experts, whose functions can be called directly
#: and may change.
_MODULES = {"errors": "errors"}
_PACKAGES = (
    "atlas", "cones", "geometry", "io", "layout", "linalg", "mesh", "metric", "optimise", "options", "seams", "stages",
)  # fmt: skip

__all__ = [
    "ConeCurve",
    "ConeflatError",
    "Distortion",
    "Flattener",
    "Flattening",
    "GuaranteeWarning",
    "IntegerGrid",
    "MeshFile",
    "PAPER",
    "Pattern",
    "QuadMesh",
    "SeamData",
    "TriangleMesh",
    "__version__",
    "check_mesh",
    "cone_curve",
    "errors",
    "find_cones",
    "flatten",
    "integer_grid",
    "make_figure",
    "measure",
    "measure_quads",
    "measure_uv",
    "pattern",
    "quads",
    "read_flattening",
    "read_mesh",
    "repack",
    "sample_path",
    "save_figure",
    "studio",
    "unwrap",
]

if TYPE_CHECKING:
    from . import (  # noqa: F401
        atlas,
        cones,
        errors,
        geometry,
        io,
        layout,
        linalg,
        mesh,
        metric,
        optimise,
        options,
        seams,
        stages,
    )
    from .apps.patterns.making import pattern
    from .apps.patterns.result import Pattern
    from .apps.studio.notebook import studio
    from .apps.uv_measures import measure_uv
    from .apps.view import make_figure, save_figure
    from .curves import ConeCurve, cone_curve, find_cones
    from .errors import ConeflatError, GuaranteeWarning
    from .flattener import Flattener, flatten
    from .io import read_flattening, read_mesh
    from .io.mesh_file import MeshFile
    from .measures.distortion import Distortion, measure
    from .measures.seam_data import SeamData
    from .mesh.check import check_mesh
    from .mesh.connectivity import TriangleMesh
    from .options import PAPER
    from .quadmesh.integer_map import IntegerGrid
    from .quadmesh.quad_mesh import QuadMesh
    from .quadmesh.quad_meshing import integer_grid, quads
    from .quadmesh.quality import measure_quads
    from .repacking import repack
    from .result import Flattening
    from .sample import sample_path
    from .textures.unwrapping import unwrap


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return import_module("." + _MODULES[name], __name__)
    if name in _PACKAGES:
        return import_module("." + name, __name__)
    if name in _HOMES:
        return getattr(import_module("." + _HOMES[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
