"""The documentation's pictures of integer grids and quads."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from markers import ROOT
from measured import Measured
from quad_edges import draw_quads

import coneflat
from coneflat.apps.view import Panel, Row, compose, view_aspect
from coneflat.apps.view.figures.cone_marks import pixels_of
from coneflat.apps.view.figures.render import render_mesh
from coneflat.quadmesh.strips import find_strips

sys.path.insert(0, str(ROOT / "examples"))
from catmull_clark import catmull_clark

DPI = 110.0
TALLEST = 3.0  # inches
#: Models with a seamless checkerboard, and their view directions.
BOARDS = {"bunny": "front-right", "spot": "left-back", "hand": "front"}
#: Models with their longest strip, and their view directions.
STRIPS = {"fandisk": "front-right", "rocker-arm": "right-top", "kitten": "front-right"}
#: Models to subdivide: number of quads, and view directions.
SUBDIVIDED = {"rocker-arm": (400, "right-top"), "spot": (400, "left-back")}


def draw_board(grid: coneflat.IntegerGrid, axes: Any, *, eye: str, dpi: float = DPI) -> None:
    """Draw a model with a board whose squares have grid points and quads as their middles, in turn.

    It is the same after a quarter turn about either, so it goes on across seams; the usual board, whose squares are
    quads, changes its colours there.
    """
    turned = grid.corner_grid @ np.array([[1, 1], [1, -1]]) + 0.5
    picture = render_mesh(
        grid.vertices, grid.faces, size=pixels_of(axes, dpi), eye=eye, corner_uv=turned, cell=1.0
    )
    axes.imshow(
        picture.image, extent=(0, picture.camera.width, picture.camera.height, 0), interpolation="antialiased"
    )
    axes.set_axis_off()


def boards_figure(measured: Measured) -> Any:
    """Return a figure of models with a checkerboard without visible seams."""
    panels = []
    for model, eye in BOARDS.items():
        grid = coneflat.integer_grid(measured.path(model), quads=3000)
        panels.append(Panel(view_aspect(grid.vertices, eye), partial(draw_board, grid, eye=eye)))
    return compose([Row(panels)], dpi=DPI, width=8.0)


def quads_figure(measured: Measured) -> Any:
    """Return a figure of a quad mesh, from two sides."""
    quads = coneflat.quads(measured.path("bunny"), quads=4000)
    panels = [
        Panel(view_aspect(quads.vertices, eye), partial(draw_quads, quads, eye=eye, dpi=DPI))
        for eye in ("front-right", "back-left")
    ]
    return compose([Row(panels)], dpi=DPI, width=8.0)


def strips_figure(measured: Measured, models: Mapping[str, str] = STRIPS) -> Any:
    """Return a figure of models with their longest strip of quads, with default options and with short loops."""
    rows = []
    for loops in (False, True):
        panels = []
        for model, eye in models.items():
            quads = coneflat.quads(measured.path(model), quads=6000, loops=loops)
            drawn = partial(draw_quads, quads, eye=eye, colors=strip_colors(quads), dpi=DPI)
            panels.append(Panel(view_aspect(quads.vertices, eye), drawn))
        rows.append(Row(panels))
    return compose(rows, dpi=DPI, width=8.0)


def strip_colors(quads: coneflat.QuadMesh) -> Any:
    """Return (p, 3) a colour of each quad: orange on the longest strip."""
    strips = find_strips(quads)
    is_on = (strips.across == np.argmax(strips.lengths)).any(axis=1)
    return np.where(is_on[:, None], np.array([0.9, 0.62, 0.0]), np.array([0.94, 0.94, 0.95]))


def subdivided_figure(measured: Measured) -> Any:
    """Return a figure of coarse quads before and after a step of Catmull-Clark."""
    rows = []
    for model, (count, eye) in SUBDIVIDED.items():
        quads = coneflat.quads(measured.path(model), quads=count)
        finer = subdivided(quads)
        panels = []
        for mesh, label in ((quads, f"{len(quads.quads)} quads"), (finer, "subdivided once")):
            drawn = partial(draw_quads, mesh, eye=eye, irregular=False, dpi=DPI)
            panels.append(Panel(view_aspect(quads.vertices, eye), drawn, label))
        rows.append(Row(panels, tallest=TALLEST))
    return compose(rows, dpi=DPI, width=8.0)


def subdivided(quads: coneflat.QuadMesh) -> coneflat.QuadMesh:
    """Return quads after a step of Catmull-Clark; its vertices lie on no surface, so they have no places on it."""
    vertices, finer = catmull_clark(quads.vertices, quads.quads)
    none = np.empty((0, 3))
    return coneflat.QuadMesh(vertices, finer, np.empty(0, dtype=np.int64), none, 0, 0.0, quads.surface)
