"""How much a command says: the options that all commands have."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])

QUIET, VERBOSE = "quiet", "verbose"


def talk_options(command: Command) -> Command:
    """Add -v and -q, of which the last counts; the command's `talk` is VERBOSE, QUIET or None."""
    for short, long, value, meaning in (
        ("-q", "--quiet", QUIET, "Print nothing but errors."),
        ("-v", "--verbose", VERBOSE, "Print every step as it begins, and how the result was found."),
    ):
        command = click.option(short, long, "talk", flag_value=value, default=None, help=meaning)(command)
    return command
