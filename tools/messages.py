"""The texts that the package shows its users, as templates: `python tools/remake.py --only messages`.

They are read as a whole in `tools/messages.txt`: messages of errors, notes on results, headings and help.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

from markers import ROOT

PACKAGE = ROOT / "src" / "coneflat"
MIN_WORDS = 3
FIRST = "The texts of src/coneflat of three words and more, by file. Made by `python tools/remake.py`."


def list_messages() -> str:
    """Return all templates, with the expressions that fill them in braces."""
    parts = [FIRST]
    for path in sorted(PACKAGE.rglob("*.py")):
        messages = dict.fromkeys(templates(ast.parse(path.read_text(encoding="utf-8"))))
        if messages:
            parts.append(
                "\n".join([path.relative_to(PACKAGE).as_posix(), *(f"    {text}" for text in messages)])
            )
    return "\n\n".join(parts) + "\n"


def templates(node: ast.AST) -> Iterator[str]:
    """Yield the texts under a node of the syntax tree, without docstrings."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
            continue
        if isinstance(child, ast.JoinedStr) or (
            isinstance(child, ast.Constant) and isinstance(child.value, str)
        ):
            text = " ".join(_template(child).split())
            if sum(word.strip("{}.,;:'\"").isalpha() for word in text.split()) >= MIN_WORDS:
                yield text
        else:
            yield from templates(child)


def _template(node: ast.JoinedStr | ast.Constant) -> str:
    """Return a text with what fills it in braces."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    parts = node.values
    return "".join(
        str(part.value) if isinstance(part, ast.Constant) else f"{{{ast.unparse(part.value)}}}"  # type: ignore[attr-defined]
        for part in parts
    )
