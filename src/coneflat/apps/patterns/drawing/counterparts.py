"""Pieces of the same shape, and pieces that are mirror images of each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....base import ComplexArray, FloatArray
from .allowances import shapely
from .shapes import PieceShape

if TYPE_CHECKING:
    from ..result import Pattern

# Distance between the outlines of two pieces of the same shape, relative to the extent of a piece: 0.3 mm of 300 mm.
SAME_SHAPE = 1e-3


@dataclass(frozen=True)
class Counterparts:
    """Which pieces have the same shape; pieces are numbered from 0.

    Attributes:
        equal: of each piece the first one that has its shape, if that is another piece; else None.
        mirrored: of each piece its partner in a pair of mirror images; None if it has none.
    """

    equal: tuple[int | None, ...]
    mirrored: tuple[int | None, ...]

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """The pairs of mirror images."""
        return [(i, k) for i, k in enumerate(self.mirrored) if k is not None and i < k]


@dataclass(frozen=True, eq=False)
class _Class:
    """Pieces that have the shape of the first one, and those that have the shape of its mirror image."""

    equal: list[int]
    mirrored: list[int] = field(default_factory=list)


def counterparts_of(pattern: Pattern) -> Counterparts:
    """Return which pieces of a pattern have the same shape, allowances and tabs included.

    Pieces with a grain have the same shape only if the grain is the same, too.
    """
    shapes = pattern.shapes
    equal: list[int | None] = [None] * len(shapes)
    mirrored: list[int | None] = [None] * len(shapes)
    for group in _classes(shapes, pattern.has_grain):
        for members in (group.equal, group.mirrored):
            for piece in members[1:]:
                equal[piece] = members[0]
        for piece, image in zip(group.equal, group.mirrored, strict=False):
            mirrored[piece], mirrored[image] = image, piece
    return Counterparts(tuple(equal), tuple(mirrored))


def _classes(shapes: Sequence[PieceShape], has_grain: bool) -> list[_Class]:
    classes: list[_Class] = []
    for piece, shape in enumerate(shapes):
        for group in classes:
            first = shapes[group.equal[0]]
            if _is_congruent(first, shape, has_grain, is_mirrored=False):
                group.equal.append(piece)
                break
            if _is_congruent(first, shape, has_grain, is_mirrored=True):
                group.mirrored.append(piece)
                break
        else:
            classes.append(_Class([piece]))
    return classes


def _is_congruent(first: PieceShape, second: PieceShape, has_grain: bool, is_mirrored: bool) -> bool:
    """Return whether a rotation, after a reflection or not, maps a piece to another one.

    Args:
        first, second: the pieces.
        has_grain: only half turns are allowed, and reflections along the grain or across it.
        is_mirrored: whether there is a reflection.
    """
    a, b = (_complex(shape.seam_rings[0]) for shape in (first, second))
    if len(a) != len(b):
        return False
    centre_a, centre_b = a.mean(), b.mean()
    tolerance = SAME_SHAPE * float(np.abs(a - centre_a).max())
    border = _mirrored(a - centre_a, is_mirrored)[:: -1 if is_mirrored else 1]

    def image(points: FloatArray, rotation: complex) -> FloatArray:
        mapped = rotation * _mirrored(_complex(points) - centre_a, is_mirrored) + centre_b
        return np.stack([mapped.real, mapped.imag], axis=1)

    # Of symmetric borders several rotations match, but not all of them those of holes and allowances.
    return any(
        shapely().hausdorff_distance(
            shapely().transform(first.cut.boundary, partial(image, rotation=rotation)), second.cut.boundary
        )
        <= tolerance
        for rotation in _rotations(border, b - centre_b, has_grain, tolerance)
    )


def _rotations(
    first: ComplexArray, second: ComplexArray, has_grain: bool, tolerance: float
) -> Iterator[complex]:
    """Yield the rotations that map each point of a border to a point of another one, as complex numbers.

    Notes:
        With n points, |a|^2 + |b|^2 - 2 |c| is the smallest sum of squared distances after a rotation, where c is the
        correlation of the borders for a first point, and c / |c| the rotation.

    Args:
        first, second: (n,) points around their mean.
        has_grain: only half turns are allowed.
        tolerance: largest distance of matching points.
    """
    correlations: ComplexArray = np.fft.ifft(np.conj(np.fft.fft(first)) * np.fft.fft(second))
    if has_grain:
        correlations = correlations.real.astype(np.complex128)
    squares = float((np.abs(first) ** 2).sum() + (np.abs(second) ** 2).sum())
    for shift in np.flatnonzero(squares - 2 * np.abs(correlations) <= len(first) * tolerance**2).tolist():
        rotation = complex(correlations[shift] / np.abs(correlations[shift]))
        if np.abs(rotation * np.roll(first, shift) - second).max() <= tolerance:
            yield rotation


def _mirrored(points: ComplexArray, is_mirrored: bool) -> ComplexArray:
    return np.conj(points) if is_mirrored else points


def _complex(points: FloatArray) -> ComplexArray:
    return points[:, 0] + 1j * points[:, 1]
