"""Figures of a flattening, by kind, and an overview figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .... import ConeCurve
from ....base import CHECKER_CELLS, DISTORTION, DOTS_PER_INCH, IntArray, plural, short_repr
from ....errors import OptionError
from ....io import check_cells
from ..from_uv import is_from_file
from ..palettes import check_color_map
from ..quantity import Quantity, Ranges, conformal_distortion, curvature, stretch
from ..upward import axis_of, check_up
from .camera import Eye, eye_direction, view_aspect
from .compose import Panel, Row, check_pixels, compose
from .cone_marks import mark_handles
from .model import draw_checker, draw_cone_curve, draw_cones, draw_curvature, draw_quantity
from .uv_layout import draw_layout, fill_layout, layout_aspect

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .... import Flattening


@dataclass(frozen=True)
class Look:
    """Options of a figure.

    Attributes:
        size: width and height in inches; None to fit the pictures.
        dpi: resolution of the pictures in dots per inch.
        eyes: directions from the model to the eye, one for each view, see `draw_checker`.
        up: the model's upward axis, "x", "y" or "z"; "auto" is that of its format or shape, see `upward_axis`.
        colors: "sequential", "diverging" or a colour map of matplotlib, for quality, color and curvature; None for
            the defaults.
        cells: number of checkerboard cells along the square root of the surface area.
        color_charts: give the charts of the layout different colours.
        qc_max, scale_max: ends of the colour scales of the kind "quality", see `Ranges`.
        own: quantity to be shown as colours, for the kind "color".
        distortion: target area distortion of the curve.
        title: title above the figure.

    Raises:
        OptionError: an option is not valid.
    """

    size: tuple[float, float] | None = None
    dpi: float = DOTS_PER_INCH
    eyes: Sequence[Eye] = ("front-right",)
    up: str = "auto"
    colors: str | None = None
    cells: float = CHECKER_CELLS
    color_charts: bool = False
    qc_max: float | None = None
    scale_max: float | None = None
    own: Quantity | None = None
    distortion: float = DISTORTION
    title: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.eyes, str):
            object.__setattr__(self, "eyes", (self.eyes,))
        if not len(self.eyes):
            raise OptionError("eyes must name at least one direction")
        check_up(self.up)
        for eye in self.eyes:
            eye_direction(eye)
        check_pixels((1.0, 1.0) if self.size is None else self.size, self.dpi)
        check_cells(self.cells)
        Ranges(self.qc_max, self.scale_max)
        if self.colors is not None:
            check_color_map(self.colors)

    def views(
        self,
        result: Any,
        draw: Callable[..., object],
        label: str = "",
        faces: IntArray | None = None,
        **options: Any,
    ) -> list[Panel]:
        """Return a panel for each eye, in which `draw` draws the model; faces: its faces if not `result.faces`."""
        up = axis_of(self.up, result)
        draw = partial(draw, result, up=up, dpi=self.dpi, **options)
        vertices = result.vertices[np.unique(result.faces if faces is None else faces)]
        return [
            Panel(view_aspect(vertices, eye, up), partial(draw, eye=eye), label * (k == 0))
            for k, eye in enumerate(self.eyes)
        ]


_Rows: TypeAlias = "tuple[list[Row], list[Any]]"


def make_figure(shown: Flattening | ConeCurve, kind: str, **look: Any) -> Figure:
    """Return a figure for print, which `save_figure` writes.

    Args:
        shown: the flattening; for the kind "curve" a `ConeCurve`.
        kind: "layout": the charts in the unit square with cones. "checker": the model with a checkerboard texture.
            "quality": distortion of angles and of scale on the model and in the layout. "color": the quantity `own` on
            the model and in the layout. "cones": the model with cones and seams. "curvature": angle defects before and
            after flattening. "curve": area distortion against the number of cones.
        look: attributes of `coneflat.apps.view.Look`: `size` in inches, `dpi`, `eyes` (directions to the eye), upward
            axis `up`, `colors`, `cells` of the checkerboard, `color_charts`, quantity `own`, target `distortion`,
            `title`.

    Raises:
        OptionError: an option is not valid, or matplotlib is not installed.

    Examples:
        >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> figure = coneflat.make_figure(coneflat.flatten(vertices, faces), "layout", size=(4, 4))
        >>> len(figure.axes)
        1
    """
    if not isinstance(kind, str) or kind not in KINDS:
        raise OptionError(f"unknown kind of figure {short_repr(kind)}: choose from {', '.join(KINDS)}")
    if isinstance(shown, ConeCurve) != (kind == "curve"):
        raise OptionError("results of `coneflat.cone_curve` are shown by figures of the kind 'curve' only")
    if kind != "curve" and not hasattr(shown, "uv_faces"):
        raise OptionError(f"expected a result of `coneflat.flatten`, got {short_repr(shown)}")
    chosen = Look(**look)
    rows, marks = _ROWS[kind](shown, chosen)
    return compose(rows, title=chosen.title, marks=marks, size=chosen.size, dpi=chosen.dpi)


def _layout(result: Flattening, look: Look) -> _Rows:
    draw = partial(draw_layout, result, color_charts=look.color_charts)
    return [Row([Panel(layout_aspect(result, crop=False), draw)])], mark_handles(result, seams=False)


def _checker(result: Flattening, look: Look) -> _Rows:
    return [Row(look.views(result, draw_checker, cells=look.cells))], mark_handles(result, cones=False)


def _cones(result: Flattening, look: Look) -> _Rows:
    return [Row(look.views(result, draw_cones))], mark_handles(result)


def _quality(result: Flattening, look: Look) -> _Rows:
    quantities = (conformal_distortion(result, look.qc_max), stretch(result, look.scale_max))
    return [_coloured(result, look, quantity) for quantity in quantities], []


def _color(result: Flattening, look: Look) -> _Rows:
    if look.own is None:
        raise OptionError("a figure of the kind 'color' needs a quantity: give `own`")
    return [_coloured(result, look, look.own)], []


def _coloured(result: Flattening, look: Look, quantity: Quantity) -> Row:
    """Return a row with views of the model and the layout, coloured by a quantity."""
    shown = quantity.recolored(look.colors)

    in_layout = partial(fill_layout, result=result, quantity=shown, dpi=look.dpi)
    layout = Panel(layout_aspect(result, crop=True), in_layout)
    return Row([*look.views(result, draw_quantity, quantity=shown), layout], [shown])


def _curvature(result: Flattening, look: Look) -> _Rows:
    rows = []
    for flat, label in ((False, "On the model"), (True, "After flattening")):
        panels = look.views(result, draw_curvature, label, flat=flat, colors=look.colors)
        rows.append(Row(panels, [curvature(result, flat).recolored(look.colors)]))
    if len(look.eyes) == 1:
        before, after = rows
        rows = [Row([*before.panels, *after.panels], [*before.quantities, *after.quantities])]
    return rows, mark_handles(result, seams=False)


def _curve(curve: ConeCurve, look: Look) -> _Rows:
    panel = Panel(1.6, partial(draw_cone_curve, curve, distortion=look.distortion), is_graph=True)
    return [Row([panel], tallest=3.2)], []


_ROWS: dict[str, Callable[[Any, Look], _Rows]] = {
    "layout": _layout,
    "checker": _checker,
    "quality": _quality,
    "cones": _cones,
    "curvature": _curvature,
    "color": _color,
    "curve": _curve,
}

KINDS = tuple(_ROWS)


def demo_figure(result: Flattening) -> Figure:
    """Return an overview figure of a flattening: the textured model, its layout, its distortion from two sides.

    Raises:
        OptionError: matplotlib is not installed.
    """
    front, two_sided = Look(dpi=220.0), Look(dpi=220.0, eyes=("front-right", "back-left"))
    quality = conformal_distortion(result)
    panels = [
        *front.views(result, draw_checker, "Model, textured by its UVs", cones=True),
        Panel(layout_aspect(result, crop=True), partial(draw_layout, result, crop=True), "UV layout"),
        *two_sided.views(result, draw_quantity, "Distortion, front and back", quantity=quality),
    ]
    rows = [Row(panels, [quality])]
    return compose(rows, title=title(result), marks=mark_handles(result), dpi=two_sided.dpi, width=10.0)


def title(result: Flattening) -> str:
    """Return the main measures in one line."""
    measures = result.distortion
    parts = [
        plural(len(result.faces), "triangle"),
        *([] if is_from_file(result) else [plural(len(result.cones), "cone")]),
        f"QC mean {measures.qc_mean:.4f}",
        f"{measures.flipped:,} flipped",
        f"seam length {measures.seam_length:.2f} √area",
    ]
    return "  ·  ".join(parts if result.source is None else [result.source.path.name, *parts])
