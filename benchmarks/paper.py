"""Section 5 of the paper: its tables and figures, with the paper's numbers for comparison.

    python benchmarks/paper.py                               # fandisk and rocker-arm, from tests/data
    python benchmarks/paper.py foot.ply gargoyle.ply -o paper

Models are recognised by their file names: fandisk, rocker-arm, foot, gargoyle, elephant, horse, hand, torso, isi-horse.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from common import MODELS as MODEL_FOLDER
from comparisons import Comparison, compare_methods, pictures
from comparisons.tables import as_cell, as_csv, as_markdown

from coneflat import PAPER, ConeflatError, read_mesh
from coneflat.apps.view import (
    Look,
    Panel,
    Row,
    compose,
    draw_checker,
    draw_cones,
    draw_layout,
    layout_aspect,
    mark_handles,
)
from coneflat.base import Progress, plural
from coneflat.errors import MeshError
from coneflat.io import find_meshes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from coneflat import Flattening
    from coneflat.apps.view import Quantity


@dataclass(frozen=True)
class Published:
    """A model's row in the paper's tables.

    Attributes:
        thousands: number of triangles in thousands.
        curvature_error: ||K_target - K|| / n divided by pi, for the paper's method.
        qc: mean QC distortion by method, where it is given.
        seconds: running time by method, where it is given.
    """

    thousands: float
    curvature_error: float
    qc: Mapping[str, float]
    seconds: Mapping[str, float]

    def has_same_size(self, triangles: int) -> bool:
        """Return whether a number of triangles is that of the paper's mesh, rounded to thousands or within 3 %."""
        return abs(triangles / 1000 - self.thousands) <= max(0.03 * self.thousands, 0.5)


#: Names of the methods in the paper, by their names here. In the paper, circle patterns used the given triangles
#: without flips, and linear ABF left cones free.
NAMES = {"circle-patterns/fixed": "CP", "linear-abf/free": "LABF", "linear": "CF"}


def _by_method(*numbers: float) -> dict[str, float]:
    """Return the numbers of CP, LABF and CF by method; with fewer numbers, those of the last ones."""
    return dict(zip(list(NAMES)[-len(numbers) :], numbers, strict=True))


#: Published numbers by model, in the paper's order.
MODELS = {
    "fandisk": Published(13, 4.6e-6, _by_method(1.013, 1.007, 1.012), _by_method(20, 0.9, 0.5)),
    "rockerarm": Published(20, 1.4e-5, _by_method(1.045, 1.027, 1.028), _by_method(21, 1.5, 0.4)),
    "foot": Published(20, 2.7e-5, _by_method(1.029, 1.016, 1.020), _by_method(29, 1.4, 0.6)),
    "gargoyle": Published(20, 2.9e-5, _by_method(1.213, 1.032, 1.037), _by_method(29, 1.6, 0.7)),
    "elephant": Published(40, 1.6e-5, _by_method(1.028, 1.022, 1.027), _by_method(44, 4.8, 1.1)),
    "horse": Published(40, 1.8e-5, _by_method(1.035, 1.017, 1.077), _by_method(62, 4.1, 1.3)),
    "hand": Published(106, 3.2e-6, _by_method(1.009, 1.008, 1.009), _by_method(903, 26, 3.8)),
    "torso": Published(284, 1.4e-6, _by_method(1.004, 1.005), _by_method(86, 24)),
    "isi-horse": Published(358, 8.4e-7, _by_method(1.009), _by_method(32)),
}


#: Models of the paper in its resolution that are in `tests/data`.
STORED = ("fandisk.obj", "rocker-arm.obj")


def model_of(path: Path) -> str | None:
    """Return the name of the paper's model in a file name; None if there is none."""
    stem = re.sub(r"[^a-z0-9]", "", path.stem.lower())
    return next((name for name in MODELS if name.replace("-", "") == stem), None)


#: Methods that the paper compares; then others: circle patterns with flips, linear ABF with cones, the exact metric.
METHODS = (*NAMES, "circle-patterns", "linear-abf", "exact")
TABLE_1 = ("model", "triangles", "paper's", "cones", "curvature error, pi", "paper's error", "error ratio")
TABLE_2 = ("model", "method", "QC mean", "paper's QC", "QC ratio", "time, s", "paper's time", "time ratio")
# Formats of their numbers.
FORMS_1 = ("", ",d", "", "d", ".2e", ".2e", ".2f")
FORMS_2 = ("", "", ".4f", ".3f", ".3f", ".2f", ".3g", ".3f")


