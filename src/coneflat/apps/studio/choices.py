"""What the user of the studio has chosen, and what that means as options of `coneflat.flatten`.

Also what gives the same result without the studio: a command line, and Python.
"""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import chain, pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from ...base import MAX_CONE_ANGLE, shown
from ...errors import OptionError, StudioError
from ...options import Flag, Options, as_number, as_whole, declarations, read_options
from .paint import Paint, Region

#: Options that are chosen as they are; cones and seams are chosen one by one.
PLAIN_OPTIONS = (
    "distortion", "cone_count", "boundary", "stretch", "charts", "seams", "sharp_angle", "hide_seams",
    "resolution", "padding", "repair",
)  # fmt: skip
#: Those of them that say how many cones a search is to find.
NUMBERS = ("distortion", "cone_count")
#: What the boundary may become; a rectangle has four corners, which are picked.
BOUNDARIES = ("free", "lengths", "disk", "straight", "rectangle")
#: What the file's unit of length may be; "" is not known. It changes nothing but the lengths that are shown.
UNITS = ("", "mm", "cm", "m", "inch")

Path = tuple[int, ...]


@dataclass(frozen=True)
class Cone:
    """A cone that the user has placed.

    Attributes:
        vertex: of the input.
        angle: its cone angle, radians; None where the best one is to be computed.
        locked: searches keep it where it is.
    """

    vertex: int
    angle: float | None = None
    locked: bool = False

    @property
    def curvature(self) -> float | None:
        """What its angle lacks of a full turn, radians."""
        return None if self.angle is None else 2 * math.pi - self.angle


