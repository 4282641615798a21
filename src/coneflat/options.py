"""The choices a flattening is made with."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arrays import FloatArray, IntArray
from .errors import OptionError
from .text import shown

CONES = ("auto", "pursuit", "greedy", "none")
#: From cones to a layout: this package's own, the paper's, and those that it compares with.
METHODS = ("exact", "linear", "circle-patterns", "ricci", "linear-abf", "abf++", "lscm", "spectral", "bff")
#: Of some of them: circle patterns without flips, and angle based flattening that prescribes nothing at cones.
VARIANTS = ("circle-patterns/fixed", "linear-abf/free", "abf++/free")
# Those that solve what need not converge.
ITERATIVE = ("exact", "circle-patterns", "circle-patterns/fixed", "ricci", "abf++", "abf++/free")
# Those whose metric lives on flipped triangles and is unfolded on the mesh's own.
UNFOLDED = ("exact", "circle-patterns", "circle-patterns/fixed", "ricci")
# Those whose cones have the curvatures that are prescribed; the others lay out what was cut open before.
CONED = (*UNFOLDED, "linear", "bff", "linear-abf", "abf++")
LENGTH_RULES = ("integral", "mean")
AT_CONES = ("auto", "scale", "curvature")
SOLVERS = ("auto", "pardiso", "cholespy", "scipy", "amg")
CHARTS = ("one", "atlas")
BOUNDARIES = ("free", "lengths", "disk", "straight")

# Radians: finer quanta than this restrict nothing that could be told from none, as multiples are known to 1e-6.
LEAST_QUANTUM = 1e-4
# Radians: no triangulation has room for wider cones than this.
WIDEST_CONE = 1000 * math.pi
# A preference for creases or hidden places of 1 makes seams ten times cheaper; with a factor of more than 1e10, the
# lengths of seams are beneath the rounding of their costs.
MOST_PREFERENCE = 10.0

# What asks for cones by the pursuit, and it alone.
PURSUIT_FIELDS = (
    "cone_count",
    "positive_only",
    "weights",
    "required_cones",
    "forbidden_cones",
    "allowed_cones",
    "quantum",
)

Cones = str | Mapping[int, float] | Mapping[int, float | None] | Iterable[int]
Boundary = str | Mapping[int, float] | Mapping[int, float | None] | Iterable[int]

#: The published method: `flatten(mesh, **PAPER)`.
PAPER: Mapping[str, Any] = {
    "cones": "greedy",
    "epsilon": 1.0,
    "max_cones": None,
    "method": "linear",
    "length_rule": "integral",
}


@dataclass(frozen=True)
class Options:
    """Checked options of `coneflat.flatten`, where each is explained.

    Raises:
        OptionError: a value makes no sense.
    """

    cones: Cones = "auto"
    distortion: float = 0.2
    cone_count: int | None = None
    max_cones: int | None = None
    min_cone_angle: float = math.pi / 2
    max_cone_angle: float | None = 4 * math.pi
    positive_only: bool = False
    weights: ArrayLike | str | None = None
    required_cones: Iterable[int] = ()
    forbidden_cones: Iterable[int] = ()
    allowed_cones: Iterable[int] | None = None
    quantum: float | None = None
    correct_handles: bool = False
    epsilon: float = 1.0
    method: str = "exact"
    length_rule: str = "integral"
    at_cones: str = "auto"
    boundary: Boundary = "free"
    best_effort: bool = False
    refine: bool = False
    repair: bool = False
    strict: bool = False
    solver: str = "auto"
    charts: str = "one"
    resolution: int = 1024
    padding: float = 2.0
    tiles: int = 1
    up: tuple[float, float, float] | None = None
    seams: ArrayLike | str | None = None
    sharp_angle: float | None = None
    forbidden_seams: ArrayLike | None = None
    creases: float = 0.0
    hide_seams: float = 0.0
    seam_weights: ArrayLike | str | None = None
    given_cones: Mapping[int, float | None] = field(init=False, default_factory=dict)
    corners: Mapping[int, float | None] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.cones, str):
            _choice("cones", self.cones, CONES)
        else:
            object.__setattr__(self, "given_cones", _given_vertices("cone", self.cones))
        if isinstance(self.boundary, str):
            _choice("boundary", self.boundary, BOUNDARIES)
        else:
            object.__setattr__(self, "corners", _given_vertices("corner", self.boundary))
            if not self.corners:
                raise OptionError("boundary names no corners; for a round boundary, say 'disk'")
        _choice("at_cones", self.at_cones, AT_CONES)
        _choice("method", self.method, METHODS + VARIANTS)
        if self.method != "exact":
            if self.boundary_kind != "free" or self.at_cones != "auto":
                raise OptionError(
                    f"method {self.method!r} has a free boundary and no choice at cones: use method 'exact'"
                )
            if self.best_effort and self.method not in ITERATIVE:
                raise OptionError(f"method {self.method!r} has no unfinished result to give: no best effort")
            if self.refine:
                raise OptionError(
                    f"method {self.method!r} has no common subdivision to refine to: use method 'exact'"
                )
        if self.at_cones == "scale" and any(k is not None for k in self.given_cones.values()):
            raise OptionError("with the scale fixed at cones their curvatures come out: give positions only")
        if self.at_cones == "scale" and (self.quantum is not None or self.positive_only is True):
            name = "positive_only" if self.quantum is None else "quantum"
            raise OptionError(
                f"with the scale fixed at cones their curvatures come out: {name} would not be kept"
            )
        if self.at_cones == "scale" and self.boundary_kind not in ("free", "lengths"):
            raise OptionError(
                "a prescribed boundary needs prescribed curvatures at cones: at_cones 'curvature'"
            )
        _choice("length_rule", self.length_rule, LENGTH_RULES)
        _choice("solver", self.solver, SOLVERS)
        _choice("charts", self.charts, CHARTS)
        for name in ("cone_count", "max_cones"):
            value = getattr(self, name)
            if value is None:
                continue
            if _whole(name, value) < 0:
                raise OptionError(f"{name} cannot be negative ({value})")
            object.__setattr__(self, name, int(value))
        for name in ("distortion", "min_cone_angle", "max_cone_angle", "epsilon", "quantum"):
            if getattr(self, name) is not None or name not in ("max_cone_angle", "quantum"):
                object.__setattr__(self, name, _number(name, getattr(self, name)))
        for name in ("positive_only", "correct_handles", "best_effort", "refine", "repair", "strict"):
            if not isinstance(getattr(self, name), (bool, np.bool_)):
                raise OptionError(f"{name} is True or False, not {shown(getattr(self, name))}")
        for name in ("distortion", "epsilon"):
            if not 0 < getattr(self, name) < math.inf:
                raise OptionError(f"{name} must be a positive number, not {getattr(self, name):g}")
        self._check_angles()
        for name in ("required_cones", "forbidden_cones", "allowed_cones"):
            if getattr(self, name) is None and name != "allowed_cones":
                object.__setattr__(self, name, ())
            elif getattr(self, name) is not None:
                noun = name.replace("_", " ").removesuffix("s")
                if isinstance(getattr(self, name), Mapping):
                    raise OptionError(f"{noun}s are vertices alone, without curvatures: give a list of them")
                object.__setattr__(self, name, tuple(_given_vertices(noun, getattr(self, name))))
        self._check_texture()
        self._check_marks()
        self._check_pursuit()

    def _check_angles(self) -> None:
        """Check the bounds of cone angles; one beyond the widest is no bound."""
        if not 0 < self.min_cone_angle <= WIDEST_CONE:
            raise OptionError(
                f"the smallest cone angle must be positive and at most {WIDEST_CONE / math.pi:g} pi, not "
                f"{self.min_cone_angle:g} radians"
            )
        if self.max_cone_angle is None:
            return
        if not self.max_cone_angle > self.min_cone_angle:
            raise OptionError(
                f"the largest cone angle ({self.max_cone_angle:g} radians) must exceed the smallest "
                f"({self.min_cone_angle:g})"
            )
        if self.max_cone_angle > WIDEST_CONE:
            object.__setattr__(self, "max_cone_angle", None)

    def _check_texture(self) -> None:
        """Check what says how charts are packed."""
        for name, most in (("resolution", 2**16), ("tiles", 1000)):
            value = _whole(name, getattr(self, name))
            if not 1 <= value <= most:
                raise OptionError(f"{name} must be from 1 to {most:,}, not {value:,}")
            object.__setattr__(self, name, value)
        padding = _number("padding", self.padding)
        if not 0 <= padding < self.resolution / 4:
            raise OptionError(
                f"padding must be from 0 to a quarter of the resolution of {self.resolution:,}, not {padding:g}"
            )
        object.__setattr__(self, "padding", padding)
        if self.up is not None:
            up = _array("up", self.up)
            if up.shape != (3,) or up.dtype.kind not in "fiu" or not (np.isfinite(up).all() and up.any()):
                raise OptionError(
                    f"up must be a direction, three numbers that are not all 0, not {shown(self.up)}"
                )
            object.__setattr__(self, "up", tuple(_of_finite_length(up.astype(np.float64)).tolist()))

    def _check_marks(self) -> None:
        """Check what names edges that are to be cut."""
        for name in ("seams", "forbidden_seams"):
            given = getattr(self, name)
            if isinstance(given, str) and name == "seams":
                _choice("seams", given, ("input",))
            elif given is not None:
                object.__setattr__(self, name, _pairs(name.replace("_", " "), given))
        for name in ("creases", "hide_seams"):
            given = getattr(self, name)
            strength = float(given) if isinstance(given, (bool, np.bool_)) else _number(name, given)
            object.__setattr__(self, name, strength)
            if not 0 <= strength <= MOST_PREFERENCE:
                raise OptionError(f"{name} must be a number from 0 to {MOST_PREFERENCE:g}, not {strength:g}")
        if self.sharp_angle is not None:
            object.__setattr__(self, "sharp_angle", _number("sharp_angle", self.sharp_angle))
            if not 0 < self.sharp_angle < math.pi:
                raise OptionError(
                    f"the sharp angle must be between 0 and pi, not {self.sharp_angle:g} radians"
                )

    @property
    def marks_seams(self) -> bool:
        """Whether there may be edges that are cut in any case."""
        return self.seams is not None or self.sharp_angle is not None

    @property
    def prescribes_boundary(self) -> bool:
        """Whether vertices on the boundary have a curvature to keep."""
        return self.boundary_kind not in ("free", "lengths")

    def _check_pursuit(self) -> None:
        """Check the options that only a pursuit takes, and those of whole quanta."""
        if self.constrains_cones and not self.searches_cones:
            given = next(name for name in PURSUIT_FIELDS if self._is_set(name))
            raise OptionError(f"{given} is an option of cones 'pursuit', not of cones {self.cone_choice!r}")
        if self.boundary_kind == "straight" and not self.searches_cones:
            raise OptionError("a straight boundary gets its corners from the search: use cones 'pursuit'")
        if self.quantum is None:
            if self.correct_handles:
                raise OptionError(
                    "rotations along handles are made whole for whole quanta only: give a quantum"
                )
            return
        if not LEAST_QUANTUM <= self.quantum <= 2 * math.pi * (1 + 1e-6):
            raise OptionError(
                f"the quantum must be from {LEAST_QUANTUM:g} radians, below which it restricts nothing, to 2 pi, not "
                f"{self.quantum:g}"
            )
        if self.correct_handles and self.method != "exact":
            raise OptionError("rotations along handles are corrected by method 'exact' only")

    @property
    def cone_choice(self) -> str:
        """The way cones are found: "auto", "pursuit", "greedy", "none" or "given"."""
        return self.cones if isinstance(self.cones, str) else "given"

    @property
    def constrains_cones(self) -> bool:
        """Whether something is said of the cones that a pursuit should find."""
        return any(self._is_set(name) for name in PURSUIT_FIELDS)

    def _is_set(self, name: str) -> bool:
        value = getattr(self, name)
        return value is not None and (
            isinstance(value, (np.ndarray, str)) or bool(value) or name == "cone_count"
        )

    @property
    def boundary_kind(self) -> str:
        """What the boundary becomes: "free", "lengths", "disk", "straight" or "polygon"."""
        return self.boundary if isinstance(self.boundary, str) else "polygon"

    @property
    def searches_cones(self) -> bool:
        """Whether the pursuit finds the cones, where the boundary is not prescribed."""
        return self.cone_choice in ("auto", "pursuit")

    @property
    def scale_at_cones(self) -> bool:
        """Whether phi = 0 is prescribed at cones, not curvature."""
        if self.at_cones == "auto":
            # The pursuit keeps cone angles within bounds, which those that came out need not respect.
            has_curvatures = self.searches_cones or any(k is not None for k in self.given_cones.values())
            return not has_curvatures and self.boundary_kind in ("free", "lengths")
        return self.at_cones == "scale"

    def as_dict(self) -> dict[str, Any]:
        """Return the options as plain values, given cones and corners as a map to curvature or None."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}
        for name, given in (("cones", values.pop("given_cones")), ("boundary", values.pop("corners"))):
            if not isinstance(values[name], str):
                values[name] = given
        for name in ("seams", "forbidden_seams"):
            if isinstance(values[name], np.ndarray):
                values[name] = values[name].tolist()
        values["seam_weights"] = (
            self.seam_weights if isinstance(self.seam_weights, (str, type(None))) else "given"
        )
        values["weights"] = self.weights if isinstance(self.weights, (str, type(None))) else "given"
        return values