@dataclass(frozen=True, eq=False)
class Model:
    """A mesh and the results of the methods.

    Attributes:
        name: the name in the paper if it has the model, else that of the file.
        published: the paper's numbers, or None.
        comparison: the results of the methods.
    """

    name: str
    published: Published | None
    comparison: Comparison

    @property
    def is_same(self) -> bool:
        """Whether the mesh has the resolution of the paper's."""
        return self.published is not None and self.published.has_same_size(len(self.linear.faces))

    @property
    def linear(self) -> Flattening:
        """The result of the paper's method, which found the cones."""
        result = self.comparison["linear"].result
        assert result is not None
        return result


@dataclass(frozen=True, eq=False)
class Reproduction:
    """The paper's experiments.

    Attributes:
        models: one or more models, in the paper's order, then others.
        failed: file names and errors of meshes that failed.
    """

    models: tuple[Model, ...]
    failed: tuple[tuple[str, str], ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """The paper's models that were not given."""
        names = {model.name for model in self.models}
        return tuple(name for name in MODELS if name not in names)

    def table_1(self) -> list[list[object]]:
        """Return the rows of Table 1, curvature errors."""
        rows: list[list[object]] = []
        for model in self.models:
            error, published_error = model.linear.distortion.curvature_error, math.nan
            thousands: float | str = ""
            if model.published is not None:
                published_error, thousands = (
                    model.published.curvature_error,
                    f"{model.published.thousands:g}K",
                )
            cones = len(model.linear.cones)
            rows.append(
                [
                    model.name,
                    len(model.linear.faces),
                    thousands,
                    cones,
                    error,
                    published_error,
                    error / published_error,
                ]
            )
        return rows

    def table_2(self) -> list[list[object]]:
        """Return the rows of Table 2, quasi-conformal distortion and time."""
        rows: list[list[object]] = []
        for model in self.models:
            for entry in model.comparison.entries:
                qc = math.nan if entry.result is None else entry.result.distortion.qc_mean
                theirs, seconds = math.nan, math.nan
                if model.published is not None:
                    theirs = model.published.qc.get(entry.method, math.nan)
                    seconds = model.published.seconds.get(entry.method, math.nan)
                name = f"{entry.method} ({NAMES[entry.method]})" if entry.method in NAMES else entry.method
                numbers = [qc, theirs, qc / theirs, entry.seconds, seconds, entry.seconds / seconds]
                rows.append([model.name, name, *numbers])
        return rows

    def markdown(self) -> str:
        """Return both tables with notes, and the figures, as Markdown."""
        figures = [f"![{title}]({name})\n\n{title}\n" for name, title in FIGURES.items()]
        return "\n".join([self.tables(), *figures])

    def tables(self) -> str:
        """Return both tables with notes as Markdown."""
        lines = ["# Section 5 of the paper", ""]
        lines += [
            "Ben-Chen, Gotsman and Bunin, Conformal flattening by curvature prescription and metric scaling, 2008. "
            "The greedy search finds the cones (epsilon 1); all methods use these cones and the same cut. Times are "
            "those from the cones to the layout; the paper's are for a processor of 1.4 GHz.",
            "",
        ]
        different = [model for model in self.models if model.published is not None and not model.is_same]
        if different:
            listed = ", ".join(f"{m.name} ({len(m.linear.faces):,})" for m in different)
            lines += [f"In another resolution than in the paper, so that numbers differ: {listed}.", ""]
        if self.missing:
            lines += [f"Not among the files: {', '.join(self.missing)}.", ""]
        lines += [f"Could not be flattened: {name}: {reason}\n" for name, reason in self.failed]
        for title, headings, rows, forms in (
            ("Table 1: curvature error", TABLE_1, self.table_1(), FORMS_1),
            ("Table 2: quasi-conformal distortion", TABLE_2, self.table_2(), FORMS_2),
        ):
            lines += [f"## {title}", "", as_markdown(headings, _cells(rows, forms))]
        lines += [self.notes()]
        return "\n".join(lines)

    def notes(self) -> str:
        """Return a line for each note on a method, with the names of the models."""
        models: dict[tuple[str, str], list[str]] = {}
        for model in self.models:
            for entry in model.comparison.entries:
                if entry.note:
                    models.setdefault((entry.method, entry.note), []).append(model.name)
        return "".join(
            f"- {method} ({', '.join(names)}): {note}.\n" for (method, note), names in sorted(models.items())
        )

    def texts(self) -> dict[str, str]:
        """Return the tables as Markdown and as comma-separated values, by file name."""
        curvature_table, quality_table = as_csv(TABLE_1, self.table_1()), as_csv(TABLE_2, self.table_2())
        return dict(zip(TEXTS, (self.markdown(), curvature_table, quality_table), strict=True))

    def figures(self, look: Look) -> dict[str, Figure]:
        """Return the paper's figures by file name."""
        cones, quality, layouts, textures = [], [], [], []
        for model in self.models:
            label = f"{model.name}: {plural(len(model.linear.cones), 'cone')}"
            cones += look.views(model.linear, draw_cones, label)
            shown = model.comparison.drawn
            scale = pictures.on_common_scale(shown)
            quality.append(_row(pictures.quality_panels(shown, scale, look), scale))
            aligned = pictures.aligned_layouts([result for _, result in shown])
            pairs = zip(shown, aligned, strict=True)
            layouts.append(
                _row([layout_panel(result, f"{model.name}, {method}") for (method, _), result in pairs])
            )
            linear = tuple(drawn for drawn in shown if drawn[0] == "linear")
            linear_scale = pictures.on_common_scale(linear)
            texture = look.views(model.linear, draw_checker, model.name)
            textures.append(
                _row([*texture, *pictures.quality_panels(linear, linear_scale, look)], linear_scale)
            )
        rows = (pictures.in_rows(cones), quality, layouts, textures)
        marks = (mark_handles(self.models[0].linear), (), (), ())
        return {
            name: compose(row, marks=marked, dpi=pictures.DPI, width=10.0)
            for name, row, marked in zip(FIGURES, rows, marks, strict=True)
        }


TEXTS = ("paper.md", "table1.csv", "table2.csv")
#: File and caption of each figure, numbered as in the paper.
FIGURES = {
    "figure2.png": "Figure 2: cones, red where their curvature is positive, black where it is negative, and seams",
    "figure3.png": "Figure 3: quasi-conformal distortion by each method; the number is its mean",
    "figure4.png": "Figure 4: layouts by each method, with the same cones and cut",
    "figure5.png": "Figure 5: checkerboard and distortion by the paper's method",
}
#: All files that are written.
FILES = (*TEXTS, *FIGURES)


def reproduce(
    paths: Sequence[Path], *, methods: Sequence[str] = METHODS, progress: Progress | None = None
) -> Reproduction:
    """Run the paper's experiments on mesh files.

    Args:
        paths: files, folders of files, or patterns; those named after the paper's models come first.
        methods: methods to compare; the paper's method, "linear", is always included.
        progress: called with the current step and the completed fraction.

    Returns:
        The results, with the paper's tables and figures.

    Raises:
        OptionError: a method is unknown, or a path matches no mesh.
        MeshError: none of the meshes can be flattened.
    """
    files = sorted({Path(file) for path in paths for file in find_meshes(str(path))}, key=_sort_key)
    methods = tuple(dict.fromkeys(methods if "linear" in methods else ("linear", *methods)))
    models, failed = [], []
    for number, file in enumerate(files):

        def tell(step: str, fraction: float, number: int = number, name: str = file.stem) -> None:
            if progress is not None:
                progress(f"{name}: {step}", (number + fraction) / len(files))

        tell("read", 0.0)
        try:
            compared = compare_methods(read_mesh(file), methods=methods, atlases=(), progress=tell, **PAPER)
        except ConeflatError as error:
            failed.append((file.name, " ".join(str(error).split())))
            continue
        name = model_of(file)
        models.append(Model(name or file.stem, MODELS[name] if name else None, compared))
    if not models:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in failed)
        raise MeshError(f"no mesh could be flattened: {reasons}")
    return Reproduction(tuple(models), tuple(failed))


