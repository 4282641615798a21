"""A page's data: numbers and texts as JSON, arrays as one compressed block of bytes."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ....geometry import CREASE_COSINE, double_areas, edge_lengths
from ....io import CELLS, Texture
from ....mesh import end_corners
from ..figures.camera import fit_camera
from ..figures.kinds import title
from ..figures.uv_layout import CHART_COLORS
from ..from_uv import shown_rows
from ..quantity import ColorScale
from .content import Content

if TYPE_CHECKING:
    from .... import Flattening

# The page does without matplotlib, which is an extra, and without the vivid ends of its tables, which light and shade
# would spoil. Equal steps in value are about equal steps of CIE L*a*b* here; lightness runs one way (sequential), or
# the same way from the middle to both ends (diverging), so that the tables hold without hue.
#: From light to dark, and from blue over near white to red: hexadecimal colours at equal steps.
SEQUENTIAL = (
    "f6eec8 dee6b5 c5dea3 add595 95ca97 7cbf9a 5fb49c 48a89d 3f9a9c "
    "348d9b 26809b 1b7398 2b6491 345689 394882 3a3974 34285a 2c1841"
)
DIVERGING = (
    "124987 255f99 3476ab 538dbc 72a4cb 90bcda b2cde1 d2dfe8 f1f1ef "
    "f3ddce f2c8ac efb48b e89c6e db7f54 ce613b aa492d 873220"
)
TITLES = {
    "qc": "QC distortion",
    "area": "Scale, against its mean",
    "curvature": "Curvature of the model, in π",
    "flat": "Curvature of the flat metric, in π",
}
#: The arrays that every page has.
_KINDS = dict.fromkeys(("places", "uv", "qc", "area", "curvature", "flat"), "f4") | dict.fromkeys(
    ("point_vertex", "faces", "outline", "cones"), "u4"
)


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


def as_payload(head: dict[str, Any], block: bytes) -> tuple[str, str]:
    """Return what `head_and_block` returns as it goes into a page.

    JSON without anything that could end a script element or open a comment in it, and base64 text.
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
    told: Told | None = None,
) -> tuple[dict[str, Any], bytes]:
    """Return the numbers and texts of a page, and its arrays as they lie in memory.

    told: what is said, by default that of a flattening.

    Raises:
        OptionError: `up` names no axis.
    """
    if told is None:
        told = Told(title(replace(result, source=None)), shown_rows(result))
    own, arrays = content.own, _arrays(content)
    if picture is not None:
        arrays["picture"] = np.frombuffer(picture.content, dtype=np.uint8)
    listed, block = pack(arrays)
    head = {
        "name": name,
        "title": told.title,
        "rows": list(told.rows),
        "notes": list(result.notes),
        "triangles": len(result.faces),
        "left_out": content.left_out,
        "seams": content.seams,
        "cone_curvatures": content.cone_curvatures.tolist(),
        "outward": content.model.outward,
        "turn": fit_camera(content.places, (1, 1), up=up).axes.tolist(),
        "uv_low": content.uv.min(axis=0).tolist(),
        "uv_high": content.uv.max(axis=0).tolist(),
        "uv_side": content.uv_side,
        "radius": content.model.radius,
        "sizes": _sizes(result, content),
        "squares": told.squares,
        "crease_cosine": CREASE_COSINE,
        "scales": {
            key: _plain_scale(TITLES[key] if own is None or key != "own" else own.label, scale)
            for key, scale in content.scales.items()
        },
        "own": None if own is None else "faces" if own.corners is None else "vertices",
        "picture": None if picture is None else picture.kind,
        "show": show,
        "arrays": listed,
    }
    return head, block


def _plain_scale(title: str, scale: ColorScale) -> dict[str, Any]:
    """Return what the page's scripts know of a scale: its ticks are places from 0 to 1."""
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


def _color_table(colors: str) -> NDArray[np.uint8]:
    """Return (256, 3) colours between some that are given."""
    known = np.array([list(bytes.fromhex(color)) for color in colors.split()])
    place = np.linspace(0, len(known) - 1, 256)
    table = np.stack([np.interp(place, np.arange(len(known)), column) for column in known.T], axis=1)
    return np.round(table).astype(np.uint8)


def _sizes(result: Flattening, content: Content) -> dict[str, float]:
    """Return the area of a model and the lengths of its seams and its boundary, in radii of the ball it is shown in."""
    scaled = (result.vertices - content.model.centre) / content.model.radius
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
    arrays |= {"sequential": _color_table(SEQUENTIAL), "diverging": _color_table(DIVERGING)}
    arrays["tints"] = np.array([list(bytes.fromhex(colour[1:])) for colour in CHART_COLORS], dtype=np.uint8)
    if not np.array_equal(content.vertex_numbers, np.arange(len(content.places))):
        arrays["vertex_numbers"] = content.vertex_numbers.astype("i4")
    if content.own is not None:
        arrays["own"] = content.own.values.astype("f4")
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
