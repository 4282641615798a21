"""The tables of numbers in the documentation, and pages filled with them.

Numbers of missing models remain unchanged, and so do times, which depend on the machine, and results of other packages:
they are measured by `benchmarks/`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from markers import ROOT, blocks, fill, fill_numbers
from measured import Measured, number_text

sys.path.insert(0, str(ROOT / "benchmarks"))

from comparisons import COMPARED_METHODS, Entry, label_of
from paper import MODELS as PUBLISHED

import coneflat
from coneflat.options import PAPER

GALLERY = (
    "3holes", "bunny", "camelhead", "elephant", "face", "fandisk", "hand", "horse", "kitten", "rocker-arm",
)  # fmt: skip
ATLASES = ("sphere", "3holes", "bunny", "camelhead", "elephant", "face", "fandisk", "hand")
COMPARED = (
    "3holes", "bunny", "camelhead", "elephant", "face", "fandisk", "hand", "plane-holes", "rocker-arm", "spot",
)  # fmt: skip
TRADED = (
    "3holes", "bunny", "camelhead", "elephant", "face", "fandisk", "hand", "horse", "human", "kitten", "knight",
    "plane-holes", "rocker-arm", "spot", "stanford-bunny",
)  # fmt: skip
QUADS = ("bunny", "fandisk", "hand", "kitten", "rocker-arm", "spot")
ALLOWED = (0.5, 0.35, 0.25, 0.2, 0.15, 0.1, 0.07)
#: Area distortion of other packages that create dozens of charts.
MORE_CONES = 0.05

Rows = dict[str, list[str]]


def fill_page(text: str, measured: Measured) -> str:
    """Return a page with its tables and numbers measured."""
    for name, body in list(blocks(text, "table")):
        text = fill(text, name, TABLES[name.split()[1]](measured, body))
    return fill_numbers(text, lambda definition, was: number_text(measured, definition, was))


def _rows_of(body: str) -> Rows:
    """Return the rows of a table by the text of their first cell, without links."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in body.splitlines()[2:]]
    return {row[0].partition("]")[0].strip("[*"): row for row in rows}


def _table(headings: str, rows: list[list[str]]) -> str:
    """Return a table; headings stand in one line, with bars between."""
    columns = headings.count("|") + 1
    lines = [f"| {headings} |", "| " + " | ".join(["---"] * columns) + " |"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)])


def _row_of_each(
    models: tuple[str, ...], body: str, made: Mapping[str, list[str] | None]
) -> Iterator[list[str]]:
    """Yield a row for each model: the new one, or the old one if the model is missing."""
    was = _rows_of(body)
    for model in models:
        row = made[model] or was.get(model)
        if row is not None:
            yield row


#: Models that are also in the tables of the paper, and their names there.
PAPERS = {"fandisk": "fandisk", "rocker-arm": "rockerarm"}


def paper_table(measured: Measured, body: str) -> str:
    """Return the results of the published method on models that are also in the paper."""
    made = dict[str, list[str] | None]()
    for model, name in PAPERS.items():
        report, paper = measured.report(model, **PAPER), PUBLISHED[name]
        made[model] = (
            [
                model,
                f"{report['triangles']:,}",
                f"{paper.curvature_error:.1e} π".replace("e-0", "e-"),
                f"{report['curvature_error']:.2e} π".replace("e-0", "e-"),
                f"{paper.qc['linear']:.3f}",
                f"{report['qc_mean']:.4f}",
                f"{report['cones']}",
            ]
            if report
            else None
        )
    headings = "model | triangles | curvature error: paper | here | QC distortion: paper | here | cones"
    return _table(headings, list(_row_of_each(tuple(PAPERS), body, made)))


#: What the paper compares, and what it might have been instead: columns of its Table 2.
READINGS = ("circle-patterns/fixed", "circle-patterns", "linear-abf/free", "linear-abf", "linear", "exact")


def readings_table(measured: Measured, body: str) -> str:
    """Return the mean QC distortions of the paper next to ours, for two interpretations of its methods."""
    made = dict[str, list[str] | None]()
    for model, name in PAPERS.items():
        if not measured.has(model):
            made[model] = None
            continue
        comparison = measured.comparison(model, READINGS, **PAPER)
        row = made[model] = [model]
        for method in READINGS:
            paper, result = PUBLISHED[name].qc.get(method), comparison[method].result
            assert result is not None, method
            row += [f"{paper:.3f}"] if paper else []
            row.append(f"{result.distortion.qc_mean:.4f}")
    headings = (
        "model | CP: paper | here | with flips | LABF: paper | here | cone angles prescribed | "
        "CF: paper | here | exact"
    )
    return _table(headings, list(_row_of_each(tuple(PAPERS), body, made)))


