"""Reports of the measures of a flattening: as plain values for programs, and as table rows for people.

`Distortion` declares the measures of a map. What is printed about them is declared here: `map_rows` has a row for each
of them, `FIRST_ROWS` names those that are always printed, `SUMMARY_MEASURES` the columns of summaries of many meshes.
Reports, requirements, archives, `coneflat measure` and the documentation follow from these.
"""

from __future__ import annotations

import math
import os
from dataclasses import MISSING, asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from ..base.text import plural
from .distortion import Distortion

if TYPE_CHECKING:
    from ..result import Flattening

#: The name of a measure, its value, and its meaning.
Row: TypeAlias = tuple[str, str, str]

# Arrays with a value for each triangle, which reports do not contain.
_PER_TRIANGLE = ("qc", "log_area_scale", "strain")
_MEASURES = [field for field in fields(Distortion) if field.name not in _PER_TRIANGLE]
#: Measures of any map of a mesh to the plane.
MAP_MEASURES = tuple(field.name for field in _MEASURES if field.default is MISSING)
#: Measures of a flattening: those that need to know its metric, which are unknown for other maps, and those of the map.
MEASURES = (*(field.name for field in _MEASURES if field.default is not MISSING), *MAP_MEASURES)
#: Numbers of the report that summaries of many meshes contain, as columns.
SUMMARY_MEASURES = (
    "vertices", "triangles", "cones", "curvature_error_max", "qc_mean", "qc_max", "area_std", "area_distortion",
    "flipped", "charts", "seam_length", "seam_mismatch_max", "rotation_deviation", "uv_scale",
)  # fmt: skip
#: The rows that commands always print, in this order; the others are printed if verbose.
FIRST_ROWS = (
    "charts", "overlap", "flipped", "texture", "texel density", "seam length", "QC distortion", "energy", "strain",
    "cones",
)  # fmt: skip


