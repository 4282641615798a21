"""Charts that the user of the studio has moved or pinned, and the layout with the others packed around them."""

from __future__ import annotations

import cmath
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ... import Flattening, repack
from ...atlas import similarities
from ...base import IntArray, plural
from ...errors import StudioError
from ...mesh import label_faces
from ...options import as_number
from .paths import as_vertex


class Pin(NamedTuple):
    """The place of a chart, relative to the layout without pins.

    Attributes:
        face: a triangle of the chart.
        factor, shift: the point z = u + iv comes to factor * z + shift.
    """

    face: int
    factor: complex = 1
    shift: complex = 0

    @classmethod
    def from_plain(cls, plain: Iterable[Any]) -> Pin:
        """Return the pin in values from JSON: the triangle, and the real and imaginary parts of the two numbers.

        Raises:
            OptionError, StudioError: they are not a pin.
        """
        face, *numbers = plain
        a, b, u, v = (as_number("a place of a chart", number) for number in numbers)
        factor, shift = complex(a, b), complex(u, v)
        if not (cmath.isfinite(factor) and cmath.isfinite(shift)) or abs(factor) < MIN_FACTOR:
            raise StudioError(f"the place of a chart must be finite, and its scale not 0, got {numbers}")
        return cls(as_vertex("a triangle", face), factor, shift)

    def as_plain(self) -> list[float]:
        """Return the pin as values for JSON."""
        return [self.face, self.factor.real, self.factor.imag, self.shift.real, self.shift.imag]


#: Smallest scale of a pinned chart.
MIN_FACTOR = 1e-6


@dataclass(frozen=True)
class Pins:
    """The pinned charts.

    Attributes:
        pins: one for each chart, sorted by triangle.
        is_packed: whether the other charts are packed around them.
    """

    pins: tuple[Pin, ...] = ()
    is_packed: bool = False

    def with_pin(self, pin: Pin) -> Pins:
        """Return the pins with a chart at another place."""
        return replace(self, pins=tuple(sorted((*self.without(pin.face).pins, pin))))

    def without(self, face: int) -> Pins:
        """Return the pins without that of a triangle."""
        return replace(self, pins=tuple(pin for pin in self.pins if pin.face != face))

    def applied(self, result: Flattening) -> Flattening:
        """Return a layout with these pins, measured.

        Of several pins of one chart, and of triangles that the mesh does not have, the others are left out, with a
        note.

        Raises:
            OptionError: as of `coneflat.repack`.
        """
        chart, _ = chart_of_faces(result)
        pin_of_chart: dict[int, Pin] = {}
        for pin in self.pins:
            if pin.face < len(chart):
                pin_of_chart.setdefault(int(chart[pin.face]), pin)
        if not pin_of_chart:
            return result
        moves = {pin.face: (pin.factor, pin.shift) for pin in pin_of_chart.values()}
        changed = repack(result, moves=moves, pack=self.is_packed)
        left = len(self.pins) - len(pin_of_chart)
        note = f"{plural(left, 'pin')} left out: their charts are joined with others that are pinned."
        return replace(changed, notes=(*changed.notes, note)) if left else changed

    def code(self) -> str:
        """Return Python code that applies the pins to a `result`."""
        moves = ", ".join(f"{pin.face}: ({pin.factor!r}, {pin.shift!r})" for pin in self.pins)
        return f"result = coneflat.repack(result, moves={{{moves}}}, pack={self.is_packed})"

    def as_plain(self) -> dict[str, Any]:
        """Return the pins as values for JSON."""
        return {"pins": [pin.as_plain() for pin in self.pins], "packed": self.is_packed}

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Pins:
        """Return the pins in values from JSON.

        Raises:
            OptionError, StudioError, KeyError, TypeError, ValueError: they are not pins.
        """
        pins = cls(is_packed=plain["packed"] is True)
        for values in plain["pins"]:
            pins = pins.with_pin(Pin.from_plain(values))
        return pins


NO_PINS = Pins()


def chart_of_faces(result: Flattening) -> tuple[IntArray, int]:
    """Return (m,) the chart of each triangle, from 0, and the number of charts."""
    _, label = label_faces(result.uv_faces, len(result.uv))
    charts, chart = np.unique(label, return_inverse=True)
    return chart, len(charts)


def places_of_charts(
    before: Flattening, after: Flattening, pins: Pins, drawn: IntArray
) -> Iterator[list[float]]:
    """Yield for each drawn chart a drawn triangle, a triangle of the mesh, its place as of `Pin`, and if it is pinned.

    Args:
        before, after: the layouts without and with the pins.
        pins: the pins.
        drawn: (d,) the triangles that are drawn, ascending.
    """
    chart, count = chart_of_faces(after)
    moves = similarities(before.corner_uv, after.corner_uv, chart, count)
    pinned = {int(chart[pin.face]): pin for pin in reversed(pins.pins) if pin.face < len(chart)}
    numbers, first = np.unique(chart[drawn], return_index=True)
    for number, index in zip(numbers.tolist(), first.tolist(), strict=True):
        place = Pin(int(drawn[index]), complex(moves.factor[number]), complex(moves.shift[number]))
        yield [index, *pinned.get(number, place).as_plain(), float(number in pinned)]
