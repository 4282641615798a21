"""Comparisons in the terminal."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from ..compare import Comparison, Reproduction
from ..compare.table import COLUMNS, comparison_rows, notes

PLAIN_WIDTH = 150


def print_comparison(comparison: Comparison, files: Sequence[Path]) -> None:
    """Print a row for each method, and what was written."""
    table = Table(box=None, pad_edge=False)
    for heading in ("method", *COLUMNS):
        table.add_column(heading, justify="left" if heading == "method" else "right")
    for cells in comparison_rows(comparison):
        table.add_row(*cells)
    out = Console(highlight=False, width=None if sys.stdout.isatty() else PLAIN_WIDTH)
    out.print(table)
    click.echo(notes([comparison]), nl=False)
    _print_files(files)


def print_reproduction(found: Reproduction, files: Sequence[Path]) -> None:
    """Print both tables, and what was written."""
    text = found.markdown()
    click.echo(text[: text.index("![")].rstrip() if "![" in text else text.rstrip())
    _print_files(files)


def _print_files(files: Sequence[Path]) -> None:
    for path in files:
        click.echo(f"wrote {path}")
