"""What is measured of a pattern."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...measures import quantile
from .drawing.gaps import short_seams
from .result import Pattern
from .units import percentage, text_of_size

#: Numbers of the report, which `--require` takes.
PATTERN_MEASURES = (
    "pieces", "seams", "darts", "corner_cuts", "eased_seams", "ease_max", "seam_length", "strain_max", "strain_mean",
    "stretch_max", "stretch_p95", "short_seams", "piece_area_min",
    "area", "sheet_width", "sheet_height", "sheet_share", "pages", "millimetres_per_unit",
)  # fmt: skip


def report_of(pattern: Pattern) -> dict[str, Any]:
    """Return all measures of a pattern; see `Pattern.report`."""
    width, height = pattern.sheet_size
    strains, lengths = np.abs(pattern.strains), pattern.surface.edges.lengths
    stretches = np.abs(pattern.stretches)
    seams = [
        {
            "name": seam.name,
            "pieces": [side.piece + 1 for side in seam.sides],
            "lengths": list(seam.lengths),
            "surface_length": seam.surface_length,
            "ease": seam.ease if seam.is_eased else 0.0,
            "is_dart": seam.is_dart and pattern.is_sewn,
            "is_corner_cut": seam.is_dart and not pattern.is_sewn,
        }
        for seam in pattern.seams
    ]
    area = float(sum(shape.inside.area for shape in pattern.shapes))
    copies = pattern.counterparts
    return {
        "kind": pattern.kind,
        "pieces": pattern.piece_count,
        "seams": len(pattern.seams),
        "darts": len(pattern.darts),
        "corner_cuts": len(pattern.corner_cuts),
        "eased_seams": sum(seam.is_eased for seam in pattern.seams),
        "ease_max": max((seam.ease for seam in pattern.seams), default=0.0),
        "seam_length": pattern.surface.seam_length,
        "strain_max": float(strains.max()),
        "strain_mean": float(np.average(strains, weights=lengths)),
        "stretch_max": float(stretches.max()),
        "stretch_p95": quantile(stretches, pattern.surface.edges.double_areas, 0.95),
        "short_seams": len(short_seams(pattern.seams, pattern.finish)),
        "piece_area_min": min(shape.inside.area for shape in pattern.shapes),
        "area": area,
        "sheet_width": width,
        "sheet_height": height,
        "sheet_share": float(sum(shape.cut.area for shape in pattern.shapes)) / (width * height),
        "pages": len(pattern.tiles),
        "millimetres_per_unit": pattern.millimetres,
        "each_piece": [
            {
                "number": i + 1,
                "width": piece_width,
                "height": piece_height,
                "area": piece_area,
                "same_as": _number(copies.equal[i]),
                "mirror_image_of": _number(copies.mirrored[i]),
            }
            for i, (piece_width, piece_height, piece_area) in enumerate(piece_sizes(pattern))
        ],
        "each_seam": seams,
        "notes": [*pattern.notes, *pattern.drawing().notes],
        "settings": dict(pattern.settings),
    }


def _number(piece: int | None) -> int | None:
    return None if piece is None else piece + 1


def rows_of(pattern: Pattern, report: dict[str, Any] | None = None) -> list[tuple[str, str, str]]:
    """Return the rows (measure, value, meaning) of the table of measures.

    Args:
        pattern: the pattern.
        report: its report, if it has been computed already.
    """
    report = report_of(pattern) if report is None else report
    eased = f"sides of {report['eased_seams']} differ, by {report['ease_max']:.1f} mm at most"
    size = text_of_size(np.ptp(pattern.surface.mesh.vertices, axis=0))
    axis = np.array(pattern.settings.get("axis", (0.0, 0.0, 1.0)))
    along = " ".join(f"{number:.3g}" for number in axis)
    noun = "darts" if pattern.is_sewn else "corner cuts"
    return [
        ("size", size, f"of the finished object along x, y and z; its height is along {along}"),
        ("pieces", f"{report['pieces']}", f"{report['area'] / 100:.0f} cm\u00b2 in total"),
        (
            "seams",
            f"{report['seams'] - report['darts'] - report['corner_cuts']}",
            eased if report["eased_seams"] else "sides equally long" if report["seams"] else "",
        ),
        (noun, f"{report['darts'] + report['corner_cuts']}", "cuts that end inside a piece"),
        ("seam length", f"{report['seam_length']:.0f} mm", "on the model, darts included"),
        ("strain", percentage(report["strain_max"]), "largest relative change of the length of an edge"),
        (
            "stretch",
            percentage(report["stretch_p95"]),
            "in any direction inside triangles, 95 % of the area less",
        ),
        (
            "sheet",
            f"{report['sheet_width']:.0f} x {report['sheet_height']:.0f} mm",
            f"{100 * report['sheet_share']:.0f} % of it covered by pieces",
        ),
        ("pages", f"{report['pages']}", f"{pattern.paper.name}, without the assembly guide"),
    ]


def piece_sizes(pattern: Pattern) -> list[tuple[float, float, float]]:
    """Return the width and the height of each piece without allowances, mm, and its area, mm^2."""
    surface, sizes = pattern.surface, []
    corners = surface.places
    sides = corners[:, 1:] - corners[:, :1]
    areas = (sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) / 2
    for triangles in surface.triangles_of_pieces:
        width, height = np.ptp(corners[triangles].reshape(-1, 2), axis=0).tolist()
        sizes.append((width, height, float(areas[triangles].sum())))
    return sizes
