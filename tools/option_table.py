"""The tables of options in the documentation, made from their declarations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import MISSING, Field
from typing import Any

from coneflat.apps.cli.main import cli
from coneflat.apps.cli.options import flag_of, own_first, shown_default
from coneflat.options import QuadOptions
from coneflat.options.declared import (
    AtlasOptions,
    ConeOptions,
    Declaration,
    MetricOptions,
    RunOptions,
    SeamOptions,
    SymmetryOptions,
)
from coneflat.options.kinds import (
    Choice,
    Count,
    Direction,
    Edges,
    Flag,
    Kind,
    Number,
    Strength,
    Vertices,
    Weights,
    WordOrVertices,
)

#: As people think of them; each group's docstring is its title.
GROUPS = (ConeOptions, MetricOptions, SeamOptions, SymmetryOptions, AtlasOptions, RunOptions)


def flag_tables() -> str:
    """Return the options of `coneflat flatten`, a table for each group."""
    return "\n\n".join(map(_flag_table, GROUPS))


def keyword_tables() -> str:
    """Return the keywords of `coneflat.flatten`, a table for each group."""
    return "\n\n".join(map(_keyword_table, GROUPS))


def quad_flag_table() -> str:
    """Return the options of `coneflat quads`."""
    return _flag_table(QuadOptions, "quads")


def quad_keyword_table() -> str:
    """Return the keywords of `coneflat.quads`."""
    return _keyword_table(QuadOptions)


def _flag_table(group: type, command: str = "flatten") -> str:
    rows = [
        (_flags(name, command), _values(declaration.kind), _flag_default(field, declaration), declaration.doc)
        for name, field, declaration in _options(group)
        if declaration.flag
    ]
    return _table(group, "option", rows, lambda name: f"`{flag_of(name)}`")


def _keyword_table(group: type) -> str:
    rows = [
        (f"`{name}`", _python_values(declaration.kind), _python_default(field), declaration.doc)
        for name, field, declaration in _options(group)
    ]
    return _table(group, "keyword", rows, "`{}`".format)


def _table(group: type, noun: str, rows: list[tuple[str, ...]], spelled: Callable[[str], str]) -> str:
    """Return a group's title, its table, and what only one search for cones has of it."""
    title = (group.__doc__ or "").split("\n")[0].rstrip(".")
    lines = [f"### {title}", "", f"| {noun} | values | default | meaning |", "| --- " * 4 + "|"]
    for row in rows:
        assert not any("|" in cell for cell in row), row
        lines.append(f"| {' | '.join(row)} |".replace("  ", " "))
    for search in ("pursuit", "greedy") if group in GROUPS else ():
        names = [name for name, _, declaration in _options(group) if declaration.only == search]
        if names:
            lines += ["", f"Only `{search}` cones take {', '.join(map(spelled, names))}."]
    return "\n".join(lines)


def _options(group: type) -> Iterator[tuple[str, Field[Any], Declaration]]:
    """Yield a group's options, its own before those of what it is made of."""
    for name, (field, declaration) in own_first(group):
        yield name, field, declaration


def _flags(name: str, command: str) -> str:
    spellings = [
        opts
        for param in cli.commands[command].params
        if param.name == name
        for opts in (*param.opts, *(other for other in param.secondary_opts if other.startswith("--no-")))
    ]
    return ", ".join(f"`{flag}`" for flag in spellings or [flag_of(name)])


def _words(kind: Kind) -> list[str]:
    return [f"`{word}`" for word in getattr(kind, "words", ())]


def _values(kind: Kind) -> str:
    """Return what is written after a flag."""
    match kind:
        case Flag():
            return ""
        case Number(is_angle=True):
            return "`1.57`, `pi/2`, `90deg`"
        case Strength():
            return f"{kind.bounds}; alone it is 1"
        case Direction():
            return "`z`, `-y`, `0,0.5,1`"
        case Vertices():
            return "`3,17,8` or a file"
        case WordOrVertices():
            return ", ".join([*_words(kind), "`3,17`, `3:pi/2,17:-1.5`", "or a file"])
        case Edges():
            return " or ".join([*_words(kind), "a file of pairs"])
        case Weights():
            return "a name or a file"
        case Count():
            return f"a number {kind.bounds}"
    return kind.bounds or "a number"


def _flag_default(field: Field[Any], declaration: Declaration) -> str:
    if isinstance(declaration.kind, Flag) and (declaration.command_default or field.default is True):
        return "yes"
    shown = shown_default(field)
    return f"`{shown}`" if shown else ""


def _python_values(kind: Kind) -> str:
    """Return what a keyword takes."""
    match kind:
        case Flag():
            return "`True`, `False`"
        case Choice() | WordOrVertices() | Edges():
            words = ", ".join(f'`"{word}"`' for word in kind.words)
            more = {
                WordOrVertices: "a list of vertices, or a map to curvatures",
                Edges: "(k, 2) pairs of vertices",
            }
            return ", ".join(each for each in (words, more.get(type(kind), "")) if each)
        case Vertices():
            return "a list of vertices"
        case Direction():
            return "three numbers"
        case Number(is_angle=True):
            return "radians"
        case Count():
            return f"a whole number {kind.bounds}"
        case Kind() if type(kind) is Kind:
            return "a function"
    return kind.bounds or "a number"


def _python_default(field: Field[Any]) -> str:
    value = field.default
    assert value is not MISSING
    if isinstance(value, float) and isinstance(field.metadata["declaration"].kind, Number):
        turns = value / math.pi
        if field.metadata["declaration"].kind.is_angle:
            return f"{turns:g} π" if turns >= 1 else f"π/{1 / turns:g}"
    return (
        f"`{value:g}`"
        if isinstance(value, float)
        else f'`"{value}"`'
        if isinstance(value, str)
        else f"`{value}`"
    )
