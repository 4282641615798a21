"""Conformal flattening of triangle meshes with automatic cone singularities.

    >>> import coneflat
    >>> result = coneflat.flatten(vertices, faces)
    >>> result.uv[result.uv_faces]     # (m, 3, 2), a point of the plane for every triangle corner

Names are imported on first use, so that `import coneflat` takes no time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

_HOMES = {
    "flatten": "pipeline",
    "Flattener": "flattener",
    "Flattening": "result.flattening",
    "PAPER": "options",
    "read_mesh": "files",
    "read_flattening": "files",
    "MeshFile": "input.mesh_file",
    "sample_path": "sample",
    "cone_curve": "curve",
    "ConeCurve": "curve",
    "find_cones": "curve",
    "FoundCones": "curve",
    "ConeSearch": "cones.sparse",
    "SparseCones": "cones.sparse",
    "TriangleMesh": "mesh",
    "check_mesh": "input.validation",
    "CheckedMesh": "input.validation",
    "measure": "quality.distortion",
    "Distortion": "quality.distortion",
    "measure_uv": "result.measure_uv",
    "UVMeasures": "result.measure_uv",
    "edge_lengths": "geometry",
    "corner_angles": "geometry",
    "cotangents": "geometry",
    "angle_defect": "geometry",
    "cotangent_laplacian": "geometry",
    "mollify": "geometry",
    "greedy_cones": "cones",
    "cones_at": "cones",
    "cones_with_curvature": "cones",
    "ConeSolution": "cones",
    "scaled_lengths": "flat.linear",
    "find_seams": "seams",
    "edge_costs": "seams",
    "visible_share": "geometry.visibility",
    "cut_open": "seams",
    "CutMesh": "seams",
    "least_squares_layout": "layout",
    "ConeflatError": "errors",
    "pack_together": "result.together",
    "SeamData": "result.seam_data",
    "exact_metric": "flat.exact.metric",
    "ExactMetric": "flat.exact.metric",
    "unfold": "layout.unfold",
    "relax": "layout.relax",
    "Relaxed": "layout.relax",
    "StretchEnergy": "layout.relax",
    "PointConstraints": "layout.relax",
    "Lines": "layout.relax",
    "FlatTriangles": "geometry.straight",
    "flat_triangles": "geometry.straight",
    "integer_grid": "grid",
    "quads": "grid.quads",
    "QuadMesh": "grid",
    "measure_quads": "grid",
    "IntegerGrid": "grid",
    "find_overlaps": "geometry.overlap",
    "Overlaps": "geometry.overlap",
    "overlap_regions": "atlas",
    "pack_charts": "atlas",
    "Packed": "atlas",
    "studio": "apps.studio.notebook",
    "make_figure": "view",
    "save_figure": "view",
    "draw_layout": "view",
    "draw_checker": "view",
    "draw_quality": "view",
    "draw_quads": "view",
    "draw_cones": "view",
    "draw_curvature": "view",
    "draw_cone_curve": "view",
}

__all__ = [
    "CheckedMesh",
    "ConeCurve",
    "ConeSearch",
    "ConeSolution",
    "ConeflatError",
    "CutMesh",
    "Distortion",
    "ExactMetric",
    "FlatTriangles",
    "Flattener",
    "Flattening",
    "FoundCones",
    "IntegerGrid",
    "Lines",
    "MeshFile",
    "Overlaps",
    "PAPER",
    "Packed",
    "PointConstraints",
    "QuadMesh",
    "Relaxed",
    "SeamData",
    "SparseCones",
    "StretchEnergy",
    "TriangleMesh",
    "UVMeasures",
    "__version__",
    "angle_defect",
    "check_mesh",
    "cone_curve",
    "cones_at",
    "cones_with_curvature",
    "corner_angles",
    "cotangent_laplacian",
    "cotangents",
    "cut_open",
    "draw_checker",
    "draw_cone_curve",
    "draw_cones",
    "draw_curvature",
    "draw_layout",
    "draw_quality",
    "draw_quads",
    "edge_costs",
    "edge_lengths",
    "errors",
    "exact_metric",
    "find_cones",
    "find_overlaps",
    "find_seams",
    "flat_triangles",
    "flatten",
    "greedy_cones",
    "integer_grid",
    "least_squares_layout",
    "make_figure",
    "measure",
    "measure_quads",
    "measure_uv",
    "mollify",
    "overlap_regions",
    "pack_charts",
    "pack_together",
    "quads",
    "read_flattening",
    "read_mesh",
    "relax",
    "sample_path",
    "save_figure",
    "scaled_lengths",
    "studio",
    "unfold",
    "visible_share",
]

if TYPE_CHECKING:
    from . import errors
    from .apps.studio.notebook import studio
    from .atlas import Packed, overlap_regions, pack_charts
    from .cones import ConeSolution, cones_at, cones_with_curvature, greedy_cones
    from .cones.sparse import ConeSearch, SparseCones
    from .curve import ConeCurve, FoundCones, cone_curve, find_cones
    from .errors import ConeflatError
    from .files import read_flattening, read_mesh
    from .flat.exact.metric import ExactMetric, exact_metric
    from .flat.linear import scaled_lengths
    from .flattener import Flattener
    from .geometry import angle_defect, corner_angles, cotangent_laplacian, cotangents, edge_lengths, mollify
    from .geometry.overlap import Overlaps, find_overlaps
    from .geometry.straight import FlatTriangles, flat_triangles
    from .geometry.visibility import visible_share
    from .grid import IntegerGrid, QuadMesh, integer_grid, measure_quads
    from .grid.quads import quads
    from .input.mesh_file import MeshFile
    from .input.validation import CheckedMesh, check_mesh
    from .layout import least_squares_layout
    from .layout.relax import Lines, PointConstraints, Relaxed, StretchEnergy, relax
    from .layout.unfold import unfold
    from .mesh import TriangleMesh
    from .options import PAPER
    from .pipeline import flatten
    from .quality.distortion import Distortion, measure
    from .result.flattening import Flattening
    from .result.measure_uv import UVMeasures, measure_uv
    from .result.seam_data import SeamData
    from .result.together import pack_together
    from .sample import sample_path
    from .seams import CutMesh, cut_open, edge_costs, find_seams
    from .view import (
        draw_checker,
        draw_cone_curve,
        draw_cones,
        draw_curvature,
        draw_layout,
        draw_quads,
        draw_quality,
        make_figure,
        save_figure,
    )


def __getattr__(name: str) -> Any:
    if name == "errors":
        return import_module(".errors", __name__)
    if name in _HOMES:
        return getattr(import_module("." + _HOMES[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
