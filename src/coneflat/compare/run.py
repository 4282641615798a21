"""All methods on one mesh, with the same cones and the same cut."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ConeflatError, OptionError
from ..io import MeshFile
from ..options import METHODS, VARIANTS
from ..pipeline import flatten
from ..result import Flattening
from ..stages import Progress
from .peers import PEERS, installed_peers, run_peer

# Options that do not say which cones there are, nor how to get from them to a layout.
SHARED = (
    "repair",
    "strict",
    "solver",
    "seams",
    "sharp_angle",
    "forbidden_seams",
    "creases",
    "hide_seams",
    "seam_weights",
)
# The stages that lead from cones and cut to a layout.
TIMED = ("metric", "layout")
# A mesh on which every method has its code loaded before the clock starts: a tetrahedron and its corners.
SMALL = np.eye(4)[:, :3] - 0.25, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


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
        return next(entry for entry in self.entries if entry.method == method)


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
        methods: names that its `method` takes.
        peers: names of other packages' methods, of `coneflat.compare.PEERS`; by default those that are installed.
        progress: called with what is done and the fraction done.
        options: arguments of `coneflat.flatten`; those of cones hold for all, by the method "exact" if they do not
            name another.

    Raises:
        OptionError: a method or peer is unknown or not installed.
        MeshError: the mesh cannot be flattened, or cones not be found.
    """
    for name in methods:
        if name not in METHODS + VARIANTS:
            raise OptionError(f"unknown method {name!r}: choose from {', '.join(METHODS + VARIANTS)}")
    chosen = installed_peers() if peers is None else tuple(peers)
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
    _warm_up(options.get("method", "exact"))
    base = flatten(mesh, faces, **options)
    cones = _cones_again(base)
    shared = {name: value for name, value in options.items() if name in SHARED}
    entries = []
    for done, name in enumerate(names, 1):
        tell(name, done)
        if name in PEERS:
            entries.append(_entry_of_peer(name, base))
        elif name == base.settings["method"]:
            entries.append(_entry(name, base))
        else:
            _warm_up(name)
            try:
                result = flatten(mesh, faces, method=name, cones=cones, **shared)
            except ConeflatError as error:
                entries.append(Entry(name, None, float("nan"), " ".join(str(error).split())))
            else:
                entries.append(_entry(name, result, base))
    named = mesh.path if isinstance(mesh, MeshFile) else mesh if isinstance(mesh, str) else None
    return Comparison("mesh" if named is None else str(named), len(base.faces), tuple(entries))


def _cones_again(base: Flattening) -> Mapping[int, float] | str:
    """Return what prescribes the same cones: those of the result, by the input's numbers."""
    if not len(base.cones):
        return "none"
    numbers = base.cones if base.vertex_origin is None else base.vertex_origin[base.cones]
    return dict(zip(numbers.tolist(), base.curvatures.tolist(), strict=True))


def _entry(name: str, result: Flattening, base: Flattening | None = None) -> Entry:
    note = "; ".join(note.rstrip(".") for note in result.notes)
    if base is not None and not np.array_equal(result.seams, base.seams):
        note = "; ".join(["cut along other edges", *([note] if note else [])])
    return Entry(name, result, sum(result.seconds[stage] for stage in TIMED), note)


def _entry_of_peer(name: str, base: Flattening) -> Entry:
    start = time.perf_counter()
    try:
        result = run_peer(name, base)
    except ConeflatError as error:
        return Entry(name, None, float("nan"), " ".join(str(error).split()))
    return Entry(name, result.flattening, result.seconds or time.perf_counter() - start, PEERS[name].note)


def _warm_up(method: str) -> None:
    """Load what a method needs, so that its time is that of its work."""
    with suppress(ConeflatError):
        flatten(*SMALL, cones=dict.fromkeys(range(4), np.pi), method=method)
