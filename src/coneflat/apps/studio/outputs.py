"""What the studio makes beside layouts: files, quads, and how distortion falls with more cones."""

from __future__ import annotations

import json
from collections.abc import Callable
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import TriangleMesh
from ...base import MOST_CONES
from ...errors import StudioError
from ...mesh import end_corners
from ..view import outline_halfedges

if TYPE_CHECKING:
    from ... import Flattening
    from ...io import Joined
    from .choices import Choices

#: What a result can be saved as: .json is its report, .png a picture of the layout.
EXPORTS = (".obj", ".ply", ".glb", ".npz", ".svg", ".png", ".json")
#: What quads can be saved as.
QUADS = (".obj", ".ply", ".glb")
MOST_QUADS = 1_000_000
#: Options that a search for any number of cones heeds, and those that quads heed.
OF_CURVES = (
    "required_cones", "forbidden_cones", "weights", "seams", "no_seams", "sharp_angle", "repair",
)  # fmt: skip
OF_QUADS = ("forbidden_cones", "weights", "sharp_angle", "stretch", "repair")

Told = Callable[[str, float], None]


def saved(result: Flattening | None, ending: str) -> bytes:
    """Return a result as a file; ending: one of `EXPORTS`.

    Raises:
        StudioError: there is no result.
    """
    if result is None:
        raise StudioError("there is nothing to save: the last change could not be flattened")
    if ending == ".json":
        return (json.dumps(result.report(), indent=2) + "\n").encode("utf-8")
    if ending == ".svg":
        return layout_svg(result).encode("utf-8")
    stream = BytesIO()
    if ending == ".png":
        from ..view import make_figure, write_figure

        write_figure(make_figure(result, "layout"), stream, ending)
    else:
        from ...io import write_stream

        write_stream(result, stream, ending)
    return stream.getvalue()


def quads_of(source: Joined, choices: Choices, count: int, ending: str, told: Told) -> bytes:
    """Return quads of a mesh as a file.

    They have cones of their own, of whole multiples of 90 degrees. Of what is chosen they heed where cones may not lie,
    importance, sharp edges, areas, and a straight boundary.

    Args:
        source: the mesh.
        choices: what is chosen.
        count: about how many.
        ending: one of `QUADS`.
        told: as of `coneflat.flatten`'s progress.
    """
    from ... import quads
    from ..quads.files import write_quads_stream

    words = choices.searching().keywords()
    options = {name: words[name] for name in OF_QUADS if name in words}
    if words.get("boundary") == "straight":
        options["boundary"] = "straight"
    found = quads(source.mesh, quads=count, progress=told, **source.renamed(options))
    stream = BytesIO()
    write_quads_stream(found, stream, ending)
    return stream.getvalue()


def curve_of(source: Joined, choices: Choices, told: Told) -> dict[str, Any]:
    """Return the least distortion found for each number of cones around those that are locked, as plain values.

    That of the whole, with so many cones in each of its parts: components, and what is between marked seams.
    """
    from ...cone_curve import whole_curve
    from ...options import read_options

    words = curve_options(choices)
    most = max(MOST_CONES, len(words.get("required_cones", ())) + 12)  # of which a dozen are free
    found = whole_curve(
        source.mesh, None, read_options({**source.renamed(words), "cone_count": most, "progress": told}), most
    )
    curve = {"counts": found.counts.tolist(), "distortions": found.distortions.tolist()}
    return {**curve, "knee": found.knee, "parts": found.parts}


def curve_options(choices: Choices) -> dict[str, Any]:
    """Return what of the choices a curve depends on."""
    words = choices.searching().keywords()
    return {name: words[name] for name in OF_CURVES if name in words}


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
