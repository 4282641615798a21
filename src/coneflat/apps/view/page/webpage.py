"""A self-contained HTML page of a flattening, which loads no other files."""

from __future__ import annotations

import html
import os
import sys
import tempfile
import webbrowser
from functools import cache
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from ....base import FloatArray, short_repr
from ....errors import OptionError
from ....io import Texture, atomic_write, checked_target, read_picture
from ....options import MAX_SHOWN_TRIANGLES, SHOWS, as_integer
from ..quantity import Quantity, Ranges, own_quantity
from .content import FITTING, content_of
from .parts import PageParts
from .payload import PageText, as_payload, head_and_block

if TYPE_CHECKING:
    from .... import Flattening

# In the order in which they must run; they share one scope.
_SCRIPTS = (
    "state", "model", "corners", "camera", "shaders", "graphics", "renderer", "marks", "gestures", "facts",
    "picture", "controls", "main",
)  # fmt: skip
#: An image, and (k, 2) its UVs at the polygon corners of a file.
OwnPicture: TypeAlias = "tuple[Texture, FloatArray]"
#: Content security policy of a page that contains its data: nothing may be loaded.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


def page_html(
    result: Flattening,
    *,
    name: str | None = None,
    texture: str | PathLike[str] | None = None,
    up: str = "auto",
    show: str | None = None,
    most_triangles: int = MAX_SHOWN_TRIANGLES,
    text: PageText | None = None,
    color: Quantity | str | None = None,
    ranges: Ranges = FITTING,
    own_picture: OwnPicture | None = None,
    parts: PageParts | None = None,
) -> str:
    """Return the HTML page of a flattening as text.

    Args:
        result: the flattening.
        name: title of the page; by default the name of the file of the mesh.
        texture: image file for the model: PNG, JPEG, GIF or WebP.
        up: the model's upward axis in the first view, "x", "y" or "z"; "auto" is that of its format or shape.
        show: display mode at the start: "checker", "picture", "charts", "qc", "area", "strain", "faults" (of the
            UVs), "curvature" (of the model), "flat" (curvature of the flat metric), "plain" or, with `color`, "own"; by
            default the values of `color`, else the picture, else the checkerboard.
        color: quantity given by the user, or its name, see `own_quantity`.
        most_triangles: a mesh with more triangles is simplified for display.
        text: title and rows of the page; by default the main measures and the report.
        ranges: ends of the colour scales of QC distortion and of scale.
        own_picture: the image of the file that was read and (k, 2) its UVs at all polygon corners; shown first, unless
            another image, colours or a display mode are given.
        parts: pieces that are shown instead of charts, with names of seams, at true scale instead of in a texture.

    Raises:
        OptionError: `up` or `show` is not valid, or `most_triangles` is not an integer.
        ArrayShapeError: the result has no UVs.
        MeshError: the mesh cannot be reduced to `most_triangles`.
        MeshFileError: the texture cannot be read.
    """
    if show is None:
        has_picture = texture is not None or own_picture is not None
        show = "own" if color is not None else "picture" if has_picture else "checker"
    if not isinstance(show, str) or (show not in SHOWS and (show != "own" or color is None)):
        raise OptionError(f"unknown show {short_repr(show)}: choose from {', '.join(SHOWS)}")
    picture, own_uv = (None if texture is None else read_picture(texture)), None
    if picture is None and own_picture is not None and result.face_corners is not None:
        picture, own_uv = own_picture
    max_triangles = as_integer("most_triangles", most_triangles)
    quantity = color if color is None or isinstance(color, Quantity) else own_quantity(result, color)
    content = content_of(result, max_triangles, quantity=quantity, ranges=ranges, parts=parts)
    if name is None:
        name = "Flattening" if result.source is None else result.source.path.name
    data = head_and_block(result, content, picture, name, up, show, text, own_uv=own_uv, parts=parts)
    head, arrays = as_payload(*data)
    before, between, after = _template()
    return "".join((before, head, between, arrays, after))


