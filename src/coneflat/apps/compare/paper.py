"""Section 5 of the paper, on given meshes: its tables and figures, with the paper's numbers beside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import ConeflatError, MeshError
from ...files import read_mesh
from ...files.read import find_meshes
from ...options import PAPER
from ...progress import Progress
from ...text import plural
from .published import MODELS, NAMES, Published, model_of
from .run import Comparison, compare_methods, known_methods
from .table import as_csv, markdown, notes, written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...result.flattening import Flattening
    from .pictures import Sight

#: What the paper compares; then what it had not: flips before circle patterns, cones in linear ABF, the exact metric.
METHODS = (*NAMES, "circle-patterns", "linear-abf", "exact")
TABLE_1 = ("model", "triangles", "of the paper", "cones", "curvature error, pi", "of the paper", "ratio")
TABLE_2 = ("model", "method", "QC mean", "of the paper", "ratio", "time, s", "of the paper", "ratio")
# How their numbers are written.
FORMS_1 = ("", ",d", "", "d", ".2e", ".2e", ".2f")
FORMS_2 = ("", "", ".4f", ".3f", ".3f", ".2f", ".3g", ".3f")
# Inches, of pictures in a row.
HEIGHT = 2.2


@dataclass(frozen=True, eq=False)
class Model:
    """A mesh and what the methods made of it.

    Attributes:
        name: the paper's where it has the model, else the file's.
        published: the paper's numbers; None where it has none.
        comparison: of the methods.
    """

    name: str
    published: Published | None
    comparison: Comparison

    @property
    def is_same(self) -> bool:
        """Whether the mesh has the resolution of the paper's."""
        return self.published is not None and self.published.has_as_many(self.comparison.triangles)

    @property
    def linear(self) -> Flattening:
        """By the paper's method, which found the cones."""
        result = self.comparison["linear"].result
        assert result is not None
        return result