def gallery_table(measured: Measured, body: str) -> str:
    """Return the numbers of the gallery."""
    made = dict[str, list[str] | None]()
    for model in GALLERY:
        report = measured.report(model)
        made[model] = (
            [
                f"[{model}](#{model})",
                f"{report['triangles']:,}",
                f"{report['cones']}",
                f"{report['charts']}",
                f"{report['qc_mean']:.3f}",
                f"{report['area_std']:.2f}",
                f"{report['seam_length']:.2f}",
            ]
            if report
            else None
        )
    headings = "model | triangles | cones | charts | QC distortion | area distortion | seam length, √area"
    return _table(headings, list(_row_of_each(GALLERY, body, made)))


#: Measures that depend on the number of cones: keys of the report, and their labels.
TRADEOFF = {
    "cones": "cones",
    "qc_mean": "QC distortion",
    "seam_length": "seam length, √area",
    "overlap": "overlap, % of area",
    "area_distortion": "exact E",
}


def tradeoff(measured: Measured) -> np.ndarray | None:
    """Return the (a, models, k) measures of models in one chart for each allowed area distortion, or None."""
    if not measured.has(*TRADED):
        return None
    rows = [
        [measured.report(model, distortion=allowed, charts="one") or {} for model in TRADED]
        for allowed in ALLOWED
    ]
    return np.array([[[report[key] for key in TRADEOFF] for report in row] for row in rows], dtype=np.float64)


def tradeoff_table(measured: Measured, body: str) -> str:
    """Return the effect of the number of cones, as medians over models."""
    measures = tradeoff(measured)
    if measures is None:
        return body
    rows = [
        [
            f"**{allowed}**" if allowed == 0.2 else f"{allowed}",
            f"{cones:.0f}",
            f"{distortion:.4f}",
            f"{length:.2f}",
            f"{100 * overlap:.1f}",
            f"{exact:.3f}",
        ]
        for allowed, (cones, distortion, length, overlap, exact) in zip(
            ALLOWED, np.median(measures, axis=1), strict=True
        )
    ]
    return _table(" | ".join(["E allowed", *TRADEOFF.values()]), rows)


def methods_table(measured: Measured, body: str) -> str:
    """Return the measures of all methods on ten models with the same cones and cut."""
    if not measured.has(*COMPARED):
        return body
    comparisons = {model: measured.comparison(model, COMPARED_METHODS) for model in COMPARED}
    was = _rows_of(body)
    rows = []
    for name in COMPARED_METHODS:
        numbers = np.array([_compared(model, comparison[name]) for model, comparison in comparisons.items()])
        error, _, _, flipped, _, mismatch = numbers.T
        qc, std, overlap = numbers[:, [1, 2, 4]].mean(axis=0)
        rows.append(
            [
                label_of(name),
                _brief(error.max()),
                f"{qc:.4f}",
                f"{std:.3f}",
                f"{flipped.sum():.0f}",
                f"{overlap:.1%}",
                _brief(np.median(mismatch)),
                was[label_of(name)][-1] if label_of(name) in was else "",
            ]
        )
    return _table(
        "method | curvature error, π | QC | area std | flipped | overlap | seam mismatch | time", rows
    )


def _compared(model: str, entry: Entry) -> list[float]:
    if entry.result is None:
        raise SystemExit(f"{entry.method} on {model}: {entry.note}")
    d = entry.result.distortion
    return [
        d.curvature_error_max,
        d.qc_mean,
        d.area_std,
        d.flipped + d.degenerate,
        d.overlap,
        d.seam_mismatch_max,
    ]


def _brief(value: float) -> str:
    """Return a number with one digit."""
    return f"{value:.0e}" if value < 0.01 else f"{value:.1g}"


