"""A page's data: numbers and texts as JSON, arrays as one compressed block of bytes."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....geometry import CREASE_COSINE, double_areas, edge_lengths
from ....io import CELLS, Texture
from ....mesh import end_corners
from ..colours import DIVERGING, SEQUENTIAL, TITLES, as_plain, color_table
from ..figures.camera import fit_camera
from ..figures.kinds import title
from ..figures.uv_layout import CHART_COLORS
from ..from_uv import shown_rows
from .content import Content

if TYPE_CHECKING:
    from .... import Flattening

#: The arrays that every page has.
_KINDS = dict.fromkeys(("places", "uv", "qc", "area", "curvature", "flat"), "f4") | dict.fromkeys(
    ("point_vertex", "faces", "outline", "cones"), "u4"
)


class Payload(NamedTuple):
    """What goes into a page: JSON that is safe inside a script element, and base64 text."""

    head: str
    arrays: str


@dataclass(frozen=True)
class Told:
    """What a page says in words and numbers.

    Attributes:
        title: a line of key numbers.
        rows: of the report: measure, value, meaning.
        squares: of the checkerboard at first, in a row as long as the root of the area.
    """

    title: str
    rows: Sequence[tuple[str, str, str]]
    squares: float = CELLS


def as_payload(head: dict[str, Any], block: bytes) -> Payload:
    """Return what `head_and_block` returns as it goes into a page."""
    return Payload(_safe_json(head), base64.b64encode(zlib.compress(block)).decode("ascii"))


def head_and_block(
    result: Flattening,
    content: Content,
    picture: Texture | None,
    name: str,
    up: str,
    show: str,
    told: Told | None = None,
) -> tuple[dict[str, Any], bytes]:
    """Return the numbers and texts of a page, and its arrays as they lie in memory.

    told: what is said, by default that of a flattening.

    Raises:
        OptionError: `up` names no axis.
    """
    if told is None:
        told = Told(title(replace(result, source=None)), shown_rows(result))
    low, high = content.uv.min(axis=0), content.uv.max(axis=0)
    arrays = _arrays(content)
    if picture is not None:
        arrays["picture"] = np.frombuffer(picture.content, dtype=np.uint8)
    listed, block = pack(arrays)
    head: dict[str, Any] = {
        "name": name,
        "title": told.title,
        "rows": list(told.rows),
        "notes": list(result.notes),
        "triangles": len(result.faces),
        "left_out": content.left_out,
        "seams": content.seams,
        "cone_curvatures": content.cone_curvatures.tolist(),
        "outward": content.outward,
        "turn": fit_camera(content.places, (1, 1), up=up).axes.tolist(),
        "uv_low": low.tolist(),
        "uv_high": high.tolist(),
        "uv_side": content.uv_side,
        "radius": content.radius,
        "sizes": _sizes(result, content),
        "squares": told.squares,
        "crease_cosine": CREASE_COSINE,
        "scales": {
            key: as_plain(content.own_title if key == "own" else TITLES[key], scale)
            for key, scale in content.scales.items()
        },
        "own": None if content.own is None else "faces" if content.own_by_face else "vertices",
        "picture": None if picture is None else picture.kind,
        "show": show,
        "arrays": listed,
    }
    return head, block


def _sizes(result: Flattening, content: Content) -> dict[str, float]:
    """Return the area of a model and the lengths of its seams and its boundary, in radii of the ball it is shown in."""
    scaled = (result.vertices - content.centre) / content.radius
    area = double_areas(edge_lengths(scaled, result.faces)).sum() / 2
    ends = [content.point_vertex[content.faces.reshape(-1)[end]] for end in end_corners(content.outline)]
    lengths = np.linalg.norm(content.places[ends[1]] - content.places[ends[0]], axis=1)
    seams = slice(0, 2 * content.seams, 2)  # each has two sides
    return {
        "area": float(area),
        "seams": float(lengths[seams].sum()),
        "boundary": float(lengths[2 * content.seams :].sum()),
    }


def _arrays(content: Content) -> dict[str, NDArray[Any]]:
    """Return the arrays by the names that the page's scripts know them by."""
    arrays: dict[str, NDArray[Any]] = {
        name: np.asarray(getattr(content, name)).astype(kind) for name, kind in _KINDS.items()
    }
    arrays["chart"] = content.chart.astype("u2" if content.chart.max() < 2**16 else "u4")
    arrays |= {"sequential": color_table(SEQUENTIAL), "diverging": color_table(DIVERGING)}
    arrays["tints"] = np.array([list(bytes.fromhex(colour[1:])) for colour in CHART_COLORS], dtype=np.uint8)
    if not np.array_equal(content.vertex_numbers, np.arange(len(content.places))):
        arrays["vertex_numbers"] = content.vertex_numbers.astype("i4")
    if content.own is not None:
        arrays["own"] = content.own.astype("f4")
    if content.left_out:
        arrays["face_numbers"] = content.face_numbers.astype("u4")
    return arrays


def pack(arrays: Mapping[str, NDArray[Any]]) -> tuple[list[dict[str, Any]], bytes]:
    """Return where each array lies in a block of bytes, little-endian, and the block."""
    listed, parts, offset = [], [], 0
    for name, array in arrays.items():
        content = np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<"), copy=False).tobytes()
        content += bytes(-len(content) % 4)  # where the browser may put a typed array
        kind = f"{array.dtype.kind}{array.dtype.itemsize}"
        listed.append({"name": name, "type": kind, "offset": offset, "count": array.size})
        parts.append(content)
        offset += len(content)
    return listed, b"".join(parts)


def _safe_json(value: Any) -> str:
    """Return JSON without anything that could end a script element or open a comment in it."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
