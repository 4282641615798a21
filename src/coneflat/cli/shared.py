"""Options that several commands have."""

from __future__ import annotations

from typing import Any

import click


class Eye(click.ParamType):  # type: ignore[type-arg]
    """A direction: 1,0.5,2, or words such as front-right."""

    name = "eye"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return three numbers, or the words."""
        if not isinstance(value, str) or "," not in value:
            return value
        try:
            return tuple(float(number) for number in value.split(","))
        except ValueError:
            self.fail(f"{value!r} is no direction; write 1,0.5,2 or front-right", param, ctx)


up_option = click.option(
    "--up",
    type=click.Choice(["x", "y", "z"]),
    default="y",
    show_default=True,
    help="The model's upward axis in pictures.",
)

repair_option = click.option(
    "--repair", is_flag=True, help="Split non-manifold edges and vertices, drop degenerate faces."
)
