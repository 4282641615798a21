"""Values of flags from texts."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import click

from ...errors import OptionError
from ...options import parse_angle


def parse_angle_or_inf(value: Any) -> float:
    """Return an angle in radians from 1.57, pi/2, 0.1pi, 90deg, inf, or none, which is inf."""
    try:
        return math.inf if value.strip().lower() in ("inf", "none") else parse_angle(value)
    except OptionError as error:
        raise click.BadParameter(str(error)) from error


def parse_strength(value: Any) -> float:
    """Return the strength as a number."""
    try:
        return float(value)
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not a number; write a strength such as 1") from error


def direction_parser(words: tuple[str, ...]) -> Callable[[Any], tuple[float, float, float] | str]:
    """Return a function that returns a (3,) direction from a text, or the text if it is one of some words."""

    def parse_direction(value: Any) -> tuple[float, float, float] | str:
        return value if value in words else _three_numbers(value, words)

    return parse_direction


def _three_numbers(value: Any, words: tuple[str, ...]) -> tuple[float, float, float]:
    """Return a (3,) direction from z, -y or 0,0.5,1; messages list words, too."""
    text = value.strip().lower()
    axis = "xyz".find(text[-1:])
    if text and axis >= 0 and text[:-1] in ("", "+", "-"):
        length = -1.0 if text[0] == "-" else 1.0
        return (length * (axis == 0), length * (axis == 1), length * (axis == 2))
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError as error:
        forms = ", ".join(["z", "-y", *words])
        raise click.BadParameter(f"{value!r} is not a direction; write {forms} or 0,0.5,1") from error
    return (x, y, z)


def parse_eye(value: Any) -> Any:
    """Return three numbers from 1,0.5,2; or the text itself if it is words such as front-right."""
    try:
        return tuple(float(number) for number in value.split(",")) if "," in value else value
    except ValueError as error:
        raise click.BadParameter(f"{value!r} is not a direction; write 1,0.5,2 or front-right") from error
