"""The tables of options in the documentation, made from their declarations."""

from __future__ import annotations

import math
from collections.abc import Callable

from coneflat.apps.cli.flags import flag_name, shown_default
from coneflat.apps.cli.main import cli
from coneflat.apps.patterns import PatternOptions
from coneflat.apps.patterns.finish import Allowances
from coneflat.apps.patterns.papers import PaperName
from coneflat.apps.patterns.units import Length, Percentage
from coneflat.options import declarations, kinds
from coneflat.options.declared import (
    AtlasOptions,
    ConeOptions,
    Declaration,
    MetricOptions,
    RunOptions,
    SeamOptions,
)
from coneflat.quadmesh import QuadOptions

#: Values of options of patterns, as flags and as keywords.
PATTERN_VALUES = {
    Length: ("`7mm`, `0.7cm`, `0.25in`", 'millimetres, or a text such as `"7mm"`'),
    Percentage: ("`3%`, `0.03`", 'a fraction, or a text such as `"3%"`'),
    PaperName: ("`A4`, `letter`, `roll:900mm`, `none`", '`"A4"`, `"letter"`, `"roll:900mm"`, `"none"`'),
    Allowances: ("`A=10mm,hem=0`", '`"A=10mm,hem=0"`'),
}
#: As people think of them; each group's docstring is its title.
GROUPS = (ConeOptions, MetricOptions, SeamOptions, AtlasOptions, RunOptions)


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


def pattern_flag_table() -> str:
    """Return the options of `coneflat pattern`."""
    return _flag_table(PatternOptions, "pattern")


def pattern_keyword_table() -> str:
    """Return the keywords of `coneflat.pattern`."""
    return _keyword_table(PatternOptions)


def _flag_table(group: type, command: str = "flatten") -> str:
    rows = [
        (
            _flags(declaration.name, command),
            _values(declaration.kind),
            _flag_default(declaration),
            declaration.doc,
        )
        for declaration in declarations(group).values()
        if declaration.flag and not _is_shared(declaration, group)
    ]
    return _table(
        group, "option", rows, lambda name: f"`{flag_name(name)}`" if declarations(group)[name].flag else ""
    )


def _keyword_table(group: type) -> str:
    rows = [
        (
            f"`{declaration.name}`",
            "(m, 3) numbers" if declaration.name == "lengths" else _python_values(declaration.kind),
            _python_default(declaration),
            declaration.doc,
        )
        for declaration in declarations(group).values()
        if not _is_shared(declaration, group)
    ]
    return _table(group, "keyword", rows, "`{}`".format)


def _table(group: type, noun: str, rows: list[tuple[str, ...]], spelled: Callable[[str], str]) -> str:
    """Return a group's title, its table, and what only the sparse search has of it."""
    title = (group.__doc__ or "").split("\n")[0].rstrip(".")
    lines = [f"### {title}", "", f"| {noun} | values | default | meaning |", "| --- " * 4 + "|"]
    for row in rows:
        assert not any("|" in cell for cell in row), row
        lines.append(f"| {' | '.join(row)} |".replace("  ", " "))
    refused = getattr(group, "REFUSED", ())
    shared = [
        name
        for name, declaration in declarations(group).items()
        if _is_shared(declaration, group) and name not in refused
    ]
    if shared:
        lines += ["", f"As for `flatten`: {', '.join(filter(None, map(spelled, shared)))}."]
    names = [name for name, declaration in declarations(group).items() if declaration.only == "sparse"]
    if names and group in GROUPS:
        lines += ["", f"Only `sparse` cones take {', '.join(filter(None, map(spelled, names)))}."]
    return "\n".join(lines)


def _is_shared(declaration: Declaration, group: type) -> bool:
    """Return whether another group, of `flatten`, describes the option in the same words and with the same default."""
    same_names = [
        declarations(elsewhere).get(declaration.name) for elsewhere in GROUPS if elsewhere is not group
    ]
    return group not in GROUPS and any(
        elsewhere and (elsewhere.doc, elsewhere.default) == (declaration.doc, declaration.default)
        for elsewhere in same_names
    )


def _flags(name: str, command: str) -> str:
    spellings = [
        opts
        for param in cli.commands[command].params
        if param.name == name
        for opts in (
            *param.opts,
            *(negation for negation in param.secondary_opts if negation.startswith("--no-")),
        )
    ]
    return ", ".join(f"`{flag}`" for flag in spellings or [flag_name(name)])


def _words(kind: kinds.Kind) -> list[str]:
    return [f"`{word}`" for word in getattr(kind, "words", ())]


def _values(kind: kinds.Kind) -> str:
    """Return what is written after a flag."""
    match kind:
        case kinds.Flag():
            return ""
        case kinds.Choice():
            return ", ".join(_words(kind))
        case kinds.Number(is_angle=True):
            return "`1.57`, `pi/2`, `90deg`"
        case kinds.Number():
            return f"{kind.text}; alone it is 1" if kind.is_strength else kind.text
        case kinds.Direction():
            return ", ".join([*_words(kind), "`z`, `-y`, `0,0.5,1`"])
        case kinds.Vertices():
            return "`3,17,8` or a file"
        case kinds.VerticesOrEdges():
            return "`3,17,8`, or a file of such or of pairs"
        case kinds.WordOrVertices():
            return ", ".join([*_words(kind), "`3,17`, `3:pi/2,17:-1.5`", "or a file"])
        case kinds.Edges():
            return " or ".join([*_words(kind), "a file of pairs"])
        case kinds.Weights():
            return "a name or a file"
        case Length() | Percentage() | PaperName() | Allowances():
            return PATTERN_VALUES[type(kind)][0]
    return ""


def _flag_default(declaration: Declaration) -> str:
    if isinstance(declaration.kind, kinds.Flag) and (
        declaration.command_default or declaration.default is True
    ):
        return "yes"
    shown = shown_default(declaration)
    return f"`{shown}`" if shown else ""


def _python_values(kind: kinds.Kind) -> str:
    """Return what a keyword takes."""
    match kind:
        case kinds.Flag():
            return "`True`, `False`"
        case kinds.Choice() | kinds.WordOrVertices() | kinds.Edges():
            words = ", ".join(f'`"{word}"`' for word in kind.words)
            further = {
                kinds.WordOrVertices: "a list of vertices, or a map to curvatures",
                kinds.Edges: "(k, 2) pairs of vertices",
            }
            return ", ".join(text for text in (words, further.get(type(kind), "")) if text)
        case kinds.Vertices():
            return "a list of vertices"
        case kinds.VerticesOrEdges():
            return "(k,) vertices, or (k, 2) pairs of them"
        case kinds.Direction():
            return ", ".join([*(f'`"{word}"`' for word in kind.words), "three numbers"])
        case kinds.Number(is_angle=True):
            return "radians"
        case kinds.Number():
            return kind.text
        case kinds.Weights():
            return "(n,) numbers, a map from vertex to number, or the name of a property"
        case Length() | Percentage() | PaperName() | Allowances():
            return PATTERN_VALUES[type(kind)][1]
    return "a function"


def _python_default(declaration: Declaration) -> str:
    value, kind = declaration.default, declaration.kind
    if isinstance(value, float) and isinstance(kind, kinds.Number) and kind.is_angle:
        turns = value / math.pi
        return f"{turns:g} π" if turns >= 1 else f"π/{1 / turns:g}"
    return (
        f"`{value:g}`"
        if isinstance(value, float)
        else f'`"{value}"`'
        if isinstance(value, str)
        else f"`{value}`"
    )
