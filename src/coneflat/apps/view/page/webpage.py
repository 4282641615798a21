"""One self-contained HTML page of a flattening, which loads nothing from anywhere."""

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
from typing import TYPE_CHECKING

import numpy as np

from ....base import shown
from ....errors import OptionError
from ....io import atomic_write, checked_target, read_picture
from ....options import MOST_TRIANGLES, SHOWS
from ..quantity import Quantity, own_quantity
from .content import content_of
from .payload import Told, as_payload, head_and_block

if TYPE_CHECKING:
    from .... import Flattening

# In the order in which they must run: names are shared.
_SCRIPTS = (
    "state", "model", "corners", "camera", "shaders", "graphics", "renderer", "marks", "gestures", "facts",
    "picture", "controls", "main",
)  # fmt: skip
#: What a page that carries its data may do: nothing but draw.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"


def page_of(
    result: Flattening,
    *,
    name: str | None = None,
    texture: str | PathLike[str] | None = None,
    up: str = "y",
    show: str | None = None,
    most_triangles: int = MOST_TRIANGLES,
    told: Told | None = None,
    color: Quantity | str | None = None,
) -> str:
    """Return the page as text.

    Args:
        result: the flattening.
        name: the page's title; by default that of the file the mesh was read from.
        texture: a PNG, JPEG, GIF or WebP file to lay on the model.
        up: the model's upward axis in the first view, "x", "y" or "z".
        show: what the colours show first: "checker", "picture", "charts", "qc", "area", "curvature" (of the model),
            "flat" (the curvature left) or "plain"; by default the picture, if there is one, or the checkerboard.
        color: numbers of the user's own, or their name, see `own_quantity`; they are shown first then, or as "own".
        most_triangles: a mesh with more is thinned for display.
        told: what it says; by default the key numbers and the report.

    Raises:
        OptionError: `up` or `show` is none of these, or `most_triangles` is not an integer.
        ArrayShapeError: the result has no UVs.
        MeshError: it cannot be thinned to so few triangles.
        MeshFileError: the texture cannot be read.
    """
    if show is None:
        show = "own" if color is not None else "checker" if texture is None else "picture"
    if not isinstance(show, str) or (show not in SHOWS and (show != "own" or color is None)):
        raise OptionError(f"unknown show {shown(show)}: choose from {', '.join(SHOWS)}")
    picture = None if texture is None else read_picture(texture)
    if isinstance(most_triangles, bool) or not isinstance(most_triangles, (int, np.integer)):
        raise OptionError(f"most_triangles must be an integer, not {shown(most_triangles)}")
    own = color if color is None or isinstance(color, Quantity) else own_quantity(result, color)
    content = content_of(result, most_triangles, own=own)
    if name is None:
        name = "Flattening" if result.source is None else result.source.path.name
    head, arrays = as_payload(*head_and_block(result, content, picture, name, up, show, told))
    before, between, after = _template()
    return "".join((before, head, between, arrays, after))


def check_page(path: str | PathLike[str]) -> Path:
    """Return the path if a page can be expected to be written there.

    Raises:
        UnknownFormatError: it does not end with .html or .htm.
        MeshFileError: the folder is missing, the path is a folder, or writing is not permitted.
    """
    return checked_target(path, (".html", ".htm"), "pages are written as")


def write_page(page: str, path: str | PathLike[str] | None) -> Path:
    """Write a page, in full or not at all, and return where: by default a new temporary file.

    Raises:
        UnknownFormatError, MeshFileError: as of `check_page`.
    """
    if path is None:
        handle, name = tempfile.mkstemp(prefix="coneflat-", suffix=".html")
        os.close(handle)
        path = name
    path = check_page(path)
    with atomic_write(path, "w") as stream:
        stream.write(page)
    return path


def open_page(path: Path) -> bool:
    """Open a page in the user's browser; return whether there is one that could."""
    return open_address(path.resolve().as_uri())


def open_address(address: str) -> bool:
    """Open an address in the user's browser; return whether there is one that could."""
    has_display = (
        not sys.platform.startswith("linux") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )
    if not has_display:  # A text browser would take the terminal, and show nothing.
        return False
    try:
        return webbrowser.open(address)
    except (OSError, webbrowser.Error):
        return False


def notebook_html(result: Flattening) -> str:
    """Return HTML with the page in a frame, for notebooks, which store every page that they show."""
    page = page_of(result, most_triangles=100_000)
    return (
        f'<iframe srcdoc="{html.escape(page)}" title="coneflat" loading="lazy" '
        f'style="width: 100%; height: 560px; border: 1px solid #8886; border-radius: 6px"></iframe>'
    )


@cache
def _template() -> tuple[str, str, str]:
    """Return the parts of the page before, between and after its two blocks of data."""
    data = """<script type="application/json" id="head">{{head}}</script>
<script type="text/plain" id="arrays">{{arrays}}</script>"""
    page = page_around(POLICY, data, script=_read("from_page.js"))
    before, rest = page.split("{{head}}")
    between, after = rest.split("{{arrays}}")
    return before, between, after


def page_around(
    policy: str, data: str, *, script: str, style: str = "", panel: str = "", keys: str = ""
) -> str:
    """Return the viewer's page, without a model, with more around it.

    Args:
        policy: what it may load, as a Content-Security-Policy.
        data: elements with the page's data.
        script: what gets the model, and starts; it shares the names of the page's own scripts.
        style: rules that come after the page's own.
        panel: elements beside the panes.
        keys: rows of the help.
    """
    page = _read("page.html")
    for mark, text in (
        ("{{policy}}", policy),
        ("{{style}}", _read("page.css") + style),
        ("{{panel}}", panel),
        ("{{keys}}", keys),
        ("{{data}}", data),
        ("{{script}}", "\n".join([*(_read(f"{name}.js") for name in _SCRIPTS), script])),
    ):
        page = page.replace(mark, text)
    return page


def _read(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")