def _choice(name: str, value: object, allowed: tuple[str, ...]) -> None:
    if not isinstance(value, str) or value not in allowed:
        raise OptionError(f"unknown {name} {shown(value)}: choose from {', '.join(allowed)}")


def _number(name: str, value: object) -> float:
    is_scalar = np.ndim(value) == 0 if isinstance(value, np.ndarray) else not isinstance(value, (str, bytes))
    if not is_scalar or isinstance(value, (bool, np.bool_, complex, np.complexfloating)):
        raise OptionError(f"{name} must be a number, not {shown(value)}")
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError) as error:
        raise OptionError(f"{name} must be a number, not {shown(value)}") from error


def _whole(name: str, value: object) -> int:
    number = math.nan if isinstance(value, (bool, np.bool_)) else _number(name, value)
    if not number.is_integer() or abs(number) >= 2**62:
        raise OptionError(f"{name} must be a whole number, not {shown(value)}")
    return int(number)


def _of_finite_length(direction: FloatArray) -> FloatArray:
    """Return a direction whose squared length is neither 0 nor infinite in double precision."""
    largest = np.abs(direction).max()
    return direction if 1e-100 < largest < 1e100 else direction / largest


def _array(name: str, value: object) -> NDArray[Any]:
    try:
        return np.asarray(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise OptionError(f"{name}: {error}") from error


def _pairs(noun: str, given: object) -> IntArray:
    """Return (k, 2) pairs of vertices."""
    pairs = _array(noun, list(given) if isinstance(given, (set, frozenset)) else given)
    if not pairs.size:
        return np.empty((0, 2), dtype=np.int64)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise OptionError(
            f"{noun} must be pairs of vertices (k, 2), not of shape {pairs.shape} and type {pairs.dtype}"
        )
    return pairs.astype(np.int64)


def _listed(noun: str, vertices: Iterable[Any]) -> list[Any]:
    """Return the elements of a flat list."""
    if np.ndim(vertices) != 1 if isinstance(vertices, np.ndarray) else False:
        raise OptionError(f"{noun}s must be a list of vertices, not {shown(vertices)}")
    return list(vertices)


def _given_vertices(noun: str, vertices: object) -> dict[int, float | None]:
    """Return vertex -> curvature, None where it is to be computed: for all or for none."""
    if isinstance(vertices, Mapping):
        given: dict[int, float | None] = {
            _whole(f"a {noun}'s vertex", v): None if k is None else _number(f"a {noun}'s curvature", k)
            for v, k in vertices.items()
        }
    elif isinstance(vertices, Iterable) and not isinstance(vertices, (str, bytes)):
        listed = [_whole(f"a {noun}'s vertex", v) for v in _listed(noun, vertices)]
        given = dict.fromkeys(listed)
        if len(given) < len(listed):
            twice = next(v for i, v in enumerate(listed) if v in listed[:i])
            raise OptionError(f"vertex {twice} is given as a {noun} twice")
    else:
        raise OptionError(
            f"{noun}s must be vertices, or a map from vertex to curvature, not {type(vertices).__name__}"
        )
    unknown = [v for v, k in given.items() if k is None]
    if unknown and len(unknown) < len(given):
        raise OptionError(
            f"{len(given) - len(unknown)} of {len(given)} {noun}s have a curvature and vertex {unknown[0]} has "
            "none: give curvatures to all, or to none"
        )
    for v, k in given.items():
        if k is not None and not math.isfinite(k):
            raise OptionError(f"the curvature of {noun} {v} is {k}")
    return given