def as_dict(result: Flattening) -> dict[str, Any]:
    """Return all measures as plain Python values; numbers that are not finite become None, for valid JSON."""
    report: dict[str, Any] = {
        "input": path_text(result.source.path) if result.source else None,
        "vertices": len(result.vertices),
        "triangles": len(result.faces),
        "cones": len(result.cones),
        **{name: getattr(result.distortion, name) for name in MEASURES},
        **asdict(result.solve),
        "rotation_deviation": None if result.rotations is None else result.rotations.worst,
        "handle_deviations": None if result.rotations is None else result.rotations.handles,
        "packing_efficiency": result.packing_efficiency,
        "uv_scale": result.uv_scale,
        "cone_vertices": result.cones.tolist(),
        "cone_curvatures": result.curvatures.tolist(),
        "seconds": dict(result.seconds),
        "notes": list(map(str, result.notes)),
        "settings": dict(result.settings),
    }
    return {name: _plain(value) for name, value in report.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def path_text(path: Path) -> str:
    """Return a path as valid Unicode text; invalid bytes in its name are replaced."""
    return os.fsencode(path).decode("utf-8", "replace")


def _target_text(result: Flattening) -> str:
    """Return a phrase on the area distortion that the search for cones had to reach."""
    settings = result.settings
    if settings.get("cones") not in ("auto", "sparse"):
        return "not searched"
    if settings.get("cone_count") is not None:
        return "the least for this number of cones"
    return f"{settings['distortion']:g} allowed"


def _rotation_rows(result: Flattening) -> list[Row]:
    rotations = result.rotations
    if rotations is None:
        return []
    quantum = f"from multiples of {rotations.quantum / np.pi:.4g} pi, radians"
    rows = [("seam rotations", f"{rotations.worst:.1e}", f"largest deviation of a seam's rotation {quantum}")]
    if rotations.handles:
        handles = " ".join(f"{angle:+.1e}" for angle in rotations.handles[:6])
        omitted = f"; and {len(rotations.handles) - 6} more" if len(rotations.handles) > 6 else ""
        rows.append(("around handles", handles, f"the same along each generator{omitted}"))
    return rows


def number_text(value: float, form: str) -> str:
    """Return a number as text; "unknown" if it is not finite, such as the distortion of a triangle without area."""
    return f"{value:{form}}" if math.isfinite(value) else "unknown"


def as_rows(result: Flattening) -> list[Row]:
    """Return rows (measure, value, meaning) of the table that the commands print."""
    # Rows that do not describe the map itself, by the row of the map that they follow.
    further = {
        "energy": [_metric_row(result)],
        "charts": [packing_row(result.packing_efficiency), *_texture_rows(result)],
    }
    rows = [_mesh_row(result), _cone_row(result), _curvature_row(result.distortion)]
    for name, row in _solved_map_rows(result).items():
        rows += [row, *further.get(name, [])]
    return [*rows, *_rotation_rows(result)]


def _mesh_row(result: Flattening) -> Row:
    vertex_count = np.count_nonzero(np.bincount(result.faces.ravel()))
    return "triangles", f"{len(result.faces):,}", f"{vertex_count:,} vertices"


def _cone_row(result: Flattening) -> Row:
    count, curvatures = f"{len(result.cones)}", result.curvatures / np.pi
    if len(curvatures):
        count += f"  ({curvatures.min():+.3f} to {curvatures.max():+.3f} pi)"
    return "cones", count, "singular vertices and their curvatures"


def _curvature_row(d: Distortion) -> Row:
    error, largest = (
        f"{number_text(value, '.2e')} pi" for value in (d.curvature_error, d.curvature_error_max)
    )
    return "curvature error", error, f"||target - K|| / n; maximum {largest}"


def _metric_row(result: Flattening) -> Row:
    solve = result.solve
    linear = number_text(solve.area_distortion_linear, ".4f")
    meaning = f"area distortion of the metric; {linear} in the linear model: {_target_text(result)}"
    return "of the metric", number_text(solve.area_distortion, ".4f"), meaning


def _solved_map_rows(result: Flattening) -> dict[str, Row]:
    """Return the rows of the measures of the map, with what untangling and relaxing have changed."""
    rows, solve = map_rows(result.distortion), result.solve
    if solve.untangled_vertices:
        untangled = (
            f"flipped triangles; {solve.untangled_triangles:,} before "
            f"{plural(solve.untangled_vertices, 'vertex', 'vertices')} were moved by at most "
            f"{solve.untangled_move:.2g} edge lengths"
        )
        rows["flipped"] = (*rows["flipped"][:2], untangled)
    if solve.relaxed_vertices:
        moved = f"{plural(solve.relaxed_vertices, 'vertex', 'vertices')} moved"
        relaxed = f"; {moved} to reduce it"
        if np.isfinite(solve.qc_mean_unrelaxed):
            mean, largest = (
                number_text(solve.qc_mean_unrelaxed, ".4f"),
                number_text(solve.qc_max_unrelaxed, ".4g"),
            )
            relaxed = f"; before {moved} {mean}, maximum {largest}"
        name, value, meaning = rows["QC distortion"]
        rows["QC distortion"] = (name, value, meaning + relaxed)
    return rows


def map_rows(d: Distortion) -> dict[str, Row]:
    """Return the rows of the measures of a map by name, in the order of tables."""
    rows = (
        (
            "QC distortion",
            number_text(d.qc_mean, ".4f"),
            f"1 is conformal; p95 {number_text(d.qc_p95, '.4f')}, maximum {number_text(d.qc_max, '.4g')}",
        ),
        (
            "area distortion",
            number_text(d.area_std, ".4f"),
            "standard deviation of the log conformal factor, weighted by area",
        ),
        (
            "energy",
            number_text(d.energy, ".4f"),
            "symmetric Dirichlet energy, averaged by area; 4 is an isometry",
        ),
        (
            "strain",
            f"{number_text(100 * d.strain_max, '.3g')} %",
            "largest relative change of the length of an edge, at the scale where it is least; "
            f"mean {number_text(100 * d.strain_mean, '.3g')} %",
        ),
        ("flipped", f"{d.flipped:,}", "triangles with orientation opposite to their chart"),
        (
            "degenerate",
            f"{d.degenerate:,}",
            f"without area in the plane; {d.degenerate_input:,} without area on the model",
        ),
        (
            "overlap",
            f"{number_text(100 * d.overlap, '.3g')} %" if d.overlapping_pairs else "none",
            f"of the covered area is in several triangles; {plural(d.overlapping_pairs, 'pair')} of triangles overlap"
            if d.overlapping_pairs
            else "no two triangles overlap",
        ),
        ("charts", f"{d.charts:,}", f"UV islands; {d.mirrored_charts:,} mirrored"),
        (
            "texel density",
            number_text(d.density_spread, ".3f"),
            "spread: 95th percentile divided by 5th percentile",
        ),
        ("seam length", number_text(d.seam_length, ".3f"), "divided by the square root of the area"),
        (
            "seam mismatch",
            number_text(d.seam_mismatch, ".1e"),
            f"relative, of the lengths of both sides; maximum {number_text(d.seam_mismatch_max, '.1e')}",
        ),
    )
    return {row[0]: row for row in rows}


def _texture_rows(result: Flattening) -> list[Row]:
    """Return the row on the texture, if its size is known."""
    side = result.settings.get("resolution")
    if side is None:
        return []
    density = number_text(result.uv_scale * side, ".4g")
    return [("texture", f"{side:,}", f"texels per side; {density} per unit of length")]


def packing_row(efficiency: float, tiles: str = "") -> Row:
    """Return the row on the covered fraction of the texture; `tiles` names the tiles if there are several."""
    return "packing", number_text(efficiency, ".1%"), f"of the texture is covered{tiles}"
