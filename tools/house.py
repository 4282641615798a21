"""The house: which rooms there are, and who imports whom; `tools/remake.py` draws it for the documentation.

Rooms stand on floors. A file imports from its own floor and from those below.
"""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from html import escape
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "src" / "coneflat"

#: Rooms, from the ground up; a room is a folder, or a file beside them.
FLOORS: tuple[tuple[str, ...], ...] = (
    ("", "errors", "text"),
    ("_arrays", "_sets", "compiled", "threads", "progress", "kept"),
    ("mesh", "options"),
    ("geometry", "solver"),
    ("quality", "seams"),
    ("input",),
    ("cones", "layout"),
    ("flat",),
    ("atlas",),
    ("result",),
    ("pipeline", "curve", "flattener"),
    ("grid",),
    ("files", "view"),
    ("ahead", "apps", "sample"),
    ("__main__",),
)
#: What rooms hold, in about five words; of others the first line of their docstring tells.
HOLDS = {
    "": "what users import, by name",
    "errors": "all that users can cause",
    "text": "words for messages",
    "_arrays": "array types, users' arrays checked",
    "_sets": "sets by union and find",
    "compiled": "the decorator of kernels",
    "threads": "cores, two stages at once",
    "progress": "stages timed and told",
    "kept": "what has been computed",
    "mesh": "half-edges, borders, components, genus",
    "options": "every option, declared once",
    "geometry": "lengths, angles, flips, predicates, overlap",
    "solver": "sparse systems, four back ends",
    "quality": "distortion, seams, rotations measured",
    "seams": "costs, trees, cutting, straightening",
    "input": "validation, repair, welding, constraints",
    "cones": "where the curvature goes",
    "layout": "unfolding, untangling, refining",
    "flat": "flat metrics, a place per method",
    "atlas": "overlaps taken away, charts packed",
    "result": "measures, notes, report, promises",
    "pipeline": "flatten: the method on one screen",
    "curve": "distortion by number of cones",
    "flattener": "one mesh again and again",
    "grid": "whole translations, quads",
    "files": "OBJ, PLY, STL, OFF, glTF, NPZ",
    "view": "figures for print, the page",
    "sample": "the model that ships",
    "ahead": "kernels compiled at the build",
    "apps": "commands, batches, comparisons",
    "__main__": "python -m coneflat",
}


@dataclass(frozen=True)
class Room:
    """A room of the house.

    Attributes:
        name: "" for the package itself.
        holds: what is in it, in a few words.
        files, lines: how many.
        below: the rooms that its files import.
    """

    name: str
    holds: str
    files: int
    lines: int
    below: frozenset[str]


@dataclass(frozen=True)
class Module:
    """A file of the package.

    Attributes:
        name: without the package's, "" for the package itself.
        path: the file.
        imports: modules of the package that it imports when it is loaded.
        late_imports: those that functions of it import when they are called.
    """

    name: str
    path: Path
    imports: frozenset[str]
    late_imports: frozenset[str]


def floor_of(name: str) -> int | None:
    """Return the floor that a module is on, from 0; None for a room that has none."""
    room = name.partition(".")[0]
    return next((i for i, rooms in enumerate(FLOORS) if room in rooms), None)


def read_modules(package: Path = PACKAGE) -> dict[str, Module]:
    """Return the modules of a package by name; what only type checkers import does not count."""
    paths = {}
    for path in sorted(package.rglob("*.py")):
        parts = path.relative_to(package).with_suffix("").parts
        paths[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return {name: _read(name, path, paths) for name, path in paths.items()}


def _read(name: str, path: Path, paths: dict[str, Path]) -> Module:
    now, late = set[str](), set[str]()
    package = name.split(".") if path.stem == "__init__" else name.split(".")[:-1]
    package = [part for part in package if part]

    def walk(node: ast.AST, inside: bool) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING":
                continue
            if isinstance(child, ast.ImportFrom) and child.level:
                base = package[: len(package) - child.level + 1] + (child.module or "").split(".")
                home = ".".join(part for part in base if part)
                for alias in child.names:
                    full = f"{home}.{alias.name}".strip(".")
                    (late if inside else now).add(full if full in paths else home)
            walk(child, inside or isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)))

    walk(ast.parse(path.read_text(encoding="utf-8")), False)
    return Module(name, path, frozenset(now - {name}), frozenset(late - now - {name}))


