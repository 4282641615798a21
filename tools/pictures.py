"""The pictures of the documentation, from the same flattenings as its numbers."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from fnmatch import fnmatch
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np
from markers import ROOT
from measured import Measured
from palette import IMAGES, save_figure_small, save_small
from pattern_pictures import (
    EXAMPLES,
    PDF_TO_PNG,
    draw_model_of,
    draw_pieces,
    has_pdf_reader,
    pages_picture,
)
from PIL import Image
from quad_edges import draw_quads
from quad_pictures import (
    BOARDS,
    STRIPS,
    SUBDIVIDED,
    boards_figure,
    quads_figure,
    strips_figure,
    subdivided_figure,
)
from scipy.sparse import csr_matrix, identity
from tables import ALLOWED, GALLERY, TRADED, TRADEOFF, tradeoff

import coneflat
from coneflat.apps.view import (
    Panel,
    Quantity,
    Row,
    compose,
    demo_figure,
    draw_checker,
    draw_cones,
    draw_layout,
    draw_quantity,
    layout_aspect,
    mark_handles,
    new_figure,
    view_aspect,
)
from coneflat.apps.view.figures.model import draw_curvature
from coneflat.apps.view.quantity import ColorScale, curvature
from coneflat.geometry.operators import vertex_areas

sys.path.insert(0, str(ROOT / "tests"))
import shapes
from chromium import browser_path
from comparisons import COMPARED_METHODS
from comparisons.pictures import draw_layouts

DPI = 170.0
GALLERY_DPI = 110.0
SIDE = 2.6  # Inches of a panel of an atlas.
FUNCTION_WIDTH = 4.0  # Inches of the pictures of functions, four of which stand side by side.

#: How to look at the models that all kinds of figures are shown of.
LOOKS: dict[str, dict[str, Any]] = {
    "fandisk": {"up": "x", "eyes": ["right-front", "left-back"]},
    "bunny": {"eyes": ["front-right", "back-left"]},
    "horse": {"up": "z", "eyes": ["right-back", "left-front"]},
}
KINDS = ("layout", "checker", "quality", "cones", "curvature")
#: The kinds with one view, because two would be small.
SINGLE = ("quality", "curvature")
#: How to look at those of the gallery: what is up, and two eyes.
SIGHTS = dict.fromkeys(GALLERY, ("y", "front-right", "back-left")) | {
    "3holes": ("y", "front-top", "back-right"),
    "face": ("y", "front-right", "front-left"),
    "fandisk": ("x", "right-front", "left-back"),
    "horse": ("z", "right-back", "left-front"),
}
#: Pictures taken in a browser, and their models.
SCREENSHOTS = {
    "viewer": "bunny",
    "viewer-quads": "spot",
    "studio": "bunny",
    "studio-phone": "bunny",
    "studio-session": "bunny",
}
#: Models with their layouts below, and what is up.
ATLAS_MODELS = {"bunny": "y", "hand": "y", "horse": "z", "rocker-arm": "y", "kitten": "y"}
#: Shapes that people complain about: title, mesh and options.
SHAPES: dict[str, tuple[Any, dict[str, Any]]] = {
    "cylinder of 8 sides": (shapes.cylinder(8, 1), {}),
    "cylinder of 96 sides": (shapes.cylinder(96, 40), {}),
    "the same closed, sharp edges cut": (shapes.cylinder(96, 40, caps=True), {"sharp_angle": 1.0}),
    "annulus": ((shapes.annulus()[0] * [1, 1, 0], shapes.annulus()[1]), {}),
    "box": (shapes.box(6), {}),
    "torus": (shapes.torus(), {}),
    "bottle with a hole": (shapes.bottle(), {}),
    "the same, sharp edges cut": (shapes.bottle(), {"sharp_angle": 1.0}),
}


def draw_pictures(measured: Measured, names: list[str]) -> None:
    """Draw the pictures whose names match; those whose models are not there are left, which is said."""
    for name, (models, draw) in PICTURES.items():
        if any(fnmatch(name, pattern) for pattern in names) and measured.has(*models):
            save_figure_small(draw(measured), name)
    if any(fnmatch("convergence", pattern) for pattern in names):
        _draw_convergence()
    for name, example in EXAMPLES.items():
        if any(fnmatch(name, pattern) for pattern in names) and measured.has(*example.models):
            if has_pdf_reader():
                save_small(pages_picture(example, name, measured), name, dither=False)
            else:
                print(f"{PDF_TO_PNG} is not installed: {name} is left as it is")
    for name, model in SCREENSHOTS.items():
        if any(fnmatch(name, pattern) for pattern in names) and measured.has(model):
            _take_screenshots(name, model, measured)


def _draw_convergence() -> None:
    path = IMAGES / "convergence.png"
    subprocess.run(
        [sys.executable, ROOT / "benchmarks" / "convergence.py", "-o", path],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    with Image.open(path) as picture:
        save_small(picture.copy(), path.stem, dither=False)


def _take_screenshots(name: str, model: str, measured: Measured) -> None:
    """Take the pictures of the viewer and of the studio, where there is a browser."""
    if find_spec("playwright") is None:
        print(f"playwright is not installed: {name} is left as it is")
        return
    from screenshots import take_screenshot_of_quads, take_screenshots
    from studio_pictures import take_phone, take_session, take_studio

    taken = {
        "viewer": lambda: take_screenshots(measured.flattening(model)),
        "viewer-quads": lambda: take_screenshot_of_quads(
            coneflat.quads(measured.path(model), quads=3000), model
        ),
        "studio": lambda: take_studio(measured.path(model)),
        "studio-phone": lambda: take_phone(measured.path(model)),
        "studio-session": lambda: take_session(measured.path(model)),
    }
    if browser_path() is None:
        print(f"there is no Chromium: {name} is left as it is")
    else:
        taken[name]()


def curvature_figure(measured: Measured) -> Any:
    """Return a figure of what curvature a model has, and what the linear and the exact metric leave of it."""
    linear = coneflat.flatten(measured.path("bunny"), **coneflat.PAPER)
    exact = measured.flattening("bunny")
    labels = ("On the model", "After the linear metric", "After the exact metric")
    panels = [
        Panel(view_aspect(result.vertices), partial(draw_curvature, result, flat=flat, dpi=DPI), label)
        for result, flat, label in zip((exact, linear, exact), (False, True, True), labels, strict=True)
    ]
    left = [
        replace(curvature(result, True), label=f"|K| left, {name} metric")
        for result, name in ((linear, "linear"), (exact, "exact"))
    ]
    return compose([Row(panels, left)], dpi=DPI, width=9.0)


def quarters_figure(measured: Measured) -> Any:
    """Return a figure of a model with a checkerboard: with any cone angles, and with multiples of pi/2."""
    free = measured.flattening("bunny")
    quarters = coneflat.flatten(measured.path("bunny"), quantise=np.pi / 2, correct_handles=True)
    assert quarters.rotations is not None
    off = f"{quarters.rotations.worst:.0e}"
    labels = (
        f"Any curvatures: {len(free.cones)} cones",
        f"Multiples of a quarter turn, to {off} rad: {len(quarters.cones)} cones",
    )
    panels = [
        Panel(view_aspect(result.vertices), partial(draw_checker, result, cones=True, dpi=DPI), label)
        for result, label in zip((free, quarters), labels, strict=True)
    ]
    return compose([Row(panels)], marks=mark_handles(free), dpi=DPI)


def on_vertices(result: coneflat.Flattening, values: Any, colors: str, percent: float) -> Quantity:
    """Return numbers at vertices, to be shown around 0; beyond the percentile of their amounts nothing changes."""
    top = float(np.nanpercentile(np.abs(values), percent))
    scale = ColorScale(-top, top, colors, "linear", ((-top, f"{-top:.2g}"), (0.0, "0"), (top, f"{top:.2g}")))
    return Quantity("", values, np.isfinite(values) * 1.0, scale, ".2f", result.faces)


def even_curvature(result: coneflat.Flattening, rounds: int = 4) -> Any:
    """Return the curvature per area at the vertices, each the mean of what is around."""
    faces, count = result.faces, len(result.vertices)
    lengths = coneflat.geometry.edge_lengths(result.vertices, faces)
    mesh = coneflat.TriangleMesh(result.vertices, faces)
    curvature = coneflat.geometry.angle_defect(
        faces, coneflat.geometry.corner_angles(lengths), mesh.is_boundary_vertex
    )
    area = vertex_areas(faces, lengths, count)
    ends = faces[:, [0, 1, 2, 1, 2, 0]].ravel(), faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    around = identity(count) + csr_matrix((np.ones(len(ends[0])), ends), shape=(count, count))
    for _ in range(rounds):
        curvature, area = around @ curvature, around @ area
    return curvature / area


def steps_figure(measured: Measured) -> Any:
    """Return a figure of the steps from a model to its texture."""
    result = measured.flattening("bunny")
    eye, look = "front-right", {"dpi": DPI}

    def draw(quantity: Quantity, axes: Any) -> None:
        draw_quantity(result, axes, quantity, eye, "y", DPI)

    curved = on_vertices(result, even_curvature(result), "RdGy_r", 95)
    scaled = on_vertices(result, result.log_scale - np.nanmean(result.log_scale), "PuOr_r", 99)

    def draw_dots(axes: Any) -> None:
        bare = replace(result, seams=np.empty((0, 2), dtype=np.int64))
        draw_cones(bare, axes, eye=eye, **look)

    aspect = view_aspect(result.vertices, eye)
    model = [
        (partial(draw, curved), "1  Curvature of the model"),
        (draw_dots, f"2  Cones that are to carry it: {len(result.cones)}"),
        (partial(draw, scaled), "3  Metric: scaled to be flat"),
        (partial(draw_cones, result, eye=eye, **look), "4  Cut through the cones"),
    ]
    panels = [Panel(aspect, drawn, label) for drawn, label in model]
    panels += [
        Panel(
            aspect,
            partial(draw_layout, result, edges=False, crop=True),
            "5  Layout of the flat metric",
        ),
        Panel(aspect, partial(draw_checker, result, eye=eye, **look), "6  What it puts on the model"),
    ]
    return compose([Row(panels[:3]), Row(panels[3:])], dpi=DPI, marks=mark_handles(result))


def map_figure(function: Callable[..., coneflat.Flattening], measured: Measured) -> Any:
    """Return a small figure of what a function does to a model: its checkerboard and its layout."""
    result = function(measured.path("spot"))
    checker = partial(draw_checker, result, eye="left-front", dpi=DPI)
    layout = partial(draw_layout, result, edges=False, color_charts=True, crop=True)
    panels = [
        Panel(view_aspect(result.vertices, "left-front"), checker),
        Panel(layout_aspect(result, crop=True), layout),
    ]
    return compose([Row(panels)], dpi=DPI, width=FUNCTION_WIDTH)


def quad_figure(measured: Measured) -> Any:
    """Return a small figure of the quads of a model from two sides."""
    quads = coneflat.quads(measured.path("spot"), quads=2000)
    panels = [
        Panel(view_aspect(quads.vertices, eye), partial(draw_quads, quads, eye=eye, irregular=False, dpi=DPI))
        for eye in ("left-front", "right-back")
    ]
    return compose([Row(panels)], dpi=DPI, width=FUNCTION_WIDTH)


def pattern_figure(measured: Measured) -> Any:
    """Return a small figure of the pieces of a pattern, on the model and laid out."""
    pattern = coneflat.pattern(
        measured.path("spot"), height="400mm", axis=(0, 1, 0), strain="6%", page="none"
    )
    drawing = pattern.drawing()
    draw_model = partial(draw_model_of, pattern, eye="left-front", dpi=DPI)
    panels = [
        Panel(view_aspect(pattern.surface.mesh.vertices, "left-front"), draw_model),
        Panel(drawing.width / drawing.height, partial(draw_pieces, pattern)),
    ]
    return compose([Row(panels)], dpi=DPI, width=FUNCTION_WIDTH)


def gallery_figure(model: str, measured: Measured) -> Any:
    """Return a figure of a model with a checkerboard from two sides, and of its layout."""
    result, (up, *eyes) = measured.flattening(model), SIGHTS[model]
    panels = [
        Panel(
            view_aspect(result.vertices, eye, up),
            partial(draw_checker, result, eye=eye, up=up, cones=True, dpi=GALLERY_DPI),
        )
        for eye in eyes
    ]
    layout = partial(draw_layout, result, edges=False, color_charts=True, crop=True)
    panels.append(Panel(layout_aspect(result, crop=True), layout))
    return compose([Row(panels)], dpi=GALLERY_DPI, width=8.0)


def kind_figure(model: str, kind: str, measured: Measured) -> Any:
    """Return a figure of a kind."""
    look = LOOKS[model]
    eyes = look["eyes"][:1] if kind in SINGLE else look["eyes"]
    return coneflat.make_figure(measured.flattening(model), kind, dpi=DPI, **{**look, "eyes": eyes})


def curve_figure(model: str, measured: Measured) -> Any:
    """Return a figure of the area distortion against the number of cones."""
    return coneflat.make_figure(coneflat.cone_curve(measured.path(model)), "curve", dpi=DPI)


def shapes_figure(_: Measured) -> Any:
    """Return a figure of the layouts of all shapes."""
    figure = new_figure(4 * SIDE, 2 * (SIDE + 0.35), dpi=GALLERY_DPI)
    for index, (title, (mesh, options)) in enumerate(SHAPES.items()):
        row, column = divmod(index, 4)
        axes = figure.add_axes((column / 4 + 0.01, 0.5 * (1 - row) + 0.01, 0.23, 0.42))
        draw_layout(coneflat.flatten(*mesh, **options), axes)
        axes.set_title(title, size=9)
    return figure


def atlases_figure(measured: Measured) -> Any:
    """Return a figure of models with a checkerboard, and their layouts below."""
    figure = new_figure(SIDE * len(ATLAS_MODELS), 2 * SIDE + 0.4, dpi=GALLERY_DPI)
    for index, (model, up) in enumerate(ATLAS_MODELS.items()):
        result = measured.flattening(model)
        left, width = index / len(ATLAS_MODELS), 1 / len(ATLAS_MODELS)
        axes = figure.add_axes((left, 0.5, width, 0.46))
        draw_checker(result, axes, up=up, cones=True, dpi=GALLERY_DPI)
        draw_layout(result, figure.add_axes((left + 0.01, 0.02, width - 0.02, 0.46)))
        charts = result.distortion.charts
        title = f"{model}: {len(result.cones)} cones, {charts} chart{'s'[: charts > 1]}"
        figure.text(left + width / 2, 0.975, title, size=9, ha="center", va="center")
    return figure


def methods_figure(measured: Measured) -> Any:
    """Return a figure of the layouts of one model by all methods."""
    return draw_layouts(measured.comparison("rocker-arm", COMPARED_METHODS))


#: What is drawn of the trade: the largest number shown for each.
TOPS = {"cones": (0, 60), "qc_mean": (1, 1.15), "seam_length": (0, 8), "overlap": (0, 0.6)}


def tradeoff_figure(measured: Measured) -> Any:
    """Return a figure of what the number of cones does: a line per model, and the medians."""
    measures = tradeoff(measured)
    assert measures is not None
    figure = new_figure(13.0, 3.6)
    for k, (key, (low, high)) in enumerate(TOPS.items()):
        factor = 100 if key == "overlap" else 1
        values = factor * measures[:, :, list(TRADEOFF).index(key)]
        axes = figure.add_axes((0.05 + 0.245 * k, 0.15, 0.19, 0.72))
        axes.plot(ALLOWED, values, color="#9db4c8", linewidth=0.8)
        red = {"color": "#b0413e", "linewidth": 2.2, "marker": "o", "markersize": 4}
        axes.plot(ALLOWED, np.median(values, axis=1), **red)
        axes.axvline(0.2, color="#888888", linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_xticks(ALLOWED, [f"{allowed:g}" for allowed in ALLOWED], fontsize=7)
        axes.minorticks_off()
        axes.invert_xaxis()
        axes.set_ylim(factor * low, factor * high)
        axes.set_title(TRADEOFF[key], fontsize=10)
        axes.set_xlabel("area distortion E allowed", fontsize=9)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return figure


def relaxed_figure(measured: Measured) -> Any:
    """Return a figure of the triangles around the most bent one, before and after they are relaxed."""
    before, after = (coneflat.flatten(measured.path("3holes"), relax=relax) for relax in ("off", "auto"))
    worst = int(np.nanargmax(before.distortion.qc))
    figure = new_figure(8.0, 4.15, dpi=DPI)
    for index, (result, label) in enumerate(((before, "before"), (after, "after"))):
        axes = figure.add_axes((0.02 + 0.49 * index, 0.02, 0.47, 0.91))
        _draw_around(axes, result, worst)
        d = result.distortion
        axes.set_title(f"{label}: mean {d.qc_mean:.3f}, worst {d.qc_max:.3g}", fontsize=10)
    return figure


def _draw_around(axes: Any, result: coneflat.Flattening, face: int, reach: float = 5.0) -> None:
    """Draw the layout around a triangle, as far as so many edges; colours are the triangles' distortion, to 3."""
    from matplotlib.collections import PolyCollection

    corners = result.corner_uv
    middle = corners[face].mean(axis=0)
    edge = float(np.median(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)))
    is_near = (np.abs(corners.mean(axis=1) - middle) < (reach + 2) * edge).all(axis=1)
    shown = PolyCollection(
        list(corners[is_near]),
        array=result.distortion.qc[is_near],
        cmap="YlOrRd",
        clim=(1, 3),
        edgecolor="#555555",
    )
    shown.set_linewidth(0.5)
    axes.add_collection(shown)
    axes.set_xlim(middle[0] - reach * edge, middle[0] + reach * edge)
    axes.set_ylim(middle[1] - reach * edge, middle[1] + reach * edge)
    axes.set_aspect("equal")
    axes.axis("off")


