"""Outputs of the studio in addition to layouts: files, quads, curves of distortion, and meshes without a layout."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from io import BytesIO
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import Flattening, TriangleMesh, check_mesh
from ...base import MAX_CONES
from ...errors import MeshError, StudioError
from ...io import Joined, as_input, as_stored, as_written, write_stream
from ...mesh import REPAIR_ADVICE, CheckedMesh, end_corners
from ...options import as_integer
from ..view import outline_halfedges, shown_rows
from .choices import Choices

if TYPE_CHECKING:
    from ...quadmesh import QuadMesh

#: The format whose measures are shown.
SHOWN_FORMAT = ".obj"
#: Measures of saved files that are compared with those shown; others differ in rounding.
COMPARED = ("flipped", "overlap", "QC distortion", "energy")
#: File formats of quads.
QUAD_FORMATS = (".obj", ".ply", ".glb")
MAX_QUADS = 1_000_000
#: Options that apply to curves, and those that apply to quads.
CURVE_OPTIONS = (
    "required_cones", "forbidden_cones", "weights", "seams", "no_seams", "sharp_angle", "repair",
)  # fmt: skip
QUAD_OPTIONS = ("forbidden_cones", "weights", "sharp_angle", "stretch", "repair")

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class SavedFile:
    """A file of a result.

    Attributes:
        content: its bytes.
        notes: sentences on what the file does not keep, and on measures that differ from those shown.
    """

    content: bytes
    notes: tuple[str, ...] = ()


def result_file(result: Flattening | None, ending: str) -> SavedFile:
    """Return a file of a result; ending: one of `RESULT_FILES`.

    Raises:
        StudioError: there is no result.
    """
    if result is None:
        raise StudioError("there is nothing to save: the last change could not be flattened")
    file = RESULT_FILES[ending]
    saved = file.save(result, ending)
    return replace(saved, notes=tuple(f"{file.label}: {note}" for note in saved.notes))


def as_shown(result: Flattening) -> Flattening:
    """Return a result with the measures that are shown: those of an OBJ, the one format that keeps polygons."""
    return as_stored(result, SHOWN_FORMAT)


def _mesh_file(result: Flattening, ending: str) -> SavedFile:
    """Return a mesh file with the UVs."""
    stream = BytesIO()
    stored = as_written(write_stream(result, stream, ending), ending)
    shown = as_shown(result)
    told = {*result.notes, *shown.notes}
    notes = (note for note in stored.notes if note not in told)
    return SavedFile(stream.getvalue(), (*differing_measures(shown, stored), *notes))


def differing_measures(shown: Flattening, stored: Flattening) -> tuple[str, ...]:
    """Return a sentence on the measures of a file whose texts differ from those shown, or nothing."""
    before, after = ({name: value for name, value, _ in shown_rows(result)} for result in (shown, stored))
    differing = [
        f"{name} {after[name]}, shown {before[name]}"
        for name in COMPARED
        if name in before and name in after and before[name] != after[name]
    ]
    if not differing:
        return ()
    return (f"the measures of the file differ from those shown: {'; '.join(differing)}.",)


def _layout_picture(result: Flattening, ending: str) -> SavedFile:
    """Return a picture of the layout."""
    from ..view import make_figure, write_figure

    stream = BytesIO()
    write_figure(make_figure(result, "layout"), stream, ending)
    return SavedFile(stream.getvalue())


def _layout_svg(result: Flattening, _: str) -> SavedFile:
    return SavedFile(layout_svg(result).encode("utf-8"))


def _report(result: Flattening, _: str) -> SavedFile:
    """Return the report of the measures that are shown."""
    return SavedFile((json.dumps(as_shown(result).report(), indent=2) + "\n").encode("utf-8"))


def quads_job(count: object) -> dict[str, Any]:
    """Return a job of the worker that computes approximately `count` quads.

    Raises:
        OptionError: the number is not an integer.
        StudioError: it is not within the bounds.
    """
    number = as_integer("the number of quads", count)
    if not 1 <= number <= MAX_QUADS:
        raise StudioError(f"the number of quads must be from 1 to {MAX_QUADS:,}, got {number:,}")
    return {"do": "quads", "count": number}


def quads_of(source: Joined, choices: Choices, count: int, report: Progress) -> QuadMesh:
    """Return quads of a mesh.

    Quads have their own cones, with curvatures that are multiples of 90 degrees. The choices that apply are forbidden
    cones, importance, sharp edges, the trade-off between angles and areas, and a straight boundary.

    Args:
        source: the mesh.
        choices: the choices of the user.
        count: approximate number of quads.
        report: called like `progress` of `coneflat.flatten`.
    """
    from ... import quads

    words = choices.with_search().keywords()
    options = {name: words[name] for name in QUAD_OPTIONS if name in words}
    if words.get("boundary") == "straight":
        options["boundary"] = "straight"
    quad_mesh = quads(source.mesh, quads=count, progress=report, **source.map_options(options))
    return replace(quad_mesh, notes=source.all_notes(quad_mesh.notes))


def quad_notes(quad_mesh: QuadMesh) -> tuple[str, ...]:
    """Return the notes on quads as sentences among those on the result."""
    return tuple(f"Quads: {note}" for note in quad_mesh.notes)


def quads_file(quad_mesh: QuadMesh | None, ending: str) -> SavedFile:
    """Return a file of quads; ending: one of `QUAD_FORMATS`.

    Raises:
        StudioError: there are no quads.
    """
    from ...quadmesh import write_quads_stream

    if quad_mesh is None:
        raise StudioError("there are no quads to save: compute them first")
    stream = BytesIO()
    write_quads_stream(quad_mesh, stream, ending)
    return SavedFile(stream.getvalue(), quad_notes(quad_mesh))


def curve_data(source: Joined, choices: Choices, report: Progress) -> dict[str, Any]:
    """Return the least distortion found for each number of cones, locked ones included, as values for JSON.

    It is the distortion of the whole mesh with this number of cones in each part: components, and regions between
    marked seams.
    """
    from ...curves import whole_curve
    from ...options import read_options

    words = curve_options(choices)
    n = max(MAX_CONES, len(words.get("required_cones", ())) + 12)  # A dozen of them are free.
    cone_curve = whole_curve(
        source.mesh, read_options({**source.map_options(words), "cone_count": n, "progress": report}), n
    )
    curve = {"counts": cone_curve.counts.tolist(), "distortions": cone_curve.distortions.tolist()}
    return {**curve, "knee": cone_curve.knee, "parts": cone_curve.components}


def curve_options(choices: Choices) -> dict[str, Any]:
    """Return the keyword arguments on which the curve depends."""
    words = choices.with_search().keywords()
    return {name: words[name] for name in CURVE_OPTIONS if name in words}


def layout_svg(result: Flattening) -> str:
    """Return an SVG drawing of the unit square, v upwards: seams in black, the boundary in grey, cones as dots."""
    outline, seams = outline_halfedges(TriangleMesh(result.vertices, result.faces), result.uv_faces)
    begin, end = (result.uv_faces.reshape(-1)[corners] for corners in end_corners(outline))
    places = np.round(np.column_stack([result.uv[:, 0], 1 - result.uv[:, 1]]) * 1000, 3)

    def path(chosen: slice, name: str) -> str:
        lines = (
            f"M{a[0]:g} {a[1]:g}L{b[0]:g} {b[1]:g}"
            for a, b in zip(places[begin[chosen]].tolist(), places[end[chosen]].tolist(), strict=True)
        )
        return f'<path class="{name}" d="{"".join(lines)}"/>'

    is_cone = np.isin(result.faces.reshape(-1), result.cones)
    dots = (
        f'<circle cx="{x:g}" cy="{y:g}" r="3"/>'
        for x, y in places[np.unique(result.uv_faces.reshape(-1)[is_cone])].tolist()
    )
    return "\n".join(
        (
            '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1000 1000" width="1000" height="1000">',
            "<style>path{fill:none;stroke-width:1.5;stroke-linecap:round}.seam{stroke:#000}.boundary{stroke:#777}"
            "circle{fill:#d62121}</style>",
            path(slice(2 * seams), "seam"),
            path(slice(2 * seams, None), "boundary"),
            *dots,
            "</svg>\n",
        )
    )


@dataclass(frozen=True)
class ResultFile:
    """A file of the result that the user can save.

    Attributes:
        label, title: text of its button on the page, and the tooltip.
        stem: added to the name of the mesh in the name of the file.
        save: returns the file of a result with an ending.
    """

    label: str
    title: str
    stem: str
    save: Callable[[Flattening, str], SavedFile]


#: The files of a result by their ending, in the order of their buttons.
RESULT_FILES = {
    **{
        f".{e}": ResultFile(e.upper(), f"Save as .{e}", "uv", _mesh_file)
        for e in ("obj", "ply", "glb", "npz")
    },
    ".svg": ResultFile("SVG", "Save as .svg", "uv", _layout_svg),
    ".png": ResultFile("Picture", "Save the layout as a picture, .png", "layout", _layout_picture),
    ".json": ResultFile("Report", "Save the report, .json", "report", _report),
}


@lru_cache(maxsize=1)
def repaired(source: Joined) -> tuple[CheckedMesh, str]:
    """Return the repaired mesh of a source, and what was wrong with it, or "".

    Triangles with coordinates that are not finite are left out.

    Raises:
        MeshError: no triangle is left, or the arrays are not a mesh.
    """
    arrays = as_input(source.mesh)
    vertices, faces = np.asarray(arrays.vertices), np.asarray(arrays.faces)
    try:
        return check_mesh(vertices, faces), ""
    except MeshError as error:
        wrong = str(error).partition(f"; {REPAIR_ADVICE}")[0]
    is_finite = np.isfinite(vertices).all(axis=1)
    vertices, faces = np.where(is_finite[:, None], vertices, 0.0), faces[is_finite[faces].all(axis=1)]
    return check_mesh(vertices, faces, repair=True), wrong


def bad_places(checked: CheckedMesh) -> list[list[int]]:
    """Return where a repair has separated a mesh: edges as pairs of input vertices, and further vertices alone."""
    mesh, origin = checked.mesh, checked.vertex_origin
    pairs, counts = np.unique(np.sort(origin[mesh.edges], axis=1), axis=0, return_counts=True)
    edges = pairs[counts > 1]
    split = np.setdiff1d(np.flatnonzero(np.bincount(origin) > 1), edges)
    # The page stays fast if only some of very many places are marked.
    return [*edges.tolist(), *split[:, None].tolist()][:2000]


def without_layout(checked: CheckedMesh) -> Flattening:
    """Return a mesh in the form of a flattening without cones; its UVs are a projection, which must not be shown."""
    mesh, zeros, none = checked.mesh, np.zeros(len(checked.mesh.vertices)), np.empty(0, dtype=np.int64)
    # In a skew projection the triangles of boxes have areas, too, which a simplification for display needs.
    uv = mesh.vertices @ np.array([[0.92, 0.13], [0.31, 0.84], [0.23, 0.51]])
    ones = np.ones(len(mesh.faces))
    unknown: Any = SimpleNamespace(qc=ones, log_area_scale=0 * ones, strain=0 * ones, overlapping_pairs=0)
    return Flattening(
        mesh.vertices, mesh.faces, uv, mesh.faces, 1.0, none, zeros[:0], zeros, zeros, zeros, mesh.edges[:0], 0.0,
        unknown, {}, vertex_origin=checked.vertex_origin,
    )  # fmt: skip
