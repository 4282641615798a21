"""All methods on one mesh, with the same cones and the same cut; and as tables."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import ConeflatError, Flattening, MeshFile
from ...base import Progress, list_some
from ...errors import OptionError
from .methods import METHODS, flatten_by
from .packages import PEERS, installed_peers, run_peer

# Options that do not say which cones there are, nor how to get from them to a layout.
SHARED = (
    "repair", "strict", "seams", "no_seams", "sharp_angle", "hide_seams", "seam_weights", "charts", "resolution",
    "padding", "tiles", "up",
)  # fmt: skip
# Those of them that name vertices of the input.
NAMING = ("seams", "no_seams", "seam_weights")
# The stages that lead from cones and cut to a layout.
TIMED = ("metric", "layout")
#: The methods but those that stand in as they were used in 2008.
COMPARED = tuple(name for name in METHODS if "/" not in name)


@dataclass(frozen=True, eq=False)
class Entry:
    """What one method made of a mesh.

    Attributes:
        method: its name.
        result: the flattening; None where there is none.
        seconds: from the cones and the cut to the layout; of a peer all that it does.
        note: what it does not do as the others do, or why there is no result.
    """

    method: str
    result: Flattening | None
    seconds: float
    note: str = ""


@dataclass(frozen=True, eq=False)
class Comparison:
    """What several methods made of one mesh.

    Attributes:
        name: of the mesh.
        triangles: how many it has.
        entries: one for each method, and for each peer.
    """

    name: str
    triangles: int
    entries: tuple[Entry, ...]

    @property
    def drawn(self) -> tuple[Entry, ...]:
        """The entries that have a result."""
        return tuple(entry for entry in self.entries if entry.result is not None)

    def __getitem__(self, method: str) -> Entry:
        """Return the entry of a method."""
        return {entry.method: entry for entry in self.entries}[method]


def compare_methods(
    mesh: Any,
    faces: ArrayLike | None = None,
    *,
    methods: Sequence[str] = COMPARED,
    peers: Iterable[str] | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Comparison:
    """Flatten a mesh by several methods, with the same cones and the same cut.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        methods: names of `METHODS`; by default those without a /.
        peers: names of other packages' methods, of `PEERS`; by default those that are installed.
        progress: called with what is done and the fraction done.
        options: arguments of `coneflat.flatten`, in one chart by default; those of cones hold for all, by the method
            "exact" if they do not name another.

    Raises:
        OptionError: a method or peer is unknown or not installed.
        MeshError: the mesh cannot be flattened, or cones not be found.
    """
    methods = known_methods(methods)
    chosen = installed_peers() if peers is None else tuple(dict.fromkeys(peers))
    for name in chosen:
        if name not in installed_peers():
            raise OptionError(
                f"unknown peer {name!r}: choose from {', '.join(PEERS)}"
                if name not in PEERS
                else f"{name} is not installed"
            )
    names = [*methods, *chosen]

    def tell(what: str, done: int) -> None:
        if progress is not None:
            progress(what, done / (len(names) + 1))

    tell("cones", 0)
    method = options.pop("method", "exact")
    _warm_up(method)
    base = flatten_by(method, mesh, faces, **options)
    cones = dict(zip(base.cones.tolist(), base.curvatures.tolist(), strict=True)) or "none"
    same, same_faces = _with_cones(mesh, faces, base)
    shared = {name: value for name, value in options.items() if name in SHARED}
    if same is not mesh and any(name in shared for name in NAMING):
        raise OptionError(
            "a cone lies where the repair split a vertex, so that the input's numbers do not tell which edges are "
            f"meant: leave out {', '.join(name for name in NAMING if name in shared)}"
        )
    entries = []
    for done, name in enumerate(names, 1):
        tell(name, done)
        try:
            if name in PEERS:
                entries.append(Entry(name, *run_peer(name, base), PEERS[name].note))
                continue
            _warm_up(name)
            result = base if name == method else flatten_by(name, same, same_faces, cones=cones, **shared)
            entries.append(_entry(name, result, base))
        except ConeflatError as error:
            entries.append(Entry(name, None, math.nan, " ".join(str(error).split())))
    named = mesh.path if isinstance(mesh, MeshFile) else mesh if isinstance(mesh, (str, PathLike)) else None
    return Comparison("mesh" if named is None else str(named), len(base.faces), tuple(entries))


def known_methods(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names of methods, each once.

    Raises:
        OptionError: one is unknown, or there is none.
    """
    names = tuple(dict.fromkeys(names))
    for name in names or ("",):
        if name not in METHODS:
            raise OptionError(f"unknown method {name!r}: choose from {', '.join(METHODS)}")
    return names


