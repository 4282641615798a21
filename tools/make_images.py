"""Draw the pictures of the documentation: `python tools/make_images.py FOLDER [PART...]`.

The folder holds the models named below; the sample comes with the package. Parts are methods, kinds, steps and gallery;
without any, all are drawn.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from palette import save_figure_small
from scipy.sparse import csr_matrix, identity

import coneflat
from coneflat.geometry.operators import vertex_areas
from coneflat.view import demo_figure
from coneflat.view.figures.camera import view_aspect
from coneflat.view.figures.compose import Panel, Row, compose
from coneflat.view.figures.cone_marks import mark_handles
from coneflat.view.figures.model import draw_quantity
from coneflat.view.figures.uv_layout import layout_aspect
from coneflat.view.quantity import ColorScale, Quantity, curvature

DPI = 170.0
GALLERY_DPI = 110.0

#: How to look at the models that all kinds of figures are shown of.
LOOKS: dict[str, dict[str, Any]] = {
    "fandisk.obj": {"up": "x", "eyes": ["right-front", "left-back"]},
    "bunny.obj": {"eyes": ["front-right", "back-left"]},
    "horse.ply": {"up": "z", "eyes": ["right-back", "left-front"]},
}
#: How to look at those of the gallery.
GALLERY: dict[str, tuple[str, str, str]] = {
    "3holes.off": ("y", "front-top", "back-right"),
    "bunny.obj": ("y", "front-right", "back-left"),
    "camelhead.off": ("y", "front-right", "back-left"),
    "elephant.obj": ("y", "front-right", "back-left"),
    "face.obj": ("y", "front-right", "front-left"),
    "fandisk.obj": ("x", "right-front", "left-back"),
    "hand.obj": ("y", "front-right", "back-left"),
    "horse.ply": ("z", "right-back", "left-front"),
    "kitten.obj": ("y", "front-right", "back-left"),
    "rocker-arm.obj": ("y", "front-right", "back-left"),
}
#: The kinds that show one view, for two would be small.
SINGLE = ("quality", "curvature")


def curvature_figure(path: Path) -> Any:
    """Return a figure of what curvature a model has, and what the linear and the exact metric leave of it."""
    linear = coneflat.flatten(path, **coneflat.PAPER)
    exact = coneflat.flatten(path)
    labels = ("On the model", "After the linear metric", "After the exact metric")
    panels = [
        Panel(
            view_aspect(result.vertices), partial(coneflat.draw_curvature, result, flat=flat, dpi=DPI), label
        )
        for result, flat, label in zip((exact, linear, exact), (False, True, True), labels, strict=True)
    ]
    left = [
        replace(curvature(result, True), label=f"|K| left, {name} metric")
        for result, name in ((linear, "linear"), (exact, "exact"))
    ]
    return compose([Row(panels, left)], dpi=DPI, width=9.0)


def quarters_figure(path: Path) -> Any:
    """Return a figure of a model with a checkerboard: with any cones, and with cones of whole quarter turns."""
    free = coneflat.flatten(path)
    quarters = coneflat.flatten(path, quantise=np.pi / 2, correct_handles=True)
    assert quarters.rotations is not None
    off = f"{quarters.rotations.worst:.0e}"
    labels = (
        f"Any curvatures: {len(free.cones)} cones",
        f"Multiples of a quarter turn, to {off} rad: {len(quarters.cones)} cones",
    )
    panels = [
        Panel(
            view_aspect(result.vertices), partial(coneflat.draw_checker, result, cones=True, dpi=DPI), label
        )
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
    lengths = coneflat.edge_lengths(result.vertices, faces)
    mesh = coneflat.TriangleMesh(result.vertices, faces)
    curvature = coneflat.angle_defect(faces, coneflat.corner_angles(lengths), mesh.is_boundary_vertex)
    area = vertex_areas(faces, lengths, count)
    ends = faces[:, [0, 1, 2, 1, 2, 0]].ravel(), faces[:, [1, 2, 0, 0, 1, 2]].ravel()
    around = identity(count) + csr_matrix((np.ones(len(ends[0])), ends), shape=(count, count))
    for _ in range(rounds):
        curvature, area = around @ curvature, around @ area
    return curvature / area


def steps_figure(path: Path) -> Any:
    """Return a figure of the steps from a model to its texture."""
    result = coneflat.flatten(path, charts="atlas")
    eye, look = "front-right", {"dpi": DPI}

    def draw(quantity: Quantity, axes: Any) -> None:
        draw_quantity(axes, result, quantity, eye, "y", DPI)

    curved = on_vertices(result, even_curvature(result), "RdGy_r", 95)
    scaled = on_vertices(result, result.log_scale - np.nanmean(result.log_scale), "PuOr_r", 99)

    def draw_dots(axes: Any) -> None:
        bare = replace(result, seams=np.empty((0, 2), dtype=np.int64))
        coneflat.draw_cones(bare, axes, eye=eye, **look)

    aspect = view_aspect(result.vertices, eye)
    model = [
        (partial(draw, curved), "1  Curvature of the model"),
        (draw_dots, f"2  Cones that are to carry it: {len(result.cones)}"),
        (partial(draw, scaled), "3  Metric: scaled to be flat"),
        (partial(coneflat.draw_cones, result, eye=eye, **look), "4  Cut through the cones"),
    ]
    panels = [Panel(aspect, drawn, label) for drawn, label in model]
    panels += [
        Panel(
            aspect,
            partial(coneflat.draw_layout, result, edges=False, crop=True),
            "5  Layout of the flat metric",
        ),
        Panel(
            aspect, partial(coneflat.draw_checker, result, eye=eye, **look), "6  What it puts on the model"
        ),
    ]
    return compose([Row(panels[:3]), Row(panels[3:])], dpi=DPI, marks=mark_handles(result))


def gallery_figure(path: Path, up: str, *eyes: str) -> Any:
    """Return a figure of a model with a checkerboard from two sides, and of its layout."""
    result = coneflat.flatten(path, charts="atlas")
    panels = [
        Panel(
            view_aspect(result.vertices, eye, up),
            partial(coneflat.draw_checker, result, eye=eye, up=up, cones=True, dpi=GALLERY_DPI),
        )
        for eye in eyes
    ]
    layout = partial(coneflat.draw_layout, result, edges=False, color_charts=True, crop=True)
    panels.append(Panel(layout_aspect(result, crop=True), layout))
    measures, cones = result.distortion, len(result.cones)
    print(
        f"| {path.stem} | {len(result.faces):,} | {cones} | {measures.charts} | {measures.qc_mean:.3f} | "
        f"{measures.area_std:.2f} | {measures.seam_length:.2f} |"
    )
    return compose([Row(panels)], dpi=GALLERY_DPI, width=8.0)


def draw_kinds(path: Path, **look: Any) -> None:
    """Draw a figure of every kind."""
    result = coneflat.flatten(path, charts="atlas")
    for kind in ("layout", "checker", "quality", "cones", "curvature"):
        eyes = look["eyes"][:1] if kind in SINGLE else look["eyes"]
        save_figure_small(
            coneflat.make_figure(result, kind, dpi=DPI, **{**look, "eyes": eyes}), f"{path.stem}-{kind}"
        )
    curve = coneflat.cone_curve(path)
    save_figure_small(coneflat.make_figure(curve, "curve", dpi=DPI), f"{path.stem}-curve")


def main(folder: Path, parts: list[str]) -> None:
    """Draw everything, or some parts."""
    parts = parts or ["methods", "kinds", "steps", "gallery"]
    if "methods" in parts:
        save_figure_small(demo_figure(coneflat.flatten(coneflat.sample_path(), charts="atlas")), "sample")
        save_figure_small(curvature_figure(folder / "bunny.obj"), "curvature")
        save_figure_small(quarters_figure(folder / "bunny.obj"), "quarters")
    if "kinds" in parts:
        for name, look in LOOKS.items():
            draw_kinds(folder / name, **look)
    if "steps" in parts:
        save_figure_small(steps_figure(folder / "bunny.obj"), "steps")
    if "gallery" in parts:
        for name, (up, *eyes) in GALLERY.items():
            path = folder / name
            save_figure_small(gallery_figure(path, up, *eyes), f"gallery-{path.stem}")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