@dataclass(frozen=True)
class Choices:
    """What the user has chosen; nothing of it ever changes, a change makes another.

    Attributes:
        options: those of `PLAIN_OPTIONS` that are not left at their defaults.
        by_hand: `cones` are all there are; else a search places others around those that are locked.
        cones: those placed or locked, by vertex.
        cuts: paths along edges, as vertices, that are cut.
        kept: paths along edges that must not be cut.
        paint: what is painted.
        corners: vertices on the boundary, of a rectangle, ascending.
        units: the file's unit of length, and that in which lengths are shown, of `UNITS`.
    """

    options: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    by_hand: bool = False
    cones: tuple[Cone, ...] = ()
    cuts: tuple[Path, ...] = ()
    kept: tuple[Path, ...] = ()
    paint: Paint = field(default_factory=Paint)
    corners: Path = ()
    units: tuple[str, str] = ("", "")

    # Options.

    def with_option(self, name: str, value: Any) -> Choices:
        """Return choices with another value of an option; a number of cones, or a distortion, starts a search.

        Raises:
            OptionError: it is none that the studio has, or the value makes no sense.
        """
        if name not in PLAIN_OPTIONS:
            raise OptionError(f"the studio sets no option {shown(name)}: it has {', '.join(PLAIN_OPTIONS)}")
        if name == "boundary" and value not in BOUNDARIES:
            raise OptionError(f"unknown boundary {shown(value)}: choose from {', '.join(BOUNDARIES)}")
        if name == "seams" and value not in (None, "input"):
            raise OptionError(f"seams are drawn, or those of the file, 'input', not {shown(value)}")
        kept, declared = dict(self.options), declarations(Options)[name]
        if value != "rectangle":
            value = declared.kind.parse(name, value)
        for other in NUMBERS if name in NUMBERS else (name,):
            kept.pop(other, None)
        if value != declared.default or isinstance(declared.kind, Flag):
            kept[name] = value
        chosen = replace(self, options=MappingProxyType(kept))
        return chosen.searching() if name in NUMBERS else chosen

    def searching(self) -> Choices:
        """Return choices with a search, which keeps the places of the cones that are locked."""
        locked = tuple(replace(cone, angle=None) for cone in self.cones if cone.locked)
        return replace(self, by_hand=False, cones=locked)

    # Cones.

    def placed(self, found: Iterable[int]) -> Choices:
        """Return choices by hand: the cones that a search has found, at these vertices, become the user's."""
        if self.by_hand:
            return self
        known = {cone.vertex: cone for cone in self.cones}
        return self._with_cones(by_hand=True, cones=known | {v: Cone(v) for v in found if v not in known})

    def added(self, vertex: int, angle: float | None = None) -> Choices:
        """Return choices with a cone more.

        Raises:
            StudioError: there is one already, or no cone has such an angle.
        """
        if vertex in self._by_vertex():
            raise StudioError(f"vertex {vertex} is a cone already")
        return self._with_cones(cones=self._by_vertex() | {vertex: Cone(vertex, _checked_angle(angle))})

    def moved(self, vertex: int, to: int) -> Choices:
        """Return choices with a cone elsewhere.

        Raises:
            StudioError: there is no cone, or there is one at the other place.
        """
        if vertex == to:
            return self
        cones = self._by_vertex()
        cone = self._cone(vertex)
        if to in cones:
            raise StudioError(f"vertex {to} is a cone already")
        del cones[vertex]
        return self._with_cones(cones=cones | {to: replace(cone, vertex=to)})

    def removed(self, vertex: int) -> Choices:
        """Return choices without a cone.

        Raises:
            StudioError: there is none.
        """
        self._cone(vertex)
        return self._with_cones(cones={v: cone for v, cone in self._by_vertex().items() if v != vertex})

    def angled(self, vertex: int, angle: float | None) -> Choices:
        """Return choices with another angle, radians, of a cone, or one that is to be computed.

        Raises:
            StudioError: there is no cone, or no cone has such an angle.
        """
        cone = replace(self._cone(vertex), angle=_checked_angle(angle))
        return self._with_cones(cones=self._by_vertex() | {vertex: cone})

    def locked(self, vertex: int, locked: bool) -> Choices:
        """Return choices in which searches keep a cone where it is, or need not; one that was found is kept by this."""
        cones = self._by_vertex()
        cone = replace(cones.get(vertex, Cone(vertex)), locked=locked)
        if vertex not in cones and (self.by_hand or not locked):
            raise StudioError(f"vertex {vertex} is not a cone")
        cones[vertex] = cone
        if not self.by_hand and not locked:
            del cones[vertex]
        return self._with_cones(cones=cones)

    # Seams.

    def cut(self, path: Path) -> Choices:
        """Return choices with a path that is cut."""
        return replace(self, cuts=(*self.cuts, _checked(path)))

    def keep_whole(self, path: Path) -> Choices:
        """Return choices with a path that must not be cut."""
        return replace(self, kept=(*self.kept, _checked(path)))

    def erased(self, one: int, two: int) -> Choices:
        """Return choices without the paths that run along the edge between two vertices.

        Raises:
            StudioError: none does.
        """
        edge = frozenset((one, two))
        cuts = tuple(path for path in self.cuts if edge not in edges_of(path))
        kept = tuple(path for path in self.kept if edge not in edges_of(path))
        if len(cuts) + len(kept) == len(self.cuts) + len(self.kept):
            raise StudioError(f"no path was drawn along the edge {one}-{two}")
        return replace(self, cuts=cuts, kept=kept)

    # What is painted, corners, units.

    def painted(self, layer: object, where: Region, weight: object = None) -> Choices:
        """Return choices after a stroke of a brush; see `Paint.stroked`."""
        return replace(self, paint=self.paint.stroked(layer, where, weight))

    def cornered(self, vertex: int) -> Choices:
        """Return choices with another corner of a rectangle, or without the one that is at a vertex.

        Raises:
            StudioError: there are four already.
        """
        corners = {*self.corners} ^ {vertex}
        if len(corners) > 4:
            raise StudioError("a rectangle has 4 corners: pick one of them to take it away first")
        return replace(self, corners=tuple(sorted(corners)))

    def measured_in(self, of_file: object, as_shown: object) -> Choices:
        """Return choices with other units.

        Raises:
            StudioError: they are none, or lengths of unknown unit are to be shown in one.
        """
        for unit in (of_file, as_shown):
            if unit not in UNITS:
                raise StudioError(f"unknown unit {shown(unit)}: choose from {', '.join(UNITS[1:])}")
        if as_shown and not of_file:
            raise StudioError(f"say what the file's unit is before lengths are shown in {as_shown}")
        return replace(self, units=(str(of_file), str(as_shown)))

    def flattens_like(self, other: Choices) -> bool:
        """Whether these choices mean the same layout as others."""
        return replace(self, units=other.units) == other

    # What they mean.

    def keywords(self) -> dict[str, Any]:
        """Return the keyword arguments of `coneflat.flatten` that they mean.

        They are not kept: of painted places they take many times what the choices do, of which undo keeps hundreds.

        Raises:
            OptionError: they do not go together.
        """
        words = dict(self.options)
        if self.by_hand:
            words = {name: value for name, value in words.items() if name not in NUMBERS}
            words["cones"] = {cone.vertex: cone.curvature for cone in self.cones} or "none"
        elif self.cones:
            words["required_cones"] = [cone.vertex for cone in self.cones]
        if words.get("boundary") == "rectangle":
            # While corners are still to be picked, the boundary is free.
            del words["boundary"]
            if len(self.corners) == 4:
                words["boundary"] = dict.fromkeys(self.corners)
        if self.cuts:
            cut = _pairs(self.cuts)
            words["seams"] = ("input", cut) if "seams" in words else cut
        paint = self.paint
        if paint.no_seam:
            words["no_seams"] = np.array([*paint.no_seam.vertices(), *chain(*self.kept)])
        elif self.kept:
            words["no_seams"] = _pairs(self.kept)
        # Of what is painted, as far as it means something: cones placed by hand or locked lie where they are.
        if paint.no_cone and not self.by_hand:
            locked = {cone.vertex for cone in self.cones}
            words["forbidden_cones"] = [v for v in paint.no_cone.vertices() if v not in locked]
        # Where all angles are given there is nothing to weigh.
        if paint.importance and (not self.by_hand or any(cone.angle is None for cone in self.cones)):
            words["weights"] = paint.weights()
        read_options(words)
        return words

    def as_plain(self) -> dict[str, Any]:
        """Return them as JSON holds them."""
        return {
            "options": dict(self.options),
            "by_hand": self.by_hand,
            "cones": [asdict(cone) for cone in self.cones],
            "cuts": [list(path) for path in self.cuts],
            "kept": [list(path) for path in self.kept],
            **({"paint": self.paint.as_plain()} if self.paint else {}),
            **({"corners": list(self.corners)} if self.corners else {}),
            **({"units": list(self.units)} if any(self.units) else {}),
        }

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Choices:
        """Return choices that JSON holds.

        Raises:
            OptionError, StudioError: they make no sense.
            KeyError, TypeError, ValueError, AttributeError: they are not choices at all.
        """
        chosen = cls()
        for name, value in plain["options"].items():
            chosen = chosen.with_option(name, value)
        cones = {}
        for each in plain["cones"]:
            vertex = as_whole("a cone's vertex", each["vertex"])
            angle = None if each["angle"] is None else as_number("a cone's angle", each["angle"])
            if vertex in cones:
                raise StudioError(f"vertex {vertex} is a cone twice")
            cones[vertex] = Cone(vertex, _checked_angle(angle), each["locked"] is True)
        chosen = chosen._with_cones(by_hand=plain["by_hand"] is True, cones=cones)
        for path in plain["cuts"]:
            chosen = chosen.cut(tuple(path))
        for path in plain["kept"]:
            chosen = chosen.keep_whole(tuple(path))
        chosen = replace(chosen, paint=Paint.from_plain(plain.get("paint", {})))
        for vertex in dict.fromkeys(plain.get("corners", ())):
            chosen = chosen.cornered(as_whole("a corner", vertex))
        chosen = chosen.measured_in(*plain.get("units", ("", "")))
        chosen.keywords()
        return chosen

    def _by_vertex(self) -> dict[int, Cone]:
        return {cone.vertex: cone for cone in self.cones}

    def _cone(self, vertex: int) -> Cone:
        cones = self._by_vertex()
        if vertex not in cones:
            raise StudioError(f"vertex {vertex} is not a cone")
        return cones[vertex]

    def _with_cones(self, *, cones: Mapping[int, Cone], by_hand: bool | None = None) -> Choices:
        by_hand = self.by_hand if by_hand is None else by_hand
        # In order of their vertices: the same cones are the same choices, however they came about.
        return replace(self, by_hand=by_hand, cones=tuple(cones[v] for v in sorted(cones)))


