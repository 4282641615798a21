"""Drawing the model with a texture, cones, seams or colours, and the curve of distortion by number of cones."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from .... import ConeCurve
from ....base import CHECKER_CELLS, DISTORTION, DOTS_PER_INCH, FloatArray, IntArray
from ....io import cell_side
from ..quantity import Quantity, curvature
from ..upward import axis_of
from .camera import Eye
from .cone_marks import draw_cones_on_model, draw_seams_on_model, pixels_of
from .render import MeshPicture, render_mesh

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .... import Flattening

"""Resolution of pictures for print."""


def draw_checker(
    result: Flattening,
    axes: Axes,
    *,
    eye: Eye = "front-right",
    up: str = "auto",
    cells: float = CHECKER_CELLS,
    seams: bool = True,
    cones: bool = False,
    dpi: float = DOTS_PER_INCH,
) -> None:
    """Draw the model with a checkerboard texture; its cells are squares of equal size if there is no distortion.

    Args:
        result: the flattening.
        axes: matplotlib axes to draw in; their own lines and ticks are hidden.
        eye: direction from the model to the eye: (3,), or "front", "back", "left", "right", "top", "bottom", or two
            of them such as "back-left" for a three-quarter view.
        up: the model's upward axis, "x", "y" or "z"; "auto" is that of its format or shape.
        cells: number of cells along the square root of the surface area.
        seams, cones: whether to draw the visible ones.
        dpi: resolution in dots per inch.

    Raises:
        OptionError: an option is not valid.
    """
    side = cell_side(result.uv, result.uv_faces, cells)
    paint = {"corner_uv": result.corner_uv, "cell": side}
    picture = show_mesh(axes, result.vertices, result.faces, eye, axis_of(up, result), dpi, **paint)
    if seams:
        draw_seams_on_model(axes, picture, result)
    if cones:
        draw_cones_on_model(axes, picture, result)


def draw_cones(
    result: Flattening, axes: Axes, *, eye: Eye = "front-right", up: str = "auto", dpi: float = DOTS_PER_INCH
) -> None:
    """Draw the model with its cones and seams; hidden ones are drawn in faint colours.

    Cones of positive curvature are red, those of negative curvature black. The area of a dot grows with the curvature.
    Arguments and errors are those of `draw_checker`.
    """
    picture = show_mesh(axes, result.vertices, result.faces, eye, axis_of(up, result), dpi)
    draw_seams_on_model(axes, picture, result, through=True)
    draw_cones_on_model(axes, picture, result, through=True)


def draw_curvature(
    result: Flattening,
    axes: Axes,
    *,
    flat: bool = False,
    eye: Eye = "front-right",
    up: str = "auto",
    colors: str | None = None,
    dpi: float = DOTS_PER_INCH,
) -> None:
    """Draw the curvature of every vertex, its absolute angle defect, as colours.

    Args:
        result, axes, eye, up, dpi: as in `draw_checker`.
        flat: draw the curvature of the flat metric, where only cones should have any, instead of that of the model.
        colors: name of a colour map of matplotlib; None for the default.

    Raises:
        OptionError: an option is not valid.
    """
    quantity = curvature(result, flat).recolored(colors)
    picture = draw_quantity(result, axes, quantity, eye, up, dpi)
    if flat:
        draw_cones_on_model(axes, picture, result)


def draw_quantity(
    result: Flattening, axes: Axes, quantity: Quantity, eye: Eye, up: str, dpi: float
) -> MeshPicture:
    """Draw the model coloured by a quantity; shading is reduced by half so that colours remain readable."""
    paint = {"colors": quantity.colors(), "contrast": 0.5}
    return show_mesh(axes, result.vertices, result.faces, eye, axis_of(up, result), dpi, **paint)


def show_mesh(
    axes: Axes, vertices: FloatArray, faces: IntArray, eye: Eye, up: str, dpi: float, **paint: Any
) -> MeshPicture:
    """Show a picture of a mesh in axes whose coordinates are its pixels, row 0 at the top; see `render_mesh`."""
    picture = render_mesh(vertices, faces, size=pixels_of(axes, dpi), eye=eye, up=up, **paint)
    extent = (0, picture.camera.width, picture.camera.height, 0)
    axes.imshow(picture.image, extent=extent, interpolation="antialiased")
    axes.set_axis_off()
    return picture


CURVE_COLOR, TARGET_COLOR, KNEE_COLOR = "#35618f", "#b0413e", "#777777"


def draw_cone_curve(curve: ConeCurve, axes: Axes, *, distortion: float = DISTORTION) -> None:
    """Draw the area distortion against the number of cones, the target distortion, and the knee of the curve.

    Args:
        curve: the result of `coneflat.cone_curve`.
        axes: matplotlib axes to draw in.
        distortion: target area distortion E.
    """
    from matplotlib.ticker import MaxNLocator

    axes.plot(curve.counts, curve.distortions, color=CURVE_COLOR, marker="o", markersize=4, linewidth=1.5)
    axes.set_ylim(0.0, 1.1 * max(float(curve.distortions.max()), distortion))
    axes.axhline(distortion, color=TARGET_COLOR, linewidth=1.0, linestyle="--")
    note: Any = partial(axes.annotate, textcoords="offset points")
    end, look = (curve.counts[-1], distortion), {"ha": "right", "va": "bottom"}
    note(f"E = {distortion:g}", end, xytext=(0, 2), color=TARGET_COLOR, **look)
    axes.axvline(curve.knee, color=KNEE_COLOR, linewidth=0.8, linestyle=":")
    top, look = (curve.knee, axes.get_ylim()[1]), {"ha": "left", "va": "top"}
    note(f"knee: {curve.knee} cones", top, xytext=(3, 0), color=KNEE_COLOR, **look)
    axes.set_xlabel("number of cones")
    axes.set_ylabel("area distortion E (std. of the log conformal factor)")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