def atlases_table(measured: Measured, body: str) -> str:
    """Return our atlases next to those of others, whose numbers are not measured again."""
    was, made, ours = _rows_of(body), dict[str, list[str] | None](), []
    keys = {"charts": "d", "seam_length": ".2f", "qc_mean": ".3f", "packing_efficiency": ".2f"}
    for model in ATLASES:
        default, fine = measured.report(model), measured.report(model, distortion=MORE_CONES)
        if default is None or fine is None:
            made[model] = None
            continue
        ours.append([[report[key] for report in (default, fine)] for key in keys])
        row = made[model] = [model, f"{default['triangles']:,}"]
        row += [
            ", ".join([*(format(value, form) for value in values), *cell.split(", ")[2:]])
            for values, form, cell in zip(ours[-1], keys.values(), was[model][2:], strict=True)
        ]
    rows = list(_row_of_each(ATLASES, body, made))
    mean = was["mean"]
    if len(ours) == len(ATLASES):
        means = np.mean(ours, axis=0)
        mean = ["mean", ""]
        mean += [
            ", ".join([*(format(value, form.replace("d", ".1f")) for value in values), *cell.split(", ")[2:]])
            for values, form, cell in zip(means, keys.values(), was["mean"][2:], strict=True)
        ]
    headings = (
        "model | triangles | charts: coneflat, with more cones, xatlas, uvunwrap | seam length | "
        "QC distortion | packing efficiency"
    )
    return _table(headings, [*rows, mean])


@cache
def convergence() -> str:
    """Return a table of the differences of discretisations on a sequence of finer spheres."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    from convergence import METHODS, PAIRS, measured

    pairs = [f"{METHODS[first]} and {METHODS[second]}" for first, second in PAIRS]
    headings = ["triangles", *(f"{pair}, mean" for pair in pairs)]
    rows = [
        [f"{count:,}", *(f"{value:.1e}".replace("e-0", "e-") for value in gaps[:, 0])]
        for count, _, gaps in measured(100_000, 0.3, 0.4)
    ]
    return _table(" | ".join(headings), rows)


def quads_table(measured: Measured, body: str) -> str:
    """Return the quality of quads with default options."""

    def row(model: str, path: Path) -> list[str]:
        m = coneflat.measure_quads(coneflat.quads(path))
        return [
            model,
            f"{m.quads:,}",
            f"{m.irregular}",
            f"{m.angle_mean:.1f}, {m.angle_p95:.1f}",
            f"{m.edge_cv:.2f}",
            f"{m.jacobian_mean:.3f}, {m.jacobian_min:.2f}",
            f"{m.hausdorff / m.edge_mean:.2f}",
        ]

    headings = (
        "model | quads | irregular vertices | angle deviation, degrees: mean, p95 | edge lengths, cv | "
        "scaled Jacobian: mean, minimum | distance, edges"
    )
    return _table(headings, _rows_of_quads(measured, body, "quads", row))


def loops_table(measured: Measured, body: str) -> str:
    """Return strips and patches of quads, with default options and with short loops."""

    def row(model: str, path: Path) -> list[str]:
        long, short = (coneflat.measure_quads(coneflat.quads(path, loops=loops)) for loops in (False, True))
        pairs = [
            [f"{m.irregular}", f"{m.angle_mean:.1f}", f"{m.longest_strip / m.quads:.1f}", f"{m.patches:,}"]
            for m in (long, short)
        ]
        return [model, *(", ".join(values) for values in zip(*pairs, strict=True))]

    headings = (
        "model | irregular vertices: default, `--loops` | angle deviation, degrees | "
        "quads of the longest strip, relative to all | patches"
    )
    return _table(headings, _rows_of_quads(measured, body, "loops", row))


def _rows_of_quads(
    measured: Measured, body: str, name: str, row: Callable[[str, Path], list[str]]
) -> list[list[str]]:
    """Return the row of each model with quads; those of models that are not there remain as they are."""
    made = dict[str, list[str] | None]()
    for model in QUADS:
        path = measured.path(model)
        if path is not None:
            print(f"  {name} of {model}", flush=True)
        made[model] = None if path is None else row(model, path)
    return list(_row_of_each(QUADS, body, made))


#: Function for each table, of the measured models and the old table.
TABLES: dict[str, Callable[[Measured, str], str]] = {
    "paper": paper_table,
    "gallery": gallery_table,
    "tradeoff": tradeoff_table,
    "methods": methods_table,
    "readings": readings_table,
    "convergence": lambda _, was: convergence(),
    "atlases": atlases_table,
    "quads": quads_table,
    "loops": loops_table,
}
