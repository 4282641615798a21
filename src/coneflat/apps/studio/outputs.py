"""What the studio makes beside layouts: files, quads, and how distortion falls with more cones."""

from __future__ import annotations

import json
from collections.abc import Callable
from io import BytesIO
from typing import TYPE_CHECKING, Any

from ...errors import StudioError

if TYPE_CHECKING:
    from ...input.join import Joined
    from ...result.flattening import Flattening
    from .choices import Choices

#: What a result can be saved as: .json is its report, .png a picture of the layout.
EXPORTS = (".obj", ".ply", ".glb", ".npz", ".svg", ".png", ".json")
#: What quads can be saved as.
QUADS = (".obj", ".ply", ".glb")
MOST_QUADS = 1_000_000
#: Options that a search for any number of cones heeds, and those that quads heed.
OF_CURVES = (
    "required_cones", "forbidden_cones", "weights", "seams", "forbidden_seams", "seamless", "sharp_angle", "repair",
)  # fmt: skip
OF_QUADS = ("forbidden_cones", "weights", "sharp_angle", "stretch", "repair")
#: Cones to look at: as many as this, and so many more than are locked.
MOST_CONES, MORE = 30, 12

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
        from .outlines import layout_svg

        return layout_svg(result).encode("utf-8")
    stream = BytesIO()
    if ending == ".png":
        from ...view import make_figure
        from ...view.figures.figure import write_figure

        write_figure(make_figure(result, "layout"), stream, ending)
    else:
        from ...files.write import write_stream

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
    from ...files.quads import write_quads_stream
    from ...grid.quads import quads

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
    from ...curve import whole_curve
    from ...options import read_options

    words = curve_options(choices)
    most = max(MOST_CONES, len(words.get("required_cones", ())) + MORE)
    found = whole_curve(
        source.mesh, None, read_options({**source.renamed(words), "cone_count": most, "progress": told}), most
    )
    curve = {"counts": found.counts.tolist(), "distortions": found.distortions.tolist()}
    return {**curve, "knee": found.knee, "parts": found.parts}


def curve_options(choices: Choices) -> dict[str, Any]:
    """Return what of the choices a curve depends on."""
    words = choices.searching().keywords()
    return {name: words[name] for name in OF_CURVES if name in words}
