"""Help of commands, with the options in groups, and with the formats of files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

from ...base import with_formats
from ...options import RARE

Command = TypeVar("Command", bound=Callable[..., Any])
#: Options of which the help shows only the first sentence of the description.
BRIEF = (*RARE, "distortion", "cone_count", "stretch", "seams", "sharp_angle", "resolution", "up")
RARE_TITLE = "Less common options (all details: docs/reference/command-line.md)"
#: Titles of groups of options in the help.
GROUPS = ("Texture", "Quads", "Pattern", "Cones", "Metric", "Seams", "Atlas", "Input", "Output", RARE_TITLE)


class Grouped(click.Option):
    """An option that the help lists under the title of a group."""

    def __init__(self, *args: Any, group: str, **options: Any) -> None:
        super().__init__(*args, **options)
        self.group = group


class GroupedCommand(click.Command):
    """A command whose help lists its options in groups; options without a group are listed under Output."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, group by group."""
        groups: dict[str, list[tuple[str, str]]] = {title: [] for title in GROUPS}
        for param in self.get_params(ctx):
            record = param.get_help_record(ctx) if isinstance(param, click.Option) else None
            if record is not None:
                groups[getattr(param, "group", "Output")].append(record)
        for title, records in groups.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records, col_max=24)


def names_formats(command: Command) -> Command:
    """Replace {MESH} and the names of other uses in the help of a command by the endings of files; see `Use`."""
    command.__doc__ = with_formats(command.__doc__ or "")
    return command
