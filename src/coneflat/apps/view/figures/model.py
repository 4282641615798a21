"""Drawing the model: its texture, its cones and seams, quantities on it, and what how many cones gain."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from .... import ConeCurve
from ....base import DISTORTION, FloatArray, IntArray
from ....io import CELLS, cell_side
from ..quantity import Quantity, curvature
from .camera import Eye
from .cone_marks import draw_cones_on_model, draw_seams_on_model, pixels_of
from .render import MeshPicture, render_mesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .... import Flattening

DOTS_PER_INCH = 300.0
"""Resolution of pictures, for print."""


def draw_checker(
    result: Flattening,
    axes: Axes,
    *,
    eye: Eye = "front-right",
    up: str = "y",
    cells: float = CELLS,
    seams: bool = True,
    cones: bool = False,
    dpi: float = DOTS_PER_INCH,
) -> None:
    """Draw the model with a checkerboard that its UVs put on it: squares, equally large, if nothing is distorted.

    Args:
        result: the flattening.
        axes: matplotlib axes to draw in; their own lines and ticks are turned off.
        eye: direction from the model to the eye: (3,), or "front", "back", "left", "right", "top", "bottom", or two
            of them such as "back-left" for three quarters.
        up: the model's upward axis, "x", "y" or "z".
        cells: cells in a row that is as long as the root of the area.
        seams, cones: mark those that are visible.
        dpi: resolution of the picture.

    Raises:
        OptionError: an option makes no sense.
    """
    side = cell_side(result.uv, result.uv_faces, cells)
    paint = {"corner_uv": result.corner_uv, "cell": side}
    picture = show_mesh(axes, result.vertices, result.faces, eye, up, dpi, **paint)
    if seams:
        draw_seams_on_model(axes, picture, result)
    if cones:
        draw_cones_on_model(axes, picture, result)


def draw_cones(
    result: Flattening, axes: Axes, *, eye: Eye = "front-right", up: str = "y", dpi: float = DOTS_PER_INCH
) -> None:
    """Draw the model with its cones and seams, and faintly those behind it.

    Cones are red where their curvature is positive and black where it is negative, with an area that grows with it.
    Arguments and errors are those of `draw_checker`.
    """
    picture = show_mesh(axes, result.vertices, result.faces, eye, up, dpi)
    draw_seams_on_model(axes, picture, result, through=True)
    draw_cones_on_model(axes, picture, result, through=True)


def draw_curvature(
    result: Flattening,
    axes: Axes,
    *,
    flat: bool = False,
    eye: Eye = "front-right",
    up: str = "y",
    colors: str | None = None,
    dpi: float = DOTS_PER_INCH,
) -> None:
    """Draw the curvature of every vertex, the angles missing around it, by colours.

    Args:
        result, axes, eye, up, dpi: as of `draw_checker`.
        flat: of the flat metric, where only cones should have curvature; else of the model.
        colors: a colour map of matplotlib.

    Raises:
        OptionError: an option makes no sense.
    """
    quantity = curvature(result, flat).recolored(colors)
    picture = draw_quantity(result, axes, quantity, eye, up, dpi)
    if flat:
        draw_cones_on_model(axes, picture, result)


def draw_quantity(
    result: Flattening, axes: Axes, quantity: Quantity, eye: Eye, up: str, dpi: float
) -> MeshPicture:
    """Draw the model coloured by a quantity, in half the light and shade: a shadow must not read as a number."""
    paint = {"colors": quantity.colors(), "contrast": 0.5}
    return show_mesh(axes, result.vertices, result.faces, eye, up, dpi, **paint)


def show_mesh(
    axes: Axes, vertices: FloatArray, faces: IntArray, eye: Eye, up: str, dpi: float, **paint: Any
) -> MeshPicture:
    """Show a picture of a mesh so that the axes' coordinates are its pixels, row 0 at the top; see `render_mesh`."""
    picture = render_mesh(vertices, faces, size=pixels_of(axes, dpi), eye=eye, up=up, **paint)
    extent = (0, picture.camera.width, picture.camera.height, 0)
    axes.imshow(picture.image, extent=extent, interpolation="antialiased")
    axes.set_axis_off()
    return picture


CURVE_COLOR, WANTED_COLOR, KNEE_COLOR = "#35618f", "#b0413e", "#777777"


def draw_cone_curve(curve: ConeCurve, axes: Axes, *, distortion: float = DISTORTION) -> None:
    """Draw the area distortion against the number of cones, the distortion wanted, and the knee.

    Args:
        curve: what `coneflat.cone_curve` returns.
        axes: matplotlib axes to draw in.
        distortion: E that is wanted.
    """
    from matplotlib.ticker import MaxNLocator

    axes.plot(curve.counts, curve.distortions, color=CURVE_COLOR, marker="o", markersize=4, linewidth=1.5)
    axes.set_ylim(0.0, 1.1 * max(float(curve.distortions.max()), distortion))
    axes.axhline(distortion, color=WANTED_COLOR, linewidth=1.0, linestyle="--")
    note: Any = partial(axes.annotate, textcoords="offset points")
    end, look = (curve.counts[-1], distortion), {"ha": "right", "va": "bottom"}
    note(f"E = {distortion:g}", end, xytext=(0, 2), color=WANTED_COLOR, **look)
    axes.axvline(curve.knee, color=KNEE_COLOR, linewidth=0.8, linestyle=":")
    top, look = (curve.knee, axes.get_ylim()[1]), {"ha": "left", "va": "top"}
    note(f"knee: {curve.knee} cones", top, xytext=(3, 0), color=KNEE_COLOR, **look)
    axes.set_xlabel("number of cones")
    axes.set_ylabel("area distortion E (std. of the log scale)")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