def _sort_key(path: Path) -> tuple[int, str, str]:
    name = model_of(path)
    return (len(MODELS) if name is None else list(MODELS).index(name), path.stem, str(path))


def layout_panel(result: Flattening, label: str) -> Panel:
    """Return a panel of the charts."""
    return Panel(layout_aspect(result, crop=True), partial(draw_layout, result, crop=True), label)


def _row(panels: Sequence[Panel], quantities: Sequence[Quantity] = ()) -> Row:
    """Return a row of panels, wide enough for their labels."""
    inches = 2.2  # of height
    return Row([panel.fit_label(inches) for panel in panels], quantities[:1], tallest=inches)


def _cells(rows: Sequence[Sequence[object]], forms: Sequence[str]) -> list[list[str]]:
    """Return the formatted cells of a table."""
    return [
        [
            str(value) if isinstance(value, str) else as_cell(value, form)  # type: ignore[arg-type]
            for value, form in zip(row, forms, strict=True)
        ]
        for row in rows
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "meshes", nargs="*", type=Path, default=[MODEL_FOLDER / name for name in STORED],
        help="files or folders; fandisk and rocker-arm by default",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("paper"), help="folder for tables and figures"
    )
    arguments = parser.parse_args()
    pictures.open_folder(arguments.output, FILES)
    reproduction = reproduce(
        arguments.meshes, progress=lambda step, fraction: print(f"{fraction:4.0%} {step}", end="\r")
    )
    pictures.write_folder(
        arguments.output, {**reproduction.texts(), **reproduction.figures(Look(dpi=pictures.DPI))}
    )
    print(reproduction.tables().rstrip())


if __name__ == "__main__":
    main()
