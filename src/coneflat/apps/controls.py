"""The controls of options in panels, made from their declarations: those of Blender and of the studio."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from ..options import (
    RARE,
    Choice,
    Declaration,
    Direction,
    Edges,
    Flag,
    Number,
    Vertices,
    VerticesOrEdges,
    Weights,
    WordOrVertices,
    declarations,
)

#: The group of rarely used options.
RARE_GROUP = "Less common"


def controls_of(options: type, hidden: Collection[str] = ()) -> list[dict[str, Any]]:
    """Return the controls of a group of options but the hidden ones, group by group as in the help of commands."""
    shown = [
        declaration
        for declaration in declarations(options).values()
        if declaration.flag and declaration.name not in hidden
    ]
    controls = [control_of(declaration) for declaration in shown]
    groups = dict.fromkeys(control["group"] for control in controls)
    order = [*(group for group in groups if group != RARE_GROUP), RARE_GROUP]
    return sorted(controls, key=lambda control: order.index(control["group"]))


def control_of(declaration: Declaration) -> dict[str, Any]:
    """Return the control of an option as numbers and texts; numbers without a default have 0, words the first.

    Its `kind` is number, integer, angle (radians), flag, choice (of `words`), text (a word or something else; the name
    of a vertex property if it `takes_names`), weights or vertices.
    """
    kind, default = declaration.kind, declaration.default
    group = RARE_GROUP if declaration.name in RARE else declaration.group
    control: dict[str, Any] = {"name": declaration.name, "group": group, "doc": declaration.doc}
    if kind.metavar:
        words = [word for word in kind.metavar.split("|") if word.islower()]
        control |= {"kind": "text", "words": words, "takes_names": "NAME" in kind.metavar}
        return {**control, "default": default or ""}
    match kind:
        case Number():
            word = "angle" if kind.is_angle else "integer" if kind.is_integer else "number"
            control |= {"least": max(kind.minimum, 0), "most": min(kind.maximum, 2**30)}
            return {**control, "kind": word, "default": default or 0, "is_optional": default is None}
        case Flag():
            return {**control, "kind": "flag", "default": default}
        case Choice() | WordOrVertices():
            return {**control, "kind": "choice", "default": default, "words": list(kind.words)}
        case Direction():
            words = ["none", "x", "y", "z", "-x", "-y", "-z"]
        case Edges():  # Of those in a file, a panel shows none.
            words = ["automatic", *(word for word in kind.words if word != "input")]
        case Weights() | Vertices() | VerticesOrEdges():
            return {**control, "kind": "weights" if isinstance(kind, Weights) else "vertices", "default": ""}
        case _:
            raise TypeError(f"{declaration.name} has no control in panels")
    return {**control, "kind": "choice", "default": words[0], "words": words}
