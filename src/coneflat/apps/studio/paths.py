"""Paths along edges of a mesh, as the user of the studio draws them."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np

from ...base import IntArray, short_repr
from ...errors import StudioError
from ...options import as_integer

Path = tuple[int, ...]


def as_vertex(name: str, value: object) -> int:
    """Return the index of a vertex, or of another thing with a name, from a value of JSON.

    Raises:
        OptionError: it is not an integer.
        StudioError: it is negative.
    """
    vertex = as_integer(name, value)
    if vertex < 0:
        raise StudioError(f"{name} must be an index, 0 or more, got {vertex}")
    return vertex


def checked_path(path: Iterable[Any]) -> Path:
    """Return a path from values of JSON.

    Raises:
        OptionError, StudioError: it is not a path.
    """
    vertices = tuple(as_vertex("a path's vertex", vertex) for vertex in path)
    if len(vertices) < 2 or any(a == b for a, b in pairwise(vertices)):
        raise StudioError(
            f"a path must be two or more vertices, no two equal in a row: {short_repr(list(vertices))}"
        )
    return vertices


def edge_pairs(paths: Iterable[Path]) -> IntArray:
    """Return (k, 2) the edges of paths, sorted, each once."""
    edges = {tuple(sorted(edge)) for path in paths for edge in edges_of(path)}
    return np.array(sorted(edges), dtype=np.int64)


def edges_of(path: Path) -> set[frozenset[int]]:
    """Return the edges of a path."""
    return {frozenset(edge) for edge in pairwise(path)}
