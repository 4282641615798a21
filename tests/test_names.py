"""Names are nouns, predicates or verbs: no pronouns and adjectives, which make a reader keep a table in his head."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from markers import ROOT

#: Words that say nothing about what a name stands for.
BANNED = frozenset(
    """
    one own found each given other others known wanted some most least rest here there what why more kept both same
    whole tried better near far many used new
    """.split()  # noqa: SIM905
)
#: Folders and files that are checked.
CHECKED = ("src/coneflat", "benchmarks", "tests", "tools", "examples")
#: Public and documented names, whose spelling is stable: parameters of functions, and options.
PUBLIC = {
    "src/coneflat/curves.py": {"most"},  # `coneflat.cone_curve(most=)`
    "src/coneflat/options/declared.py": {"most"},  # likewise
    "src/coneflat/apps/cli/cones_command.py": {"most"},  # `coneflat cones --most`
    "src/coneflat/apps/cli/figure_commands.py": {"most"},  # `coneflat figure --most`
    "src/coneflat/apps/transfer/baking.py": {"new"},  # `coneflat.apps.transfer.transfer(new=)`
    "src/coneflat/apps/view/figures/kinds.py": {"own"},  # `coneflat.make_figure(own=)`
}


def assigned_names(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield each name that is assigned or defined in a syntax tree, with its line."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name, node.lineno
            case ast.arg(arg=name) | ast.alias(asname=str(name)):
                yield name, node.lineno
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name, node.lineno
            case (
                ast.MatchAs(name=str(name))
                | ast.MatchStar(name=str(name))
                | ast.ExceptHandler(name=str(name))
            ):
                yield name, node.lineno


def banned_names(source: str) -> list[tuple[str, int]]:
    """Return the banned names in the source of a module, with their lines."""
    return sorted(
        {
            (name, line)
            for name, line in assigned_names(ast.parse(source))
            if name.strip("_").lower() in BANNED
        },
        key=lambda name_and_line: name_and_line[1],
    )


def modules() -> list[str]:
    paths = (path for folder in CHECKED for path in (ROOT / folder).rglob("*.py"))
    return sorted(path.relative_to(ROOT).as_posix() for path in paths)


@pytest.mark.parametrize("folder", CHECKED)
def test_names_say_what_they_stand_for(folder):
    lines = [
        f"{module}:{line}: {name}"
        for module in modules()
        if module.startswith(folder)
        for name, line in banned_names((ROOT / module).read_text(encoding="utf-8"))
        if name not in PUBLIC.get(module, ())
    ]
    assert not lines, "\n".join(["pronouns and adjectives as names:", *lines])


def test_every_kind_of_name_is_checked():
    source = """
import numpy as new
class Other:
    kept: int = 0
    def each(self, given, *more, **rest):
        self.wanted, _found = 1, [one for one in given]
        for here in more: pass
        try: pass
        except OSError as why: pass
        match given:
            case [*some]: pass
            case {"a": what}: pass
        with open(given) as known: pass
        if (far := 1): pass
"""
    names = [name.strip("_").lower() for name, _ in banned_names(source)]
    expected = "each far found given here kept known more new one other rest some wanted what why"
    assert " ".join(sorted(names)) == expected


def test_nouns_with_a_banned_word_inside_are_allowed():
    assert banned_names("others_of_mine = one_sided = is_known = used_vertices = 1") == []


def test_files_with_public_names_exist():
    assert [path for path in PUBLIC if not (Path(ROOT) / path).exists()] == []