def rooms_of(package: Path = PACKAGE) -> list[list[Room]]:
    """Return the rooms of each floor, from the ground up."""
    by_room: dict[str, list[Module]] = {}
    for name, module in read_modules(package).items():
        by_room.setdefault(name.partition(".")[0], []).append(module)

    def room(name: str) -> Room:
        modules = by_room[name]
        texts = [module.path.read_text(encoding="utf-8") for module in modules]
        said = (ast.get_docstring(ast.parse(texts[0])) or "").split("\n")[0]
        below = {
            other.partition(".")[0] for module in modules for other in module.imports | module.late_imports
        }
        floor = floor_of(name) or 0
        return Room(
            name,
            HOLDS.get(name) or said.rstrip("."),
            len(modules),
            sum(text.count("\n") for text in texts),
            frozenset(other for other in below - {name} if (floor_of(other) or 0) <= floor),
        )

    return [[room(name) for name in rooms if name in by_room] for rooms in FLOORS]


# Points of the drawing: a floor and the room between two, a letter of a name and one of small print.
FLOOR, GAP, LETTER, SMALL = 58.0, 34.0, 8.6, 6.0
WIDTH = 1000.0


def draw_house(package: Path = PACKAGE) -> str:
    """Return a drawing of the house as SVG: rooms on floors, and arrows to the rooms that each is built on.

    What a room reaches through another has no arrow of its own.
    """
    floors = rooms_of(package)
    rooms = {room.name: room for floor in floors for room in floor}
    places: dict[str, tuple[float, float, float]] = {}  # middle, top and width
    for level, floor in enumerate(reversed(floors)):
        widths = [
            max(LETTER * len(_title(room)), SMALL * max(len(room.holds), len(_size(room)))) + 20
            for room in floor
        ]
        gap = (WIDTH - sum(widths)) / (len(floor) + 1)
        left = gap
        for room, width in zip(floor, widths, strict=True):
            places[room.name] = (left + width / 2, 10 + level * (FLOOR + GAP), width)
            left += width + gap
    height = 20 + len(floors) * (FLOOR + GAP) - GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:g}" font-family="sans-serif">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0 0 8 4 0 8z" fill="#7d8f9e"/></marker></defs>',
        f'<rect width="{WIDTH:g}" height="{height:g}" fill="#ffffff"/>',
    ]
    for name, room in rooms.items():
        lines += [_arrow(places[name], places[other]) for other in sorted(_direct(room, rooms))]
    for number, floor in enumerate(floors):
        for room in floor:
            lines.append(_box(room, number, *places[room.name]))
    return "\n".join([*lines, "</svg>", ""])


def rooms_drawn(drawing: str) -> list[list[str]]:
    """Return the names of the rooms that a drawing shows, floor by floor from the ground up."""
    floors: dict[int, list[str]] = {}
    for name, floor in re.findall(r'<g id="room-(\w*)" data-floor="(\d+)">', drawing):
        floors.setdefault(int(floor), []).append(name)
    return [floors[number] for number in sorted(floors)]


def _title(room: Room) -> str:
    return room.name or "coneflat"


def _size(room: Room) -> str:
    return f"{room.files} file{'s'[: room.files > 1]}, {room.lines:,} lines"


def _direct(room: Room, rooms: dict[str, Room]) -> set[str]:
    """Return the rooms below that are not reached through another room below, on floors of their own."""
    reached: set[str] = set()
    for other in room.below:
        waiting = set(rooms[other].below)
        while waiting:
            name = waiting.pop()
            if name not in reached:
                reached.add(name)
                waiting |= rooms[name].below
    return {other for other in room.below - reached if other}


def _arrow(start: tuple[float, float, float], end: tuple[float, float, float]) -> str:
    (x, top, _), (to_x, to_top, _) = start, end
    if top == to_top:  # neighbours on a floor
        side = 1 if to_x > x else -1
        line = f"M{x + side * start[2] / 2:.0f} {top + FLOOR / 2:.0f}H{to_x - side * end[2] / 2:.0f}"
    else:
        y, middle = top + FLOOR, (top + FLOOR + to_top) / 2
        line = f"M{x:.0f} {y:.0f}C{x:.0f} {middle:.0f} {to_x:.0f} {middle:.0f} {to_x:.0f} {to_top:.0f}"
    return f'<path d="{line}" fill="none" stroke="#7d8f9e" stroke-width="1.2" marker-end="url(#tip)"/>'


def _box(room: Room, floor: int, x: float, top: float, width: float) -> str:
    def text(below: float, size: int, colour: str, words: str, weight: str = "normal") -> str:
        return (
            f'<text x="{x:.0f}" y="{top + below:.0f}" font-size="{size}" font-weight="{weight}" fill="{colour}" '
            f'text-anchor="middle">{escape(words)}</text>'
        )

    return (
        f'<g id="room-{room.name}" data-floor="{floor}"><rect x="{x - width / 2:.0f}" y="{top:.0f}" '
        f'width="{width:.0f}" height="{FLOOR:g}" rx="4" fill="#e9eff4" stroke="#40566a"/>'
        + text(20, 14, "#1d2b36", _title(room), "bold")
        + text(36, 11, "#1d2b36", room.holds)
        + text(51, 10, "#5c6f7e", _size(room))
        + "</g>"
    )
