"""Comparison of methods on one mesh, with the same cones and the same cut, and its tables."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ... import ConeflatError, Flattening
from ...base import Progress, Unmet, warns
from ...errors import OptionError
from .methods import METHODS, flatten_by, label_of
from .packages import PEERS, installed_peers, run_peer

# Options that affect neither the cones nor the method from cones to a layout.
SHARED = (
    "repair", "strict", "seams", "no_seams", "sharp_angle", "hide_seams", "seam_weights", "charts", "resolution",
    "padding", "tiles", "up",
)  # fmt: skip
# Those of them that contain vertex indices of the input.
VERTEX_OPTIONS = ("seams", "no_seams", "seam_weights")
Drawn: TypeAlias = "tuple[tuple[str, Flattening], ...]"

# The stages from cones and cut to a layout.
TIMED = ("metric", "layout")


@dataclass(frozen=True, eq=False)
class Entry:
    """The result of one method.

    Attributes:
        method: name of the method.
        result: the flattening; None if the method failed.
        seconds: running time from the cones and the cut to the layout; of a peer, its total running time.
        note: differences from the other methods, or the error if there is no result.
    """

    method: str
    result: Flattening | None
    seconds: float
    note: str = ""


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of several methods on one mesh.

    Attributes:
        entries: one for each method and each peer.
    """

    entries: tuple[Entry, ...]

    @property
    def drawn(self) -> Drawn:
        """The method and the result of each entry that has one."""
        return tuple((entry.method, entry.result) for entry in self.entries if entry.result is not None)

    def __getitem__(self, method: str) -> Entry:
        """Return the entry of a method."""
        return {entry.method: entry for entry in self.entries}[method]


def _unmet_by_methods(comparison: Comparison, *_: Any) -> Iterator[Unmet]:
    for name, result in comparison.drawn:
        yield from (Unmet(f"{name}: {note}") for note in result.notes if isinstance(note, Unmet))


