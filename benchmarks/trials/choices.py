"""Random options of `coneflat.flatten` that fit a mesh, most of them valid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from coneflat.options.combined import SEARCH_OPTIONS

from .topology import Topology

Random = np.random.Generator

#: What the exact method alone has, and what a search for cones alone has.
OF_EXACT = ("boundary", "correct_handles")
OF_SEARCH = (*SEARCH_OPTIONS, "correct_handles")
INVALID = (None, -1, 0, 1e308, 1e-300, math.nan, math.inf, "abc", "", [], (), {}, [1], [[0, 1]], True, 2**70)


#: Options that get a value of `INVALID`.
MAY_BE_INVALID = (
    "distortion", "quantise", "cones", "boundary", "seams", "weights", "up", "tiles", "charts", "method",
)  # fmt: skip


def make_options(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> dict[str, Any]:
    """Return keyword arguments for a mesh."""
    options = RandomOptions(rng, len(vertices), faces)
    options.add_method()
    options.add_cones()
    options.add_boundary()
    options.maybe(0.35, "repair", True)
    options.maybe(0.04, "strict", True)
    options.add_seams()
    options.add_texture()
    _drop_clashes(rng, options.chosen)
    if rng.random() < 0.03:
        value = INVALID[int(rng.integers(len(INVALID)))]
        options.chosen[MAY_BE_INVALID[int(rng.integers(len(MAY_BE_INVALID)))]] = value
    return options.chosen


class RandomOptions:
    """Options that fit a mesh; cases are reproducible, so random numbers are drawn in a fixed order.

    Attributes:
        chosen: the options so far, by name.
    """

    def __init__(self, rng: Random, size: int, faces: np.ndarray) -> None:
        """size: number of vertices; faces: (m, 3), possibly invalid, which only restricts the choice."""
        self.chosen: dict[str, Any] = {}
        self._rng, self._size = rng, size
        is_valid = len(faces) > 0 and faces.min() >= 0 and faces.max() < size
        self._faces = faces if is_valid else faces[:0]
        self._topology = Topology.of(faces if is_valid else np.zeros((1, 3), dtype=np.int64), max(size, 1))
        self._inside = np.flatnonzero(self._topology.is_used & ~self._topology.is_border)
        self._border = np.flatnonzero(self._topology.is_border)

    def maybe(self, chance: float, name: str, *values: Any) -> None:
        """Set an option to one of some values, with a probability."""
        if self._rng.random() < chance:
            self.chosen[name] = values[int(self._rng.integers(len(values)))]

    def _vertices(self, pool: np.ndarray, max_count: int) -> list[int]:
        count = min(len(pool), int(self._rng.integers(1, max_count + 1)))
        return self._rng.choice(pool, count, replace=False).tolist() if count else []

    def _weights(self, constant: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return weights of vertices: moderate, of all magnitudes, and those given."""
        rng, size = self._rng, self._size
        return rng.random(size), 10 ** rng.uniform(-9, 9, size), constant

    def add_method(self) -> None:
        """Add the method and the kind of charts."""
        self.maybe(0.75, "charts", "atlas", "atlas", "one")
        self.maybe(0.1, "method", "linear")

    def add_cones(self) -> None:
        """Add cones and options of their search."""
        rng, inside = self._rng, self._inside
        words = ("sparse", "sparse", "greedy", "none", "auto")
        self.maybe(0.25, "cones", *words, self._vertices(inside, 4), self._vertices(inside, 4))
        if rng.random() < 0.06:
            self.chosen["cones"] = _given_curvatures(rng, inside, self._topology, self._faces)
        self.maybe(0.2, "distortion", 0.02, 0.1, 0.5, 2.0)
        self.maybe(0.12, "cone_count", *range(0, 12))
        self.maybe(0.08, "max_cones", 0, 1, 2, 5, 40)
        self.maybe(0.06, "min_cone_angle", math.pi / 6, 1.0, 3.0, 5.0)
        self.maybe(0.06, "max_cone_angle", None, 7.0, 9.0, 20.0)
        self.maybe(0.06, "positive_only", True)
        self.maybe(0.05, "weights", *self._weights(np.eye(1, max(self._size, 1))[0]))
        self.maybe(0.05, "required_cones", self._vertices(inside, 3))
        forbidden = self._vertices(np.arange(self._size), max(1, self._size // 2))
        self.maybe(0.05, "forbidden_cones", forbidden)
        quanta = (math.pi / 2, math.pi / 2, math.pi / 3, math.pi, 2 * math.pi, 0.1)
        self.maybe(0.16, "quantise", *quanta, rng.uniform(1e-3, 6))
        self.maybe(0.3 if "quantise" in self.chosen else 0, "correct_handles", True)

    def add_boundary(self) -> None:
        """Add a condition of the boundary."""
        rng, border = self._rng, self._border
        if not len(border):
            self.maybe(0.03, "boundary", "lengths", "disk", "straight")
            return
        words = ("lengths", "lengths", "disk", "disk", "straight", "straight")
        self.maybe(0.3, "boundary", *words, self._vertices(border, 6))
        if rng.random() < 0.05:
            corners = self._vertices(border, 6)
            turns = rng.dirichlet(np.ones(len(corners))) * 2 * math.pi if corners else []
            self.chosen["boundary"] = {v: float(k) for v, k in zip(corners, turns, strict=True)}

    def add_seams(self) -> None:
        """Add marked and avoided edges, and what seams cost."""
        rng, edges = self._rng, self._topology.edges[self._topology.inner]
        if len(edges):
            if rng.random() < 0.06:
                self.chosen["seams"] = edges[rng.random(len(edges)) < rng.choice([0.03, 0.3, 1.0])]
            if rng.random() < 0.06:
                self.chosen["seams"] = _walk(rng, edges)
            if rng.random() < 0.04:
                barred = edges[rng.random(len(edges)) < rng.choice([0.03, 0.3, 0.9])]
                self.chosen["no_seams"] = barred if rng.random() < 0.7 else np.unique(barred)
        self.maybe(0.1, "sharp_angle", 0.3, 0.7, 1.2, 3.0)
        self.maybe(0.04, "hide_seams", 1.0, 10.0)
        self.maybe(0.05, "seam_weights", *self._weights(np.ones(self._size) * 1e308))

    def add_texture(self) -> None:
        """Add the size of the texture, and how charts are placed in it."""
        self.maybe(0.08, "resolution", 1, 16, 64, 4096)
        self.maybe(0.08, "padding", 0.0, 0.2, 8.0)
        self.maybe(0.05, "tiles", 2, 3, 12)
        self.maybe(0.12, "up", (0, 0, 1), (0, 1, 0), (1, 1e-9, -3), (0.0, -2.0, 0.0))


def cross_options(rng: Random, vertices: np.ndarray, faces: np.ndarray) -> dict[str, Any]:
    """Return the options of several random choices at once, without those that exclude each other."""
    options: dict[str, Any] = {}
    for _ in range(int(rng.integers(2, 4))):
        options |= make_options(rng, vertices, faces)
    _drop_clashes(rng, options)
    return options


def _given_curvatures(
    rng: Random, inside: np.ndarray, topology: Topology, faces: np.ndarray
) -> dict[int, float]:
    """Return cones whose curvatures satisfy Gauss-Bonnet on a connected surface, if there are inner vertices."""
    count = min(len(inside), int(rng.integers(1, 8)))
    if not count or not len(faces):
        return {}
    chosen = rng.choice(inside, count, replace=False)
    total = 2 * math.pi * topology.euler(faces, int(topology.component[chosen[0]]))
    if topology.is_border.any():
        values = rng.uniform(-2, 3, count)
    else:
        values = rng.uniform(-1, 1, count) if rng.random() < 0.5 else np.zeros(count)
        values += (total - values.sum()) / count
    return {int(v): float(k) for v, k in zip(chosen, values, strict=True)}


def _walk(rng: Random, edges: np.ndarray) -> np.ndarray:
    """Return the edges of a random path, like edges marked by a user."""
    at: dict[int, list[int]] = {}
    for number, (a, b) in enumerate(edges.tolist()):
        at.setdefault(a, []).append(number)
        at.setdefault(b, []).append(number)
    vertex, taken = int(edges[rng.integers(len(edges)), 0]), []
    for _ in range(int(rng.integers(2, 12))):
        number = at[vertex][int(rng.integers(len(at[vertex])))]
        taken.append(number)
        vertex = int(edges[number].sum()) - vertex
    return edges[np.unique(taken)]


def _drop_clashes(rng: Random, options: dict[str, Any]) -> None:
    """Remove, with high probability, options that exclude each other, so that most cases have a result."""
    if rng.random() < 0.04:
        return
    if options.get("method", "exact") != "exact":
        for name in OF_EXACT:
            options.pop(name, None)
    if not isinstance(options.get("cones", "auto"), str) or options.get("cones") in ("greedy", "none"):
        for name in OF_SEARCH:
            options.pop(name, None)
        if options.get("boundary") == "straight":
            del options["boundary"]
    if options.get("padding", 2.0) >= options.get("resolution", 1024) / 4:
        options["padding"] = 0.0


def in_short(options: dict[str, Any]) -> str:
    """Return options as one line, with long values truncated."""
    return ", ".join(f"{name}={_short(value)}" for name, value in options.items())


def _short(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"<{value.dtype} {value.shape}>"
    text = " ".join(repr(value).split())
    return text if len(text) < 100 else f"{text[:97]}..."
