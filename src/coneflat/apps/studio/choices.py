"""The choices of the user of the studio, and their conversion to options of `flatten` or `unwrap` of `coneflat`.

They are also converted to a command line and to Python code that give the same result without the studio.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import chain
from types import MappingProxyType
from typing import Any

import numpy as np

from ...base import MAX_CONE_ANGLE, IntArray, short_repr
from ...errors import OptionError, StudioError
from ...options import Flag, Options, as_number, declarations, read_options
from ...textures import UnwrapOptions
from .paint import Paint, Region
from .paths import Path, as_vertex, checked_path, edge_pairs, edges_of
from .pins import Pins

#: Options whose controls are made from their declarations, with the labels of these.
FURTHER_OPTIONS = {
    "area": "Area distortion at most", "packing_cuts": "Cuts for packing", "stack": "Stack halves",
    "lightmap": "Lightmap, texels",
    "search_time": "Search time, s",
    "tiles": "Tiles (UDIM)", "up": "Up in the texture",
    "quantise": "Multiples of angle, °", "max_cones": "Cones at most", "min_cone_angle": "Smallest cone angle, °",
    "max_cone_angle": "Largest cone angle, °", "relax": "Relax",
}  # fmt: skip
#: Options that the studio sets directly; cones and seams are edited individually.
PLAIN_OPTIONS = (
    "distortion", "cone_count", "boundary", "stretch", "charts", "seams", "sharp_angle", "hide_seams",
    "resolution", "padding", "repair", "max_energy", "texel_density", *FURTHER_OPTIONS,
)  # fmt: skip
#: Declarations of all options, by name; those of both kinds of maps take further values for textures.
DECLARED = declarations(Options) | declarations(UnwrapOptions)
#: Options that determine the number of cones of a search, and all options of a search.
NUMBERS = ("distortion", "cone_count")
SEARCH = (*NUMBERS, "quantise", "max_cones", "min_cone_angle", "max_cone_angle")
#: Options of which at most one is set.
SINGLE = (NUMBERS, ("resolution", "texel_density", "lightmap"), ("max_energy", "area"))
#: Shapes of the boundary; the four corners of a rectangle are picked by the user.
BOUNDARIES = ("free", "lengths", "disk", "straight", "rectangle")
#: Units of length of a file; "" if unknown. They affect only the lengths that are shown.
UNITS = ("", "mm", "cm", "m", "inch")


@dataclass(frozen=True)
class Cone:
    """A cone that the user has placed.

    Attributes:
        vertex: vertex of the input.
        angle: cone angle in radians; None if it is computed.
        locked: whether searches must keep it.
    """

    vertex: int
    angle: float | None = None
    locked: bool = False

    @property
    def curvature(self) -> float | None:
        """Return its curvature, 2 pi minus the angle, in radians; None if it is computed."""
        return None if self.angle is None else 2 * math.pi - self.angle


@dataclass(frozen=True)
class Choices:
    """The choices of the user; immutable, changes return new choices.

    Attributes:
        options: values of those `PLAIN_OPTIONS` that differ from their defaults.
        by_hand: whether `cones` are all cones; otherwise a search adds others to the locked ones.
        cones: placed or locked cones, sorted by vertex.
        cuts: paths along edges that are cut, as vertices.
        uncut: paths along edges that must not be cut.
        paint: painted regions.
        corners: corners of a rectangle, vertices on the boundary, ascending.
        units: unit of length of the file, and the one in which lengths are shown, of `UNITS`.
        for_texture: whether the map is that of `coneflat.unwrap`, which uses neither cones nor a boundary.
        pins: charts of a map for a texture that are moved or pinned.
    """

    options: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    by_hand: bool = False
    cones: tuple[Cone, ...] = ()
    cuts: tuple[Path, ...] = ()
    uncut: tuple[Path, ...] = ()
    paint: Paint = field(default_factory=Paint)
    corners: Path = ()
    units: tuple[str, str] = ("", "")
    for_texture: bool = False
    pins: Pins = field(default_factory=Pins)

    # Options.

    def with_option(self, name: str, value: Any) -> Choices:
        """Return choices with another value of an option; an option of `NUMBERS` also starts a search.

        Raises:
            OptionError: the studio does not set this option, or the value is not valid.
        """
        if name not in PLAIN_OPTIONS:
            raise OptionError(f"unknown option {short_repr(name)}: choose from {', '.join(PLAIN_OPTIONS)}")
        if name == "boundary" and value not in BOUNDARIES:
            raise OptionError(f"unknown boundary {short_repr(value)}: choose from {', '.join(BOUNDARIES)}")
        if name == "seams" and value not in (None, "input", "none"):
            raise OptionError(f"seams must be drawn, 'input' or 'none', got {short_repr(value)}")
        options, declared = dict(self.options), DECLARED[name]
        if value != "rectangle":
            value = declared.kind.parse(name, value)
        for exclusive in next((names for names in SINGLE if name in names), (name,)):
            options.pop(exclusive, None)
        if value != declared.default or isinstance(declared.kind, Flag):
            options[name] = value
        chosen = replace(self, options=MappingProxyType(options))
        return chosen.with_search() if name in NUMBERS else chosen

    def with_search(self) -> Choices:
        """Return choices with a search for cones of a conformal map, which keeps the locked cones."""
        locked = tuple(replace(cone, angle=None) for cone in self.cones if cone.locked)
        return replace(self, by_hand=False, cones=locked, for_texture=False)

    def with_texture(self, for_texture: bool) -> Choices:
        """Return choices for a map for a texture, or for a conformal map; both keep the settings of the other."""
        return replace(self, for_texture=for_texture)

    # Cones.

    def placed(self, vertices: Iterable[int]) -> Choices:
        """Return choices without a search: the cones that it has found, at these vertices, become placed cones."""
        if self.by_hand:
            return self
        cones = {vertex: Cone(vertex) for vertex in vertices} | self._by_vertex()
        return replace(self, by_hand=True)._with_cones(cones)

    def added(self, vertex: int, angle: float | None = None) -> Choices:
        """Return choices with a further cone.

        Raises:
            StudioError: the vertex is a cone already, or the angle is not valid.
        """
        if vertex in self._by_vertex():
            raise StudioError(f"vertex {vertex} is a cone already")
        return self._with_cones(self._by_vertex() | {vertex: Cone(vertex, _checked_angle(angle))})

    def moved(self, vertex: int, to: int) -> Choices:
        """Return choices with a cone moved to another vertex.

        Raises:
            StudioError: the vertex is not a cone, or the other vertex is one.
        """
        if vertex == to:
            return self
        cone, remaining = self._cone(vertex), self.removed(vertex)._by_vertex()
        if to in remaining:
            raise StudioError(f"vertex {to} is a cone already")
        return self._with_cones(remaining | {to: replace(cone, vertex=to)})

    def removed(self, vertex: int) -> Choices:
        """Return choices without a cone.

        Raises:
            StudioError: the vertex is not a cone.
        """
        self._cone(vertex)
        return self._with_cones({v: cone for v, cone in self._by_vertex().items() if v != vertex})

    def with_angle(self, vertex: int, angle: float | None) -> Choices:
        """Return choices with another angle of a cone, in radians; None if it must be computed.

        Raises:
            StudioError: the vertex is not a cone, or the angle is not valid.
        """
        cone = replace(self._cone(vertex), angle=_checked_angle(angle))
        return self._with_cones(self._by_vertex() | {vertex: cone})

    def locked(self, vertex: int, locked: bool) -> Choices:
        """Return choices with a cone locked or unlocked; locking also works for cones that a search has found."""
        if not self.by_hand and not locked:
            return self.removed(vertex)
        cone = self._cone(vertex) if self.by_hand else self._by_vertex().get(vertex, Cone(vertex))
        return self._with_cones(self._by_vertex() | {vertex: replace(cone, locked=locked)})

    # Seams.

    def cut(self, path: Path) -> Choices:
        """Return choices with a further path that is cut."""
        return replace(self, cuts=(*self.cuts, checked_path(path)))

    def with_uncut(self, path: Path) -> Choices:
        """Return choices with a further path that must not be cut."""
        return replace(self, uncut=(*self.uncut, checked_path(path)))

    def erased(self, start: int, end: int) -> Choices:
        """Return choices without the paths that contain the edge between two vertices.

        Raises:
            StudioError: there is no such path.
        """
        edge = frozenset((start, end))
        paths_before = self.cuts, self.uncut
        cuts, uncut = (tuple(path for path in paths if edge not in edges_of(path)) for paths in paths_before)
        if (cuts, uncut) == paths_before:
            raise StudioError(f"no path contains the edge {start}-{end}")
        return replace(self, cuts=cuts, uncut=uncut)

    # Paint, corners, units.

    def painted(self, layer: object, where: Region, weight: object = None) -> Choices:
        """Return choices after a stroke of the brush; see `Paint.with_stroke`."""
        return replace(self, paint=self.paint.with_stroke(layer, where, weight))

    def with_corner(self, vertex: int) -> Choices:
        """Return choices with a corner of the rectangle added, or removed if the vertex is one.

        Raises:
            StudioError: there are four corners already.
        """
        corners = {*self.corners} ^ {vertex}
        if len(corners) > 4:
            raise StudioError("a rectangle has 4 corners: pick one of them to remove it first")
        return replace(self, corners=tuple(sorted(corners)))

    def with_units(self, of_file: object, shown: object) -> Choices:
        """Return choices with other units of length.

        Raises:
            StudioError: a unit is unknown, or a unit to show is given without that of the file.
        """
        for unit in (of_file, shown):
            if unit not in UNITS:
                raise StudioError(f"unknown unit {short_repr(unit)}: choose from {', '.join(UNITS[1:])}")
        if shown and not of_file:
            raise StudioError(f"set the unit of the file before lengths are shown in {shown}")
        return replace(self, units=(str(of_file), str(shown)))

    def flattens_like(self, choices: Choices) -> bool:
        """Return whether these choices give the same layout as others."""
        return replace(self, units=choices.units) == choices

    def vertices(self) -> IntArray:
        """Return the vertices of the mesh that the choices name, ascending."""
        paths, paint = (*self.cuts, *self.uncut), self.paint
        regions = (paint.no_cone, paint.no_seam, *(region for _, region in paint.importance))
        named = chain(
            (cone.vertex for cone in self.cones), *paths, self.corners, *map(Region.vertices, regions)
        )
        return np.unique(np.fromiter(named, dtype=np.int64))

    # Conversion.

    def keywords(self) -> dict[str, Any]:
        """Return the keyword arguments of `coneflat.flatten`, or of `coneflat.unwrap`, for these choices.

        They are not cached, because for painted regions they need much more memory than the choices, of which the
        history stores hundreds.

        Raises:
            OptionError: they cannot be combined.
        """
        words = dict(self.options)
        if not self.for_texture:  # Only the others have a number of charts, and none but drawn seams.
            words = {n: v for n, v in words.items() if v != "none" and (n, type(v)) != ("charts", int)}
        if self.by_hand:
            words = {name: value for name, value in words.items() if name not in SEARCH}
            words["cones"] = {cone.vertex: cone.curvature for cone in self.cones} or "none"
        elif self.cones:
            words["required_cones"] = [cone.vertex for cone in self.cones]
        if words.get("boundary") == "rectangle":
            # The boundary is free until all corners are picked.
            del words["boundary"]
            if len(self.corners) == 4:
                words["boundary"] = dict.fromkeys(self.corners)
        if self.cuts:
            cut = edge_pairs(self.cuts)
            words["seams"] = (words["seams"], cut) if "seams" in words else cut
        paint = self.paint
        if paint.no_seam:
            words["no_seams"] = np.array([*paint.no_seam.vertices(), *chain(*self.uncut)])
        elif self.uncut:
            words["no_seams"] = edge_pairs(self.uncut)
        # Painted regions only restrict searches, not cones that are placed by hand or locked.
        if paint.no_cone and not self.by_hand:
            locked = {cone.vertex for cone in self.cones}
            words["forbidden_cones"] = [v for v in paint.no_cone.vertices() if v not in locked]
        # If all angles are given, weights have no effect.
        if paint.importance and (not self.by_hand or any(cone.angle is None for cone in self.cones)):
            words["weights"] = paint.weights()
        group = UnwrapOptions if self.for_texture else Options
        words = {name: value for name, value in words.items() if name in declarations(group)}
        read_options(words, group)
        return words

    @property
    def used_pins(self) -> Pins:
        """Return the pins of a map for a texture; none of another map."""
        return self.pins if self.for_texture else Pins()

    @property
    def command(self) -> str:
        """Return the name of the command, and of the function of `coneflat`, that computes the map."""
        return "unwrap" if self.for_texture else "flatten"

    def as_plain(self) -> dict[str, Any]:
        """Return the choices as values for JSON."""
        return {
            "options": dict(self.options),
            "by_hand": self.by_hand,
            "cones": [asdict(cone) for cone in self.cones],
            "cuts": [list(path) for path in self.cuts],
            "kept": [list(path) for path in self.uncut],
            **({"paint": self.paint.as_plain()} if self.paint else {}),
            **({"corners": list(self.corners)} if self.corners else {}),
            **({"units": list(self.units)} if any(self.units) else {}),
            **({"for_texture": True} if self.for_texture else {}),
            **({"charts": self.pins.as_plain()} if self.pins != Pins() else {}),
        }

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Choices:
        """Return the choices in values from JSON.

        Raises:
            OptionError, StudioError: a choice is not valid.
            KeyError, TypeError, ValueError, AttributeError: the values do not have the structure of choices.
        """
        chosen = cls()
        for name, value in plain["options"].items():
            chosen = chosen.with_option(name, value)
        cones = {}
        for record in plain["cones"]:
            vertex = as_vertex("a cone's vertex", record["vertex"])
            angle = None if record["angle"] is None else as_number("a cone's angle", record["angle"])
            if vertex in cones:
                raise StudioError(f"vertex {vertex} is given as a cone twice")
            cones[vertex] = Cone(vertex, _checked_angle(angle), record["locked"] is True)
        chosen = replace(chosen, by_hand=plain["by_hand"] is True)._with_cones(cones)
        cuts, uncut = (tuple(map(checked_path, plain[name])) for name in ("cuts", "kept"))
        chosen = replace(chosen, cuts=cuts, uncut=uncut, paint=Paint.from_plain(plain.get("paint", {})))
        for vertex in dict.fromkeys(plain.get("corners", ())):
            chosen = chosen.with_corner(as_vertex("a corner", vertex))
        units, for_texture = plain.get("units", ("", "")), plain.get("for_texture") is True
        chosen = chosen.with_units(*units).with_texture(for_texture)
        if "charts" in plain:
            chosen = replace(chosen, pins=Pins.from_plain(plain["charts"]))
        chosen.keywords()
        return chosen

    def _by_vertex(self) -> dict[int, Cone]:
        return {cone.vertex: cone for cone in self.cones}

    def _cone(self, vertex: int) -> Cone:
        cones = self._by_vertex()
        if vertex not in cones:
            raise StudioError(f"vertex {vertex} is not a cone")
        return cones[vertex]

    def _with_cones(self, cones: Mapping[int, Cone]) -> Choices:
        if self.for_texture:
            raise StudioError("a map for a texture has no cones to edit")
        # Cones are sorted by vertex, so that the same cones are equal choices.
        return replace(self, cones=tuple(cones[v] for v in sorted(cones)))


def _checked_angle(angle: float | None) -> float | None:
    if angle is not None and not 0 < angle <= MAX_CONE_ANGLE * (1 + 1e-12):
        raise StudioError(
            f"a cone angle must be positive and at most {math.degrees(MAX_CONE_ANGLE):g} degrees, got "
            f"{math.degrees(angle):,g}"
        )
    return angle
