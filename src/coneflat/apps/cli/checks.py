"""Checks of commands: flags that exclude each other, and conditions that results must meet."""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from ... import options as declared
from ...options import ConeOptions, MetricOptions, Options, declarations
from .flags import flag_name

if TYPE_CHECKING:
    from ...measures import Requirement


class ExitCode(IntEnum):
    """Exit codes of the commands."""

    INTERNAL_ERROR = 1
    USER_ERROR = 2
    NOT_MET = 3  # a condition of --require
    SIGNALLED = 128  # to which the number of the signal is added, as shells do


def check_combinations(context: click.Context) -> None:
    """Raise an error if an option would have no effect."""
    params = context.params
    cones = params["cones"][0] if params["cones"] else "auto"
    method = params["method"] or "exact"
    declared_options = declarations(Options)
    search = [name for name in declarations(ConeOptions) if name != "cones"]
    of_method = [*search, "cones", *declarations(MetricOptions)]
    only = {
        choice: [name for name in declared_options if declared_options[name].only == choice]
        for choice in ("sparse", "exact")
    }
    are_given = cones not in declared.CONES
    rules = [
        (params["paper"], of_method, "--paper fixes the method"),
        (are_given, search, "there is no search if the cones are given"),
        (cones == "none", search, "there is no search with --cones none"),
        (cones == "greedy", only["sparse"], "--cones greedy does not take this option"),
        (params["cone_count"] is not None, ("distortion", "max_cones"), "--cone-count is given"),
        (method != "exact", only["exact"], f"--method {method} does not take this option"),
    ]
    refuse(context, rules)


def refuse(context: click.Context, rules: Iterable[tuple[Any, Iterable[str], str]]) -> None:
    """Raise an error if an option is given that a rule excludes; rules: (applies, names of options, reason)."""
    for applies, names, reason in rules:
        for name in names if applies else ():
            if is_given(context, name):
                raise click.UsageError(f"{reason}: leave out {flag_name(name)}", context)


def is_given(context: click.Context, name: str) -> bool:
    """Return whether an option is given on the command line."""
    return context.get_parameter_source(name) is ParameterSource.COMMANDLINE


def check_required(requirements: Iterable[Requirement], measures: dict[str, Any], written: str = "") -> None:
    """Print the requirements that failed, if any, and exit with code `ExitCode.NOT_MET`.

    written: name of the file that has been written anyway.
    """
    from ...measures import breaches

    lines = breaches(requirements, measures)
    if not lines:
        return
    for line in lines:
        click.echo(f"coneflat: requirement failed: {line}", err=True)
    if written:
        click.echo(f"coneflat: {written} is written anyway", err=True)
    raise click.exceptions.Exit(ExitCode.NOT_MET)