def _checked_angle(angle: float | None) -> float | None:
    if angle is not None and not 0 < angle <= MAX_CONE_ANGLE * (1 + 1e-12):
        raise StudioError(
            f"a cone has a positive angle of at most {math.degrees(MAX_CONE_ANGLE):g} degrees, not "
            f"{math.degrees(angle):,g}"
        )
    return angle


def _checked(path: Iterable[Any]) -> Path:
    vertices = tuple(as_whole("a path's vertex", vertex) for vertex in path)
    if len(vertices) < 2 or any(a == b for a, b in pairwise(vertices)):
        raise StudioError(f"a path leads from one vertex to others, not along {shown(list(vertices))}")
    return vertices


def _pairs(paths: Iterable[tuple[int, ...]]) -> Any:
    edges = {tuple(sorted(edge)) for path in paths for edge in edges_of(path)}
    return np.array(sorted(edges), dtype=np.int64)


def edges_of(path: tuple[int, ...]) -> set[frozenset[int]]:
    """Return the edges that a path runs along."""
    return {frozenset(edge) for edge in pairwise(path)}


#: Numbers that are written one by one.
LISTED_NUMBERS = 12


def replay(mesh: str, project: str, choices: Choices) -> dict[str, str]:
    """Return what makes the same layout without the studio: the command line, and Python."""
    return {"command": command_line(mesh, project, choices), "python": python_lines(mesh, choices)}