@dataclass(frozen=True, eq=False)
class Reproduction:
    """The paper's experiments.

    Attributes:
        models: one or more, in the paper's order, then others.
        failed: file and what was wrong with it.
    """

    models: tuple[Model, ...]
    failed: tuple[tuple[str, str], ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """The paper's models that were not given."""
        found = {model.name for model in self.models}
        return tuple(name for name in MODELS if name not in found)

    def table_1(self) -> list[list[object]]:
        """Return the rows of Table 1, curvature errors."""
        rows: list[list[object]] = []
        for model in self.models:
            here, there = model.linear.distortion.curvature_error, math.nan
            thousands: float | str = ""
            if model.published is not None:
                there, thousands = model.published.curvature_error, f"{model.published.thousands:g}K"
            cones = len(model.linear.cones)
            rows.append([model.name, model.comparison.triangles, thousands, cones, here, there, here / there])
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
        """Return both tables, what is to be known of them, and the figures."""
        figures = [f"![{title}]({name})\n\n{title}\n" for name, title in FIGURES.items()]
        return "\n".join([self.tables(), *figures])

    def tables(self) -> str:
        """Return both tables, and what is to be known of them."""
        lines = ["# Section 5 of the paper", ""]
        lines += [
            "Ben-Chen, Gotsman and Bunin, Conformal flattening by curvature prescription and metric scaling, 2008. "
            "The greedy search finds the cones (epsilon 1); these and one cut are given to every method. Times are "
            "from there to the layout; the paper's are of a processor of 1.4 GHz.",
            "",
        ]
        other = [model for model in self.models if model.published is not None and not model.is_same]
        if other:
            listed = ", ".join(f"{m.name} ({m.comparison.triangles:,})" for m in other)
            lines += [f"In another resolution than the paper's, so that numbers differ: {listed}.", ""]
        if self.missing:
            lines += [f"Not among the files: {', '.join(self.missing)}.", ""]
        lines += [f"Could not be flattened: {name}: {why}\n" for name, why in self.failed]
        for title, headings, rows, forms in (
            ("Table 1: curvature error", TABLE_1, self.table_1(), FORMS_1),
            ("Table 2: quasi-conformal distortion", TABLE_2, self.table_2(), FORMS_2),
        ):
            lines += [f"## {title}", "", markdown(headings, _written(rows, forms))]
        lines += [notes([replace(model.comparison, name=model.name) for model in self.models])]
        return "\n".join(lines)

    def texts(self) -> dict[str, str]:
        """Return the tables as Markdown, and as comma separated values, by file name."""
        one, two = as_csv(_distinct(TABLE_1), self.table_1()), as_csv(_distinct(TABLE_2), self.table_2())
        return dict(zip(TEXTS, (self.markdown(), one, two), strict=True))

    def figures(self, sight: Sight) -> dict[str, Figure]:
        """Return the paper's figures, by file name."""
        from ...view.figures.compose import Row
        from .pictures import (
            cone_panel,
            figure_of,
            in_rows,
            layout_panel,
            quality_panels,
            same_scale,
            texture_panel,
            turned_alike,
            with_room,
        )

        cones = [cone_panel(m.linear, sight, f"{m.name}: {_cones(m.linear)}") for m in self.models]
        quality, layouts, textures = [], [], []
        for model in self.models:
            shown = model.comparison.drawn
            quantities = same_scale(shown)
            panels = quality_panels(shown, quantities, sight)
            quality.append(
                Row([with_room(panel, HEIGHT) for panel in panels], quantities[:1], tallest=HEIGHT)
            )
            flat = [
                layout_panel(result, f"{model.name}, {entry.method}")
                for entry, result in zip(shown, turned_alike(shown), strict=True)
            ]
            layouts.append(Row([with_room(panel, HEIGHT) for panel in flat], tallest=HEIGHT))
            linear = [entry for entry in shown if entry.method == "linear"]
            own = same_scale(linear)
            textures.append(
                Row(
                    [texture_panel(model.linear, sight, model.name), *quality_panels(linear, own, sight)],
                    own,
                    tallest=2.6,
                )
            )
        rows = (in_rows(cones), quality, layouts, textures)
        marks = (self.models[0].linear, None, None, None)
        return {
            name: figure_of(each, marks_of=marked)
            for name, each, marked in zip(FIGURES, rows, marks, strict=True)
        }


TEXTS = ("paper.md", "table1.csv", "table2.csv")
#: File and caption of each figure, numbered as in the paper.
FIGURES = {
    "figure2.png": "Figure 2: cones, red where their curvature is positive, black where it is negative, and seams",
    "figure3.png": "Figure 3: quasi-conformal distortion by each method; the number is its mean",
    "figure4.png": "Figure 4: layouts by each method, with the same cones and cut",
    "figure5.png": "Figure 5: a checkerboard, and the distortion, by the paper's method",
}
#: All that is written.
FILES = (*TEXTS, *FIGURES)


def reproduce(
    paths: Sequence[Path], *, methods: Sequence[str] = METHODS, progress: Progress | None = None
) -> Reproduction:
    """Run the paper's experiments on mesh files, and on those in folders.

    Args:
        paths: files, folders of files, or patterns; those named after the paper's models come first.
        methods: to compare; the paper's own, "linear", is among them in any case.
        progress: called with what is done and the fraction done.

    Raises:
        OptionError: a method is unknown, or a path names no mesh.
        MeshError: none of the meshes can be flattened.
    """
    files = sorted({Path(file) for path in paths for file in find_meshes(str(path))}, key=_place)
    methods = known_methods(methods if "linear" in methods else ("linear", *methods))
    models, failed = [], []
    for number, file in enumerate(files):

        def tell(what: str, fraction: float, number: int = number, name: str = file.stem) -> None:
            if progress is not None:
                progress(f"{name}: {what}", (number + fraction) / len(files))

        tell("read", 0.0)
        try:
            compared = compare_methods(read_mesh(file), methods=methods, peers=(), progress=tell, **PAPER)
        except ConeflatError as error:
            failed.append((file.name, " ".join(str(error).split())))
            continue
        name = model_of(file)
        models.append(Model(name or file.stem, MODELS[name] if name else None, compared))
    if not models:
        why = "; ".join(f"{name}: {reason}" for name, reason in failed)
        raise MeshError(f"no mesh could be flattened: {why}")
    return Reproduction(tuple(models), tuple(failed))


def _place(path: Path) -> tuple[int, str, str]:
    name = model_of(path)
    return (len(MODELS) if name is None else list(MODELS).index(name), path.stem, str(path))


def _cones(result: Flattening) -> str:
    return plural(len(result.cones), "cone")


def _written(rows: Sequence[Sequence[object]], forms: Sequence[str]) -> list[list[str]]:
    """Return cells as they stand in a table."""
    return [
        [
            str(value) if isinstance(value, str) else written(value, form)  # type: ignore[arg-type]
            for value, form in zip(row, forms, strict=True)
        ]
        for row in rows
    ]


def _distinct(headings: Sequence[str]) -> list[str]:
    """Return headings of which each says what it is of, as columns of a file cannot lean on their neighbours."""
    named: list[str] = []
    for heading in headings:
        if heading in ("of the paper", "ratio"):
            of = next(each for each in reversed(named) if ": " not in each)
            heading = f"{of}: {'paper' if heading == 'of the paper' else heading}"
        named.append(heading)
    return named