@warns("`notes` of this warning", _unmet_by_methods)
def compare_methods(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    methods: Sequence[str] = METHODS,
    peers: Iterable[str] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Comparison:
    """Flatten a mesh by several methods, with the same cones and the same cut.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        methods: names of `METHODS`; all by default.
        peers: names of methods with other cuts or of other packages, from `PEERS`; by default those installed.
        progress: called with the current step and the completed fraction.
        options: options of `coneflat.flatten`, with one chart by default. The cones and the cut are those of the method
            in the options, "exact" by default, and are used for all methods.

    Returns:
        The results of all methods.

    Raises:
        OptionError: a method or peer is unknown or not installed.
        MeshError: the mesh cannot be flattened, or no cones were found.
    """
    for name in methods or ("",):
        if name not in METHODS:
            raise OptionError(f"unknown method {name!r}: choose from {', '.join(METHODS)}")
    chosen = installed_peers() if peers is None else tuple(dict.fromkeys(peers))
    for name in chosen:
        if name not in installed_peers():
            raise OptionError(
                f"unknown peer {name!r}: choose from {', '.join(PEERS)}"
                if name not in PEERS
                else f"{name} is not installed"
            )
    names = [*dict.fromkeys(methods), *chosen]

    def report(what: str, done: int) -> None:
        if progress is not None:
            progress(what, done / (len(names) + 1))

    report("cones", 0)
    method = options.pop("method", "exact")
    _warm_up(method)
    base = flatten_by(method, mesh, faces, **options)
    cones = dict(zip(base.cones.tolist(), base.curvatures.tolist(), strict=True)) or "none"
    same, same_faces = _with_cones(mesh, faces, base)
    shared = {name: value for name, value in options.items() if name in SHARED}
    if same is not mesh and any(name in shared for name in VERTEX_OPTIONS):
        raise OptionError(
            "a cone is at a vertex that the repair split, so vertex indices of the input are ambiguous: leave out "
            f"{', '.join(name for name in VERTEX_OPTIONS if name in shared)}"
        )
    entries = []
    for done, name in enumerate(names, 1):
        report(name, done)
        try:
            if name in PEERS:
                entries.append(Entry(name, *run_peer(name, base), PEERS[name].note))
                continue
            _warm_up(name)
            result = base if name == method else flatten_by(name, same, same_faces, cones=cones, **shared)
            entries.append(entry_of(name, result, base))
        except ConeflatError as error:
            entries.append(Entry(name, None, math.nan, " ".join(str(error).split())))
    return Comparison(tuple(entries))


def _with_cones(mesh: Any, faces: ArrayLike | None, base: Flattening) -> tuple[Any, ArrayLike | None]:
    """Return the mesh whose vertex indices identify the cones of a result: the input, or the repaired mesh.

    The copies of a vertex that a repair split have the same index in the input.
    """
    origin = base.vertex_origin
    if origin is None or np.array_equal(origin[base.cones], base.cones):
        return mesh, faces
    return base.vertices, base.faces


def entry_of(name: str, result: Flattening, base: Flattening) -> Entry:
    """Return the entry of a method, without the notes on the input that are already on the base result."""
    known = () if result is base else base.notes
    notes = [note.rstrip(".") for note in result.notes if note not in known]
    if _cut_edges(result) != _cut_edges(base):
        notes.insert(0, "cut along other edges")
    return Entry(name, result, sum(result.seconds[stage] for stage in TIMED), "; ".join(notes))


def _cut_edges(result: Flattening) -> set[tuple[int, int]]:
    return {(min(pair), max(pair)) for pair in result.seams.tolist()}


def _warm_up(method: str) -> None:
    """Run a method on a tetrahedron, so that its time does not include loading of modules."""
    vertices, faces = np.eye(4)[:, :3] - 0.25, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    with suppress(ConeflatError):
        flatten_by(method, vertices, faces, cones=dict.fromkeys(range(4), np.pi))


#: Heading of each column, its measure, and the format of its numbers.
COLUMNS = {
    "curvature error, pi": ("curvature_error_max", ".1e"),
    "QC mean": ("qc_mean", ".4f"),
    "QC 95%": ("qc_p95", ".4f"),
    "area std": ("area_std", ".3f"),
    "energy": ("energy", ".3f"),
    "flipped": ("flipped", ",d"),
    "overlap": ("overlap", ".2%"),
    "charts": ("charts", ",d"),
    "seam length": ("seam_length", ".2f"),
    "seam mismatch": ("seam_mismatch_max", ".1e"),
    "time, s": ("seconds", ".2f"),
}


def numbers(entry: Entry) -> list[float | int]:
    """Return the values of the columns for a method; NaN if it failed."""
    if entry.result is None:
        return [math.nan] * len(COLUMNS)
    d = entry.result.distortion
    found = {**vars(d), "flipped": d.flipped + d.degenerate, "seconds": entry.seconds}
    return [found[measure] for measure, _ in COLUMNS.values()]


def as_cell(value: float | int, form: str) -> str:
    """Return a number as the text of a table cell; empty for NaN."""
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    return format(int(value) if form.endswith("d") else value, form)


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table as Markdown."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def comparison_rows(comparison: Comparison) -> list[list[str]]:
    """Return a row of cell texts for each method, without its note."""
    forms = [form for _, form in COLUMNS.values()]
    return [[label_of(entry.method), *map(as_cell, numbers(entry), forms)] for entry in comparison.entries]


def comparison_markdown(comparison: Comparison) -> str:
    """Return the table of methods and their notes as Markdown."""
    return f"{markdown(['method', *COLUMNS], comparison_rows(comparison))}\n{_notes(comparison)}"


def _notes(comparison: Comparison) -> str:
    """Return a line for each note on a method."""
    return "".join(f"- {entry.method}: {entry.note}.\n" for entry in comparison.entries if entry.note)


def comparison_csv(comparison: Comparison) -> str:
    """Return the table of methods as comma-separated values, at full precision."""
    rows = [[entry.method, *numbers(entry), entry.note] for entry in comparison.entries]
    return as_csv(["method", *COLUMNS, "note"], rows)


def as_csv(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return rows as comma-separated values; NaN is empty."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(headings)
    for row in rows:
        writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in row])
    return file.getvalue()


def comparison_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the table of methods as aligned lines of text, and the notes."""
    rows = [["method", *COLUMNS], *comparison_rows(comparison)]
    first, *widths = (max(map(len, column)) for column in zip(*rows, strict=True))
    for name, *cells in rows:
        numbers = (f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
        yield "  ".join([f"{name:{first}}", *numbers]).rstrip()
    yield from _notes(comparison).splitlines()