def command_line(mesh: str, project: str, choices: Choices) -> str:
    """Return a command that flattens a mesh by what was chosen; what was drawn or painted needs the project's file."""
    if choices.cuts or choices.kept or choices.paint:
        return shlex.join(["coneflat", "flatten", "--project", project])
    parts = ["coneflat", "flatten", mesh]
    for name, value in choices.keywords().items():
        flag = "--" + name.replace("_", "-")
        if name == "repair":
            parts += ["--repair"] if value else []
        elif name == "required_cones":
            parts += [flag, ",".join(str(vertex) for vertex in value)]
        elif isinstance(value, dict):
            parts += [flag, ",".join(_cone_text(vertex, curvature) for vertex, curvature in value.items())]
        else:
            parts += [flag, repr(value) if isinstance(value, float) else str(value)]
    return shlex.join(parts)


def python_lines(mesh: str, choices: Choices) -> str:
    """Return Python that flattens a mesh by what was chosen."""
    given = [f"    {name}={_written(value)}," for name, value in choices.keywords().items()]
    if sum(map(len, given)) > 20_000:  # letters in the panel
        return "# What was drawn or painted is too much to be written here; the project's file has it."
    call = "\n".join([f"result = coneflat.flatten(\n    {mesh!r},", *given, ")"])
    return f"import coneflat\n\n{call}"


def _cone_text(vertex: int, curvature: float | None) -> str:
    return str(vertex) if curvature is None else f"{vertex}:{curvature!r}"


def _written(value: Any) -> str:
    if hasattr(value, "tolist"):
        return repr(value.tolist())
    if isinstance(value, tuple):
        return f"({', '.join(_written(each) for each in value)})"
    if isinstance(value, list) and len(value) > LISTED_NUMBERS:
        return f"[{_ranges(value)}]"
    if isinstance(value, dict) and len(value) > LISTED_NUMBERS:
        # Those that have one value are together.
        groups: dict[Any, list[int]] = {}
        for vertex, each in value.items():
            groups.setdefault(each, []).append(vertex)
        if len(groups) <= LISTED_NUMBERS:
            parts = (
                f"**dict.fromkeys([{_ranges(sorted(group))}], {each!r})" for each, group in groups.items()
            )
            return f"{{{', '.join(parts)}}}"
    return repr(value)


def _ranges(vertices: list[int]) -> str:
    """Return vertices, ascending, as they stand in brackets: those that follow each other as a range."""
    runs = Region.of_runs((vertex, vertex) for vertex in vertices).runs
    return ", ".join(str(a) if a == b else f"*range({a}, {b + 1})" for a, b in runs)
