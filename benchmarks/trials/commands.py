"""Odd command lines, run in this process."""

from __future__ import annotations

import contextlib
import io
import sys
from pathlib import Path
from typing import Any
from unittest import mock

import click
import numpy as np
import shapes

Random = np.random.Generator

# fmt: off
#: Values that an option may be given by mistake.
TEXTS = (
    "", " ", "-1", "0", "1", "2", "0.1", "1e308", "-1e308", "1e-20", "nan", "inf", "-inf", "1e999", "abc", "pi/2",
    "90deg", "0.5pi", "pi/0", "0:0.1", "3:pi/2", "3:nan", "99999", "3:", ":", "x", "z", "0,0,0", "0,0,1", "nan,0,0",
    "front-right", "99999999999999999999", "ä", "a\nb", "../", "/dev/null", "/nowhere/x.obj", "auto", "exact",
    "checker", "color",
)
# fmt: on
#: Commands, and how often each is tried; those that start processes or run all methods take long.
COMMANDS = {
    "flatten": 60,
    "cones": 6,
    "measure": 8,
    "view": 5,
    "figure": 3,
    "compare": 2,
    "batch": 1,
    "nonsense": 1,
}


def make_command(rng: Random, folder: Path) -> list[str]:
    """Return a command line for a folder that contains some meshes."""
    from coneflat.apps.cli.main import cli

    names = [name for name in COMMANDS if name in cli.commands or name == "nonsense"]
    weights = np.array([COMMANDS[name] for name in names], dtype=float)
    name = str(rng.choice(names, p=weights / weights.sum()))
    _write_inputs(rng, folder)
    if name == "nonsense":
        return [["nonsense"], [], ["--help"], ["flatten", "--help"], ["--version"], ["-x"]][
            int(rng.integers(6))
        ]
    inputs = ["hill.obj", "ball.ply", "hill.obj", "bad.obj", "missing.obj", "text.txt", ".", "hill.npz", ""]
    line, chances = [name], np.array([6, 4, 4, 1, 0.5, 0.5, 0.3, 1, 0.2])
    command = cli.commands[name]
    for parameter in command.params:
        if isinstance(parameter, click.Argument):
            line.append(str(rng.choice(inputs, p=chances / chances.sum())))
    outputs = {
        "view": ["page.html"],
        "figure": ["picture.png", "picture.svg"],
        "compare": ["table"],
        "batch": ["out"],
    }
    own = outputs.get(name, ["out.obj", "out.glb", "out.ply", "out.npz", "out.xyz", "nowhere/out.obj", "."])
    if any("--output" in parameter.opts for parameter in command.params):
        line += ["-o", own[int(rng.integers(len(own) if rng.random() < 0.3 else min(4, len(own))))]]
    options = [one for one in command.params if isinstance(one, click.Option) and "--output" not in one.opts]
    for _ in range(int(rng.integers(0, 5))):
        option = options[int(rng.integers(len(options)))]
        if "--help" in option.opts or {"--jobs", "--scheduler", "--open"} & set(option.opts):
            continue
        line.append(str(rng.choice([*option.opts, *option.secondary_opts])))
        if not option.is_flag:
            line.append(_value(rng, option))
    return line


def _value(rng: Random, option: click.Option) -> str:
    """Return a value that has the type of the option in two of three cases."""
    kind: Any = option.type
    if rng.random() < 0.33:
        return TEXTS[int(rng.integers(len(TEXTS)))]
    if isinstance(kind, click.Choice):
        return str(rng.choice(list(map(str, kind.choices))))
    if kind.name in ("integer", "integer range"):
        return str(int(rng.integers(0, 12)))
    if kind.name == "angle":
        return str(rng.choice(["pi/2", "40deg", "1.2", "pi/3", "2pi"]))
    if kind.name == "direction":
        return str(rng.choice(["x", "-y", "z", "0,1,1"]))
    if kind.name == "path":
        return str(rng.choice(["report.json", "numbers.txt", "pairs.txt", "missing.txt", "bad.obj", "."]))
    if kind.name == "float":
        return str(rng.choice([0.05, 0.2, 0.5, 1.0, 3.0]))
    return str(rng.choice(["7", "12:0.5", "3", "exact", "linear", "7,8", "flipped=0", "color"]))


def _write_inputs(rng: Random, folder: Path) -> None:
    """Write some meshes, lists of numbers, and other files."""
    from .files import write_obj, write_ply

    vertices, faces = shapes.hill(5, 4)
    (folder / "hill.obj").write_bytes(write_obj(rng, vertices, faces.tolist()))
    vertices, faces = shapes.sphere(1, 0.5, int(rng.integers(9)))
    (folder / "ball.ply").write_bytes(write_ply(rng, vertices, faces.tolist()))
    (folder / "bad.obj").write_text("v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\nf 1 2 9\n")
    (folder / "text.txt").write_text("nothing\n")
    (folder / "numbers.txt").write_text("\n".join(map(str, rng.integers(0, 40, 3))) + "\n")
    (folder / "pairs.txt").write_text("0 1\n1 2\n# end\n")
    (folder / "hill.npz").write_bytes(b"PK\x03\x04 is no archive")


def run_command(line: list[str]) -> tuple[int, str, str]:
    """Return the exit code and the captured output on stdout and stderr."""
    from coneflat.apps.cli.main import main

    out, err = io.StringIO(), io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["coneflat", *line]),
        mock.patch("webbrowser.open", return_value=True),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else 1
    return code, out.getvalue(), err.getvalue()
