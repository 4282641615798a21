"""The data of a page: numbers and texts as JSON, arrays as one compressed block of bytes."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ....base import CHECKER_CELLS, FloatArray
from ....geometry import CREASE_COSINE, double_areas, edge_lengths
from ....io import Texture
from ....mesh import end_corners
from ..faults import FAULTS
from ..figures.camera import fit_camera
from ..figures.kinds import title
from ..figures.uv_layout import CHART_COLORS
from ..from_uv import is_from_file, shown_rows
from ..palettes import PALETTES, color_table
from ..quantity import ColorScale
from ..upward import axis_of
from .content import Content
from .parts import PageParts

if TYPE_CHECKING:
    from .... import Flattening

TITLES = {
    "qc": "QC distortion",
    "area": "Scale, relative to its mean",
    "strain": "Strain: largest change of a side, at the mean scale",
    "curvature": "Curvature of the model, in π",
    "flat": "Curvature of the flat metric, in π",
}
#: Arrays that every page has, and their types.
_KINDS = dict.fromkeys(("places", "uv", "qc", "area", "strain", "curvature", "flat"), "f4") | dict.fromkeys(
    ("point_vertex", "faces", "outline", "seam_numbers", "anchors", "cones"), "u4"
)


@dataclass(frozen=True)
class PageText:
    """Texts and numbers of a page.

    Attributes:
        title: the main measures in one line.
        rows: rows (measure, value, meaning) of the report.
        squares: number of checkerboard squares along the square root of the area, at the start.
    """

    title: str
    rows: Sequence[tuple[str, str, str]]
    squares: float = CHECKER_CELLS


def text_of(result: Flattening) -> PageText:
    """Return the title and the rows of the report of a flattening."""
    return PageText(title(replace(result, source=None)), shown_rows(result))


def as_payload(head: dict[str, Any], block: bytes) -> tuple[str, str]:
    """Return the results of `head_and_block` in the form that is written into a page.

    This is JSON in which characters that could end a script element or open a comment are escaped, and base64 text.
    """
    text = json.dumps(head, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    safe = text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    return safe, base64.b64encode(zlib.compress(block)).decode("ascii")


def head_and_block(
    result: Flattening,
    content: Content,
    picture: Texture | None,
    name: str,
    up: str,
    show: str,
    text: PageText | None = None,
    *,
    own_uv: FloatArray | None = None,
    parts: PageParts | None = None,
) -> tuple[dict[str, Any], bytes]:
    """Return the numbers and texts of a page, and its arrays as a block of bytes.

    text: title and rows; by default those of a flattening. own_uv: (k, 2) UVs of the picture at the polygon corners of
    the file; None if they are those of the layout. parts: names of pieces and seams.

    Raises:
        OptionError: `up` is not valid.
    """
    text = text_of(result) if text is None else text
    quantity, arrays = content.quantity, _arrays(content)
    if picture is not None:
        arrays["picture"] = np.frombuffer(picture.content, dtype=np.uint8)
    if own_uv is not None and result.face_corners is not None:
        arrays["own_uv"] = own_uv[result.face_corners[content.face_numbers]].astype("f4")
    if parts is not None:
        arrays |= _arrays_of_parts(parts, content)
    titles = TITLES if quantity is None else {**TITLES, "own": quantity.label}
    titles = titles if parts is None else {**titles, "strain": parts.strain_title}
    listed, block = pack(arrays)
    head = {
        "name": name,
        "title": text.title,
        "rows": list(text.rows),
        "notes": list(result.notes),
        "triangles": len(result.faces),
        "left_out": content.left_out,
        "seams": content.seams,
        "cone_curvatures": content.cone_curvatures.tolist(),
        "outward": content.model.outward,
        "turn": fit_camera(content.places, (1, 1), up="y").axes.tolist(),
        "up": axis_of(up, result),
        "uv_low": content.uv.min(axis=0).tolist(),
        "uv_high": content.uv.max(axis=0).tolist(),
        "uv_side": content.uv_side,
        "radius": content.model.radius,
        "sizes": _sizes(result, content),
        "squares": text.squares,
        "fault_bits": FAULTS,
        "fault_counts": content.fault_counts,
        "crease_cosine": CREASE_COSINE,
        "scales": {key: _plain_scale(titles[key], scale) for key, scale in content.scales.items()},
        "own": None if quantity is None else "faces" if quantity.corners is None else "vertices",
        "picture": None if picture is None else picture.kind,
        "show": show,
        "from_file": is_from_file(result),
        "parts": None
        if parts is None
        else {
            "seam_texts": list(parts.seam_texts),
            "names": list(parts.names),
            "folds": len(parts.folds.is_mountain),
            "mountains": int(parts.folds.is_mountain.sum()),
        },
        "arrays": listed,
    }
    return head, block


def _plain_scale(title: str, scale: ColorScale) -> dict[str, Any]:
    """Return a colour scale as data for the scripts of the page; its ticks are positions from 0 to 1."""
    places = scale.position(np.array([value for value, _ in scale.ticks])).tolist()
    ticks = [(place, label) for place, (_, label) in zip(places, scale.ticks, strict=True)]
    return {
        "title": title,
        "kind": scale.kind,
        "low": scale.low,
        "high": scale.high,
        "table": scale.colors,
        "ticks": ticks,
    }


def _sizes(result: Flattening, content: Content) -> dict[str, float]:
    """Return the area of a model and the lengths of its seams and its boundary, in units of the radius of its ball."""
    scaled = (result.vertices - content.model.centre) / content.model.radius
    area = double_areas(edge_lengths(scaled, result.faces)).sum() / 2
    ends = [content.point_vertex[content.faces.reshape(-1)[end]] for end in end_corners(content.outline)]
    lengths = np.linalg.norm(content.places[ends[1]] - content.places[ends[0]], axis=1)
    seams = slice(0, 2 * content.seams, 2)  # Each seam has two half-edges.
    return {
        "area": float(area),
        "seams": float(lengths[seams].sum()),
        "boundary": float(lengths[2 * content.seams :].sum()),
    }


def _arrays(content: Content) -> dict[str, NDArray[Any]]:
    """Return the arrays by the names that the scripts of the page use."""
    arrays: dict[str, NDArray[Any]] = {
        name: np.asarray(getattr(content, name)).astype(kind) for name, kind in _KINDS.items()
    }
    arrays["strain"] = _rounded(arrays["strain"])
    arrays["chart"] = content.chart.astype("u2" if content.chart.max() < 2**16 else "u4")
    arrays |= {name: np.round(255 * color_table(name)).astype(np.uint8) for name in PALETTES}
    arrays["faults"] = content.faults.astype("u1")
    arrays["fault_places"] = content.fault_places.reshape(-1).astype("u4")
    arrays["tints"] = np.array([list(bytes.fromhex(colour[1:])) for colour in CHART_COLORS], dtype=np.uint8)
    if not np.array_equal(content.vertex_numbers, np.arange(len(content.places))):
        arrays["vertex_numbers"] = content.vertex_numbers.astype("i4")
    if content.quantity is not None:
        arrays["own"] = content.quantity.values.astype("f4")
    if content.left_out:
        arrays["face_numbers"] = content.face_numbers.astype("u4")
    return arrays


def _arrays_of_parts(parts: PageParts, content: Content) -> dict[str, NDArray[Any]]:
    """Return the names of seam edges, and the ends of folds: those of mountains first."""
    folds = parts.folds
    order = np.argsort(~folds.is_mountain, kind="stable")
    places = (folds.places[order] - content.model.centre) / content.model.radius
    return {
        "edge_names": parts.edge_names.astype("u4"),
        "fold_places": places.astype("f4"),
        "fold_uv": folds.uv[order].astype("f4"),
    }


def _rounded(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return 32-bit numbers with a relative precision of 2^-10, which take half the space in a page."""
    bits = values.view(np.uint32).astype(np.uint64) + 2**13
    return (bits & 0xFFFFC000).astype(np.uint32).view(np.float32)


def pack(arrays: Mapping[str, NDArray[Any]]) -> tuple[list[dict[str, Any]], bytes]:
    """Return the name, type, offset and count of each array in a block of little-endian bytes, and the block."""
    listed, parts, offset = [], [], 0
    for name, array in arrays.items():
        content = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
        content += bytes(-len(content) % 4)  # Typed arrays of the browser must be aligned.
        kind = f"{array.dtype.kind}{array.dtype.itemsize}"
        listed.append({"name": name, "type": kind, "offset": offset, "count": array.size})
        parts.append(content)
        offset += len(content)
    return listed, b"".join(parts)