def check_page(path: str | PathLike[str]) -> Path:
    """Return the path if a page can be written to it.

    Raises:
        UnknownFormatError: it does not end with .html or .htm.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    return checked_target(path, (".html", ".htm"), "pages are written as")


def write_page(page: str, path: str | PathLike[str] | None) -> Path:
    """Write a page and return its path, by default a new temporary file; no incomplete file is left.

    Raises:
        UnknownFormatError, MeshFileError: as in `check_page`.
    """
    if path is None:
        handle, name = tempfile.mkstemp(prefix="coneflat-", suffix=".html")
        os.close(handle)
        path = name
    path = check_page(path)
    with atomic_write(path, "w") as stream:
        stream.write(page)
    return path


def show_page(
    result: Flattening,
    path: str | PathLike[str] | None,
    *,
    most_triangles: int | None,
    qc_max: float | None = None,
    scale_max: float | None = None,
    **look: Any,
) -> Path:
    """Write the page of a flattening, and open it in the browser if no path is given; see `Flattening.view`.

    look: further arguments of `page_html`.
    """
    if path is not None:
        check_page(path)
    max_triangles = MAX_SHOWN_TRIANGLES if most_triangles is None else most_triangles
    ranges = Ranges(qc_max, scale_max)
    page = write_page(page_html(result, most_triangles=max_triangles, ranges=ranges, **look), path)
    if path is None:
        open_page(page)
    return page


def open_page(path: Path) -> bool:
    """Open a page in the browser of the user, and return whether a browser was found."""
    return open_address(path.resolve().as_uri())


def open_address(address: str) -> bool:
    """Open an address in the browser of the user, and return whether a browser was found."""
    has_display = (
        not sys.platform.startswith("linux") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
    if not has_display:  # A text browser would block the terminal, and cannot show the page.
        return False
    try:
        return webbrowser.open(address)
    except (OSError, webbrowser.Error):
        return False


def notebook_html(result: Flattening) -> str:
    """Return HTML with the page in a frame, for notebooks; it is small because notebooks store every page."""
    page = page_html(result, most_triangles=100_000)
    return (
        f'<iframe srcdoc="{html.escape(page)}" title="coneflat" loading="lazy" '
        f'style="width: 100%; height: 560px; border: 1px solid #8886; border-radius: 6px"></iframe>'
    )


@cache
def _template() -> tuple[str, str, str]:
    """Return the parts of the page before, between and after its two blocks of data."""
    data = """<script type="application/json" id="head">{{head}}</script>
<script type="text/plain" id="arrays">{{arrays}}</script>"""
    page = page_around(POLICY, data, script=read_part("from_page.js"))
    before, body = page.split("{{head}}")
    between, after = body.split("{{arrays}}")
    return before, between, after


def page_around(
    policy: str, data: str, *, script: str, style: str = "", panel: str = "", keys: str = ""
) -> str:
    """Return the page of the viewer without a model, with further elements.

    Args:
        policy: its Content-Security-Policy.
        data: elements with the data of the page.
        script: script that loads the model and starts the viewer; it shares a scope with the scripts of the page.
        style: rules that follow those of the page.
        panel: elements next to the panes.
        keys: rows of the help on keys.
    """
    page = read_part("page.html")
    for mark, content in (
        ("{{policy}}", policy),
        ("{{style}}", read_part("page.css") + style),
        ("{{panel}}", panel),
        ("{{keys}}", keys),
        ("{{data}}", data),
        ("{{script}}", "\n".join([*(read_part(f"{name}.js") for name in _SCRIPTS), script])),
    ):
        page = page.replace(mark, content)
    return page


def read_part(name: str) -> str:
    """Return the text of a file beside this one, which is a part of the page."""
    return (files(__package__) / name).read_text(encoding="utf-8")
