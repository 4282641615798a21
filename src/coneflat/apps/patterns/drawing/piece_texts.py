"""Numbers, names, grain lines and angles: where they stand in a piece."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ....base import FloatArray
from ..pieces.polylines import distances
from ..units import area_text
from .allowances import shapely
from .drawing import Line, Text
from .labels import LINE_HEIGHT, Labels, readable_angle, text_width

if TYPE_CHECKING:
    from shapely import Polygon

# Factors of the height of a number that stands alone.
NUMBER_FACTORS = (1.6, 1.2, 1.0, 0.75, 0.5)
# Heights of capitals, mm, the largest that has room is chosen: numbers of pieces, relative to the largest circle in a
# piece and at most; what stands below them; names of seams; angles of folds.
NUMBER_PER_RADIUS, MAX_NUMBER, BELOW_NUMBER = 0.35, 9.0, 0.4
SEAM_SIZES, ANGLE_SIZES = (3.0, 2.4, 1.8, 1.3), (2.0, 1.5, 1.2)
MIN_TEXT = 1.3
# Height of a number outside its piece, and its distances from the largest circle in the piece, mm.
OUTSIDE_NUMBER, OUTSIDE_DISTANCES = 2.0, tuple(range(3, 40, 2))
# Places along a side, as fractions of its length, and distances from it relative to the text, in the order in which
# they are tried for its name.
ALONG, INWARD = (0.5, 0.42, 0.58, 0.33, 0.67, 0.22, 0.78, 0.12, 0.88), (1.1, 1.6)
# Height of names at the end of a line that leads to their side, the distances of their middles from it, mm, and the
# angles to the normal of the side that are tried.
LEADER_SIZE, LEADER_DISTANCES = 1.8, (6.0, 9.0, 12.0, 16.0, 20.0, 26.0, 32.0, 40.0, 50.0)
LEADER_TURNS = (0.0, 0.35, -0.35, 0.8, -0.8, 1.2, -1.2)
# Longest and shortest grain line, and length of the arms of its arrows, mm; lengths and places of its middle that are
# tried, as fractions of the length of the piece there.
MAX_GRAIN, MIN_GRAIN, ARROW = 120.0, 10.0, 3.0
GRAINS = ((0.7, 0.5), (0.35, 0.5), (0.3, 0.75), (0.3, 0.25), (0.15, 0.7), (0.15, 0.3))
# Accuracy of the centre of a piece, relative to the size of the piece.
CENTRE_ACCURACY = 0.01


def add_number(
    room: Labels, outside: Labels, piece: int, area: float, pages: Sequence[Polygon]
) -> Iterator[Line]:
    """Place the number of a piece, its count and area around the centre of the largest circle inside.

    In a tiny piece, the number is placed outside; yield the line that leads to it.

    Args:
        room: the piece.
        outside: what is outside of all pieces.
        piece: the piece, from 0.
        area: its area, mm^2.
        pages: the rectangles of the pages, if there are several: the circle is on one of them.
    """
    centre, radius = _largest_circle(room.shape, pages)
    size = min(max(NUMBER_PER_RADIUS * radius, MIN_TEXT), MAX_NUMBER)
    below = max(BELOW_NUMBER * size, MIN_TEXT)
    number, details = str(piece + 1), f"cut 1 \u00b7 {area_text(area)}"
    step = LINE_HEIGHT * (size + below) / 2
    has_block = np.hypot(step, text_width(details, below) / 2) <= radius
    sizes = [size * factor for factor in NUMBER_FACTORS if size * factor >= MIN_TEXT]
    for crosses_lines in (False, True):
        if has_block:
            block = Text(number, centre + np.array([0.0, 0.4 * step]), size)
            if room.add([block], crosses_lines):
                below_block = centre - np.array([0.0, 0.7 * step])
                room.add([Text(details, below_block, below)], crosses_lines)
                return
        if room.add([Text(number, centre, factored) for factored in sizes], crosses_lines):
            return
    text = outside.add(
        Text(number, centre + (radius + distance) * direction, OUTSIDE_NUMBER)
        for distance, direction in product(OUTSIDE_DISTANCES, _directions())
    )
    if text is not None:
        away = text.place - centre
        end = centre + away * (1 - OUTSIDE_NUMBER / np.linalg.norm(away))
        yield Line("mark", np.array([centre, end]))


def _largest_circle(shape: Polygon, pages: Sequence[Polygon]) -> tuple[FloatArray, float]:
    """Return the centre and the radius of the largest circle in a shape, and on one of some pages if there are any."""
    accuracy = CENTRE_ACCURACY * float(np.ptp(np.asarray(shape.exterior.coords), axis=0).max())
    on_pages = [shape.intersection(page) for page in pages if page.intersects(shape)]
    parts = [part for on_page in on_pages for part in shapely().get_parts(on_page) if part.area > 0]
    circles = [
        shapely().maximum_inscribed_circle(part, tolerance=accuracy)
        for part in (parts if len(on_pages) > 1 else [shape])
    ]
    circle = max(circles, key=lambda line: round(float(line.length), 6))
    return np.asarray(circle.coords)[0], float(circle.length)


def _directions() -> FloatArray:
    angles = 2 * np.pi * np.arange(16) / 16
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def add_grain(room: Labels) -> Iterator[Line]:
    """Place a vertical line with arrows, the grain, where the piece is longest; yield its lines."""
    low, _, high, _ = room.shape.bounds
    columns = low + (high - low) * (np.arange(25) + 0.5) / 25
    chords = [chord for x in columns.tolist() for chord in _chords(room, x)]
    for x, bottom, top in sorted(chords, key=lambda chord: (round(chord[1] - chord[2], 3), chord[0])):
        for share, at in GRAINS:
            half = min(share * (top - bottom), MAX_GRAIN) / 2
            if 2 * half < MIN_GRAIN:
                continue
            middle = bottom + at * (top - bottom)
            ends = np.array([[x, middle - half], [x, middle + half]])
            box = shapely().box(x - ARROW / 2 - 1, middle - half - 1, x + ARROW / 2 + 1, middle + half + 1)
            if room.is_free(box):
                room.cover(box)
                yield Line("mark", ends)
                for end, sign in ((ends[0], 1.0), (ends[1], -1.0)):
                    arms = np.array([[-ARROW / 3, sign * ARROW], [0.0, 0.0], [ARROW / 3, sign * ARROW]])
                    yield Line("mark", end + arms)
                return


def _chords(room: Labels, x: float) -> Iterator[tuple[float, float, float]]:
    """Yield the parts of a vertical line inside a piece: its place, and the lower and upper ends."""
    _, low, _, high = room.shape.bounds
    line = shapely().LineString([(x, low - 1), (x, high + 1)])
    for part in shapely().get_parts(shapely().intersection(room.shape, line)):
        _, bottom, _, top = part.bounds
        yield x, bottom, top


def add_seam_name(
    rooms: tuple[Labels, Labels, Labels], name: str, side: FloatArray, width: float
) -> list[Line] | None:
    """Place the name of a seam along a side, near its middle: inside the piece, or else outside.

    A name without room there is placed farther away, and the line that leads to it is returned; None if there is no
    room either.

    Args:
        rooms: the piece, its allowance, and what is outside.
        name: the text.
        side: (k, 2) the points of the side.
        width: width of its allowance, mm.
    """
    along = distances(side)
    inside, allowance, outside = rooms
    sizes = [size for size in SEAM_SIZES if LINE_HEIGHT * size <= width]

    def texts(sizes: Sequence[float], shifts: Sequence[float], start: float = 0.0) -> Iterator[Text]:
        for size in sizes:
            half = min(text_width(name, size), float(along[-1])) / 2
            # Along a side that is shorter than the text, there is only one place.
            middles = dict.fromkeys(min(max(share * along[-1], half), along[-1] - half) for share in ALONG)
            for shift, middle in product(shifts, middles):
                yield _beside(name, side, along, middle, half, size, start + shift * size)

    text = (
        inside.add(texts(SEAM_SIZES, INWARD))
        or allowance.add(texts(sizes, (0.0,), -width / 2))
        or outside.add(texts(SEAM_SIZES[2:-1], (-INWARD[0], -INWARD[1], -3.0), -width))
        or inside.add(texts(SEAM_SIZES[2:-1], INWARD), crosses_lines=True)
    )
    if text is not None:
        return []
    middle = np.array([np.interp(along[-1] / 2, along, column) for column in side.T])
    chord = side[-1] - side[0]
    text = inside.add(_around(name, middle, chord)) or outside.add(_around(name, middle, chord))
    return None if text is None else [Line("mark", np.array([middle, _nearest_end(text, middle)]))]


def _around(name: str, middle: FloatArray, chord: FloatArray) -> Iterator[Text]:
    """Yield horizontal texts around the middle of a side, the nearest first; chord: (2,) from its start to its end."""
    normal = np.arctan2(chord[0], -chord[1])
    for distance, turn in product(LEADER_DISTANCES, LEADER_TURNS):
        for angle in (normal + turn, normal + turn + np.pi):
            place = middle + distance * np.array([np.cos(angle), np.sin(angle)])
            yield Text(name, place, LEADER_SIZE)


def _nearest_end(text: Text, point: FloatArray) -> FloatArray:
    """Return the middle of the left or the right end of a horizontal text, whichever is nearer to a point."""
    half = np.array([text_width(text.text, text.size) / 2, 0.0])
    ends = [text.place - half, text.place + half]
    return min(ends, key=lambda end: float(np.linalg.norm(end - point)))


def _beside(
    name: str, side: FloatArray, along: FloatArray, middle: float, half: float, size: float, inward: float
) -> Text:
    """Return a text beside a side; the direction is that of the part of the side as long as the text.

    Args:
        name: the text.
        side: (k, 2) the points of the side.
        along: (k,) their distances along it.
        middle: the distance of the middle of the part.
        half: half the length of the part.
        size: height of capitals.
        inward: distance from the side, negative for outside.
    """
    start, place, stop = (
        np.array([np.interp(at, along, column) for column in side.T])
        for at in (middle - half, middle, middle + half)
    )
    chord = stop - start
    length = float(np.linalg.norm(chord))
    direction = chord / length if length > 0 else np.array([1.0, 0.0])
    normal = np.array([-direction[1], direction[0]]) * (1.0 if inward >= 0 else -1.0)
    # A side that bulges towards the text is nearer to it than its chord.
    heights = (side[(along >= middle - half) & (along <= middle + half)] - place) @ normal
    bulge = max(float(heights.max(initial=0.0)), 0.0)
    return Text(name, place + (bulge + abs(inward)) * normal, size, readable_angle(direction))


def add_angle(room: Labels, ends: FloatArray, angle: float, radius: float = 0.0) -> None:
    """Place the angle of a fold, in degrees, and its radius along its line (2, 2), if there is room."""
    text = f"{abs(np.degrees(angle)):.0f}\u00b0" + (f" R {radius:.3g}" if radius > 0 else "")
    vector = ends[1] - ends[0]
    length = float(np.linalg.norm(vector))
    direction = vector / length
    normal = np.array([-direction[1], direction[0]])
    room.add(
        Text(text, ends[0] + share * vector + shift * size * normal, size, readable_angle(direction))
        for size, shift, share in product(ANGLE_SIZES, (0.95, -0.95), (0.5, 0.35, 0.65))
        if text_width(text, size) <= length
    )
