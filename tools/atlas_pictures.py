"""Pictures of atlases for the documentation: `python tools/atlas_pictures.py [MODEL:AXIS...]`.

Draws atlas-shapes.png, the layouts of shapes that people complain about, and atlas-models.png: of the models given,
with the axis that is up, each with a checkerboard on it, and its layout.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import shapes
from palette import save_figure_small

import coneflat
from coneflat.view import draw_checker, draw_layout, new_figure

SIDE, DPI = 2.6, 110.0  # inches, dots per inch

#: Title, mesh and options.
SHAPES = {
    "cylinder of 8 sides": (shapes.cylinder(8, 1), {}),
    "cylinder of 96 sides": (shapes.cylinder(96, 40), {}),
    "the same closed, sharp edges cut": (shapes.cylinder(96, 40, caps=True), {"sharp_angle": 1.0}),
    "annulus": ((shapes.annulus()[0] * [1, 1, 0], shapes.annulus()[1]), {}),
    "box": (shapes.box(6), {}),
    "torus": (shapes.torus(), {}),
    "bottle with a hole": (shapes.bottle(), {}),
    "the same, sharp edges cut": (shapes.bottle(), {"sharp_angle": 1.0}),
}


def draw_shapes() -> None:
    """Draw the layouts of all shapes."""
    figure = new_figure(4 * SIDE, 2 * (SIDE + 0.35), dpi=DPI)
    for index, (title, (mesh, options)) in enumerate(SHAPES.items()):
        result = coneflat.flatten(*mesh, charts="atlas", **options)
        row, column = divmod(index, 4)
        axes = figure.add_axes((column / 4 + 0.01, 0.5 * (1 - row) + 0.01, 0.23, 0.42))
        draw_layout(result, axes)
        axes.set_title(title, size=9)
    save_figure_small(figure, "atlas-shapes")


def draw_models(models: list[tuple[Path, str]]) -> None:
    """Draw models, each with the axis that is up, with a checkerboard, and their layouts below."""
    figure = new_figure(SIDE * len(models), 2 * SIDE + 0.4, dpi=DPI)
    for index, (model, up) in enumerate(models):
        result = coneflat.flatten(model, charts="atlas")
        left, width = index / len(models), 1 / len(models)
        draw_checker(result, figure.add_axes((left, 0.5, width, 0.46)), up=up, cones=True, dpi=DPI)
        axes = figure.add_axes((left + 0.01, 0.02, width - 0.02, 0.46))
        draw_layout(result, axes)
        what = f"{len(result.cones)} cones, {result.distortion.charts} chart{'s'[: result.distortion.charts > 1]}"
        figure.text(left + width / 2, 0.975, f"{model.stem}: {what}", size=9, ha="center", va="center")
    save_figure_small(figure, "atlas-models")


if __name__ == "__main__":
    draw_shapes()
    if sys.argv[1:]:
        named = (word.rpartition(":") for word in sys.argv[1:])
        draw_models([(Path(name), up) for name, _, up in named])