def dial_figure(measured: Measured) -> Any:
    """Return a figure of a model with a checkerboard, from angles kept to areas kept, and of its layouts."""
    panels, layouts = [], []
    for stretch in (0.0, 0.5, 1.0):
        result = coneflat.flatten(measured.path("bunny"), stretch=stretch)
        d = result.distortion
        label = f"stretch {stretch:g}: angles {d.qc_mean:.3f}, areas {d.area_std:.3f}"
        panels.append(Panel(view_aspect(result.vertices), partial(draw_checker, result, dpi=DPI), label))
        layout = partial(draw_layout, result, edges=False, crop=True)
        layouts.append(Panel(layout_aspect(result, crop=True), layout))
    return compose([Row(panels), Row(layouts)], dpi=DPI)


#: Name of each picture, the models that it needs, and the function that draws it.
PICTURES: dict[str, tuple[tuple[str, ...], Callable[[Measured], Any]]] = {
    "sample": ((), lambda measured: demo_figure(measured.flattening("sample"))),
    "function-flatten": (("spot",), partial(map_figure, coneflat.flatten)),
    "function-unwrap": (("spot",), partial(map_figure, coneflat.unwrap)),
    "function-quads": (("spot",), quad_figure),
    "function-pattern": (("spot",), pattern_figure),
    "atlas-shapes": ((), shapes_figure),
    "curvature": (("bunny",), curvature_figure),
    "quarters": (("bunny",), quarters_figure),
    "relaxed": (("3holes",), relaxed_figure),
    "dial": (("bunny",), dial_figure),
    "steps": (("bunny",), steps_figure),
    **{f"gallery-{model}": ((model,), partial(gallery_figure, model)) for model in GALLERY},
    **{f"{model}-{kind}": ((model,), partial(kind_figure, model, kind)) for model in LOOKS for kind in KINDS},
    **{f"{model}-curve": ((model,), partial(curve_figure, model)) for model in LOOKS},
    "atlas-models": (tuple(ATLAS_MODELS), atlases_figure),
    "methods": (("rocker-arm",), methods_figure),
    "tradeoff": (TRADED, tradeoff_figure),
    "quads": (("bunny",), quads_figure),
    "quads-board": (tuple(BOARDS), boards_figure),
    "quads-strips": (tuple(STRIPS), strips_figure),
    "quads-subdivided": (tuple(SUBDIVIDED), subdivided_figure),
}
