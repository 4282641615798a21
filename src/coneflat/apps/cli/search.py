"""Options of the search for cones, which several commands have."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])

#: Parameters of the pursuit alone, as the command line names them.
PURSUIT_OPTIONS = (
    "distortion",
    "cone_count",
    "min_cone_angle",
    "max_cone_angle",
    "positive_only",
    "weights",
    "require",
    "forbid",
    "only",
)


class Angle(click.ParamType):  # type: ignore[type-arg]
    """An angle such as 1.57, pi/2, 0.1pi or 90deg."""

    name = "angle"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return radians."""
        if isinstance(value, (int, float)) or value.strip().lower() == "inf":
            return float(value)
        from ...errors import OptionError
        from .given import parse_angle

        try:
            return parse_angle(value)
        except OptionError as error:
            self.fail(str(error), param, ctx)


class Direction(click.ParamType):  # type: ignore[type-arg]
    """A direction in space such as z, -y or 0,0.5,1."""

    name = "direction"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float, float]:
        """Return its three coordinates."""
        if isinstance(value, tuple):
            return value
        text = value.strip().lower()
        axis = "xyz".find(text[-1:])
        if axis >= 0 and text[:-1] in ("", "+", "-"):
            length = -1.0 if text[0] == "-" else 1.0
            return (length * (axis == 0), length * (axis == 1), length * (axis == 2))
        try:
            one, two, three = (float(word) for word in text.split(","))
        except ValueError:
            self.fail(f"{value!r} is no direction; write z, -y or 0,0.5,1", param, ctx)
        return (one, two, three)


_OPTIONS = (
    click.option(
        "--distortion",
        type=float,
        default=0.2,
        show_default=True,
        help="The area distortion allowed: the standard deviation of the log of the scale.  Less needs more cones.",
    ),
    click.option("--cone-count", type=int, help="So many cones, placed for the least distortion, instead."),
    click.option(
        "--min-cone-angle",
        type=Angle(),
        default=math.pi / 2,
        show_default="pi/2",
        help="The sharpest cone: its angle, such as pi/2 or 90deg.",
    ),
    click.option(
        "--max-cone-angle",
        type=Angle(),
        default=4 * math.pi,
        show_default="4pi",
        help="The widest saddle: its angle, above 2 pi; inf for any.",
    ),
    click.option("--positive-only", is_flag=True, help="No cones of negative curvature (saddles)."),
    click.option(
        "--weights",
        metavar="NAME|FILE",
        help="Importance of each vertex, from which distortion keeps off: a property of the PLY file, color for what "
        "is painted, or a file with a number for each vertex (.txt, .npy).",
    ),
)
_REQUIRE = click.option(
    "--require",
    metavar="VERTEX",
    type=int,
    multiple=True,
    help="Make this vertex a cone; repeat for more.",
)
_PLACES = (
    click.option(
        "--forbid",
        metavar="VERTICES",
        help="No cones there: vertices separated by commas, or a file of them.",
    ),
    click.option(
        "--only",
        metavar="VERTICES",
        help="Cones there only: vertices separated by commas, or a file of them.",
    ),
)


def search_options(command: Command) -> Command:
    """Add the options of the pursuit that fit any mesh to a command."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def place_options(command: Command) -> Command:
    """Add the options of the pursuit that name vertices of one mesh."""
    return _REQUIRE(forbidding_options(command))


def forbidding_options(command: Command) -> Command:
    """Add those of them that say where no cones are to be."""
    for option in reversed(_PLACES):
        command = option(command)
    return command


def as_keywords(params: Mapping[str, Any]) -> dict[str, Any]:
    """Return keyword arguments of `coneflat.flatten` from the values of the options.

    Raises:
        OptionError: vertices or weights are not what they should be.
        MeshFileError: a file of them cannot be read.
    """
    from .given import read_vertices, read_weights

    same = ("distortion", "cone_count", "min_cone_angle", "max_cone_angle", "positive_only")
    keywords = {
        **{name: params[name] for name in same},
        "weights": None if params["weights"] is None else read_weights(params["weights"]),
    }
    if "require" in params:
        keywords |= {
            "required_cones": params["require"],
            "forbidden_cones": read_vertices("--forbid", params["forbid"] or ""),
            "allowed_cones": None if params["only"] is None else read_vertices("--only", params["only"]),
        }
    return keywords