def _with_cones(mesh: Any, faces: ArrayLike | None, base: Flattening) -> tuple[Any, ArrayLike | None]:
    """Return the mesh on which numbers name the cones of a result: the input, or the repaired one.

    A vertex that a repair split has copies that no number of the input tells apart.
    """
    origin = base.vertex_origin
    if origin is None or np.array_equal(origin[base.cones], base.cones):
        return mesh, faces
    return base.vertices, base.faces


def _entry(name: str, result: Flattening, base: Flattening) -> Entry:
    """Return what a method made, where another made the base; what was done to the input is a note on that."""
    said = () if result is base else base.notes
    notes = [note.rstrip(".") for note in result.notes if note not in said]
    if _cut_edges(result) != _cut_edges(base):
        notes.insert(0, "cut along other edges")
    return Entry(name, result, sum(result.seconds[stage] for stage in TIMED), "; ".join(notes))


def _cut_edges(result: Flattening) -> set[tuple[int, int]]:
    return {(min(pair), max(pair)) for pair in result.seams.tolist()}


def _warm_up(method: str) -> None:
    """Load what a method needs by a tetrahedron, so that its time is that of its work."""
    vertices, faces = np.eye(4)[:, :3] - 0.25, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    with suppress(ConeflatError):
        flatten_by(method, vertices, faces, cones=dict.fromkeys(range(4), np.pi))


#: Heading of each column, and how a number below it is written.
COLUMNS = {
    "curvature error, pi": ".1e",
    "QC mean": ".4f",
    "QC 95%": ".4f",
    "area std": ".3f",
    "flipped": ",d",
    "overlap": ".2%",
    "charts": ",d",
    "seam length": ".2f",
    "seam mismatch": ".1e",
    "time, s": ".2f",
}


def numbers(entry: Entry) -> list[float | int]:
    """Return what the columns show of a method; NaN where there is nothing."""
    if entry.result is None:
        return [math.nan] * len(COLUMNS)
    d = entry.result.distortion
    return [
        d.curvature_error_max,
        d.qc_mean,
        d.qc_p95,
        d.area_std,
        d.flipped + d.degenerate,
        d.overlap,
        d.charts,
        d.seam_length,
        d.seam_mismatch_max,
        entry.seconds,
    ]


def written(value: float | int, form: str) -> str:
    """Return a number as it stands in a table; nothing for NaN."""
    if isinstance(value, float) and not math.isfinite(value):
        return ""
    return format(int(value) if form.endswith("d") else value, form)


def markdown(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines)


def comparison_rows(comparison: Comparison) -> list[list[str]]:
    """Return a row of text for each method, without its note."""
    return [
        [entry.method, *(written(n, form) for n, form in zip(numbers(entry), COLUMNS.values(), strict=True))]
        for entry in comparison.entries
    ]


def comparison_markdown(comparison: Comparison) -> str:
    """Return the methods in a table, and what is to be said of them."""
    return f"{markdown(['method', *COLUMNS], comparison_rows(comparison))}\n{notes([comparison])}"


def notes(comparisons: Sequence[Comparison]) -> str:
    """Return a line for each note that methods have, with the meshes that it is about where there are several."""
    meshes: dict[tuple[str, str], list[str]] = {}
    for comparison in comparisons:
        for entry in comparison.entries:
            if entry.note:
                meshes.setdefault((entry.method, entry.note), []).append(comparison.name)
    about = len(comparisons) > 1
    return "".join(
        f"- {method}{f' ({list_some(names)})' if about else ''}: {note}.\n"
        for (method, note), names in sorted(meshes.items())
    )


def comparison_csv(comparison: Comparison) -> str:
    """Return the methods as comma separated values, at full precision."""
    rows = [[entry.method, *numbers(entry), entry.note] for entry in comparison.entries]
    return as_csv(["method", *COLUMNS, "note"], rows)


def as_csv(headings: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return comma separated values; NaN is left empty."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(headings)
    for row in rows:
        writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in row])
    return file.getvalue()


def comparison_lines(comparison: Comparison) -> Iterator[str]:
    """Yield a line for each method, and the notes."""
    rows = [["method", *COLUMNS], *comparison_rows(comparison)]
    first, *widths = (max(map(len, column)) for column in zip(*rows, strict=True))
    for name, *cells in rows:
        numbers = (f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
        yield "  ".join([f"{name:{first}}", *numbers]).rstrip()
    yield from notes([comparison]).splitlines()
