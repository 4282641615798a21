"""Figures of comparisons: panels in rows with a common colour scale."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from coneflat.apps import view
from coneflat.geometry import signed_double_areas
from coneflat.io import atomic_write, check_target, make_folder
from coneflat.mesh import label_faces

from .comparison import Comparison, Drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from coneflat import Flattening

DPI = 200.0


def draw_layouts(comparison: Comparison) -> Figure:
    """Return a figure of the layouts of all methods, coloured by quasi-conformal distortion on one scale.

    The colour bar has a histogram of the distortion by the first method.
    """
    shown = comparison.drawn
    quantities, layouts = on_common_scale(shown), aligned_layouts([result for _, result in shown])
    panels = [
        view.Panel(
            view.layout_aspect(result, crop=True),
            partial(view.fill_layout, result=result, quantity=quantity, dpi=DPI),
            labelled(method, result),
        )
        for (method, _), quantity, result in zip(shown, quantities, layouts, strict=True)
    ]
    return _figure_of(panels, quantities)


def draw_qualities(comparison: Comparison, look: view.Look) -> Figure:
    """Return a figure of the model with the quasi-conformal distortion of all methods on one scale."""
    quantities = on_common_scale(comparison.drawn)
    return _figure_of(quality_panels(comparison.drawn, quantities, look), quantities)


def quality_panels(shown: Drawn, quantities: Sequence[view.Quantity], look: view.Look) -> list[view.Panel]:
    """Return panels of the model for each method, coloured by its quantity."""
    return [
        panel
        for (method, result), quantity in zip(shown, quantities, strict=True)
        for panel in look.views(result, view.draw_quantity, labelled(method, result), quantity=quantity)
    ]


def aligned_layouts(results: Sequence[Flattening]) -> list[Flattening]:
    """Return results, each rotated to align its largest chart with that of the first one.

    Results with different charts are not rotated.
    """
    return [_rotated_to(result, results[0]) for result in results]


def _rotated_to(result: Flattening, model: Flattening) -> Flattening:
    has_same_faces = np.array_equal(result.faces, model.faces)
    if result is model or not has_same_faces or result.distortion.charts != model.distortion.charts:
        return result
    count, chart = label_faces(model.uv_faces, len(model.uv))
    areas = np.bincount(chart, np.abs(signed_double_areas(model.corner_uv)), count)
    # The corners of the chart with the largest area, as complex numbers.
    largest = chart == areas.argmax()
    points, model_points = (
        (layout.corner_uv[largest] @ np.array([1, 1j])).ravel() for layout in (result, model)
    )
    product = np.vdot(points - points.mean(), model_points - model_points.mean())
    if product == 0:
        return result
    rotated = (result.uv @ np.array([1, 1j])) * (product / abs(product))
    return replace(result, uv=np.stack([rotated.real, rotated.imag], axis=1))


def labelled(method: str, result: Flattening) -> str:
    """Return a label with the name of a method and its mean distortion."""
    return f"{method}: {result.distortion.qc_mean:.4f}"


def on_common_scale(shown: Drawn) -> list[view.Quantity]:
    """Return the quasi-conformal distortion by each method, with a common colour scale."""
    quantities = [view.conformal_distortion(result) for _, result in shown]
    if not quantities:
        return []
    # The scale is that of the median method, because most methods are far better than the worst.
    by_distortion = sorted((quantity.scale for quantity in quantities), key=lambda scale: scale.high)
    scale = by_distortion[(len(quantities) - 1) // 2]
    return [
        replace(quantity, scale=scale, label=f"QC, {method}")
        for (method, _), quantity in zip(shown, quantities, strict=True)
    ]


def _figure_of(panels: Sequence[view.Panel], quantities: Sequence[view.Quantity]) -> Figure:
    """Return a figure of panels with the width of a page, and one colour bar for a row."""
    return view.compose(in_rows(panels, quantities[:1]), dpi=DPI, width=10.0)


def in_rows(panels: Sequence[view.Panel], quantities: Sequence[view.Quantity] = ()) -> list[view.Row]:
    """Return panels in rows of about equal numbers, at most five."""
    tallest = 2.4  # inches
    wide = [panel.fit_label(tallest) for panel in panels]
    rows = np.array_split(np.arange(len(wide)), -(-len(wide) // 5))
    return [view.Row([wide[k] for k in row], quantities, tallest) for row in rows]


def open_folder(folder: Path, names: Iterable[str]) -> None:
    """Create a folder if it is missing, and check before long work that files can be written there.

    Raises:
        OptionError: matplotlib, which draws the figures, is not installed.
        MeshFileError: the folder cannot be created, or a file cannot be written there.
    """
    view.new_figure(1, 1)
    make_folder(folder)
    for name in names:
        check_target(folder / name)


def write_folder(folder: Path, contents: Mapping[str, str | Figure]) -> list[Path]:
    """Write texts and figures, given by file name, and return the paths."""
    for name, content in contents.items():
        if isinstance(content, str):
            with atomic_write(folder / name, "w") as file:
                file.write(content)
        else:
            view.save_figure(content, folder / name)
    return [folder / name for name in contents]
