"""Odd command lines, run in this process; and commands in their own, without streams or ended by signals."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any
from unittest import mock

import click
import numpy as np
import shapes

from .outcome import Outcome
from .written import READERS

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
        "batch": ["out"],
    }
    paths = outputs.get(name, ["out.obj", "out.glb", "out.ply", "out.npz", "out.xyz", "nowhere/out.obj", "."])
    if any("--output" in parameter.opts for parameter in command.params):
        line += ["-o", paths[int(rng.integers(len(paths) if rng.random() < 0.3 else min(4, len(paths))))]]
    options = [
        flag for flag in command.params if isinstance(flag, click.Option) and "--output" not in flag.opts
    ]
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
            err.write(end.code if isinstance(end.code, str) else "")  # as Python does at the end of a process
    return code, out.getvalue(), err.getvalue()


#: Seconds that a command in its own process may take.
PATIENCE = 80.0


def _make_process(rng: Random) -> tuple[list[str], Path]:
    """Return a command line that writes a file, with its input in the folder, and the file."""
    shapes.write_obj(Path("in.obj"), *shapes.sphere(int(rng.integers(2, 5))))
    output = Path(f"out{rng.choice([*READERS])}")
    line = [sys.executable, "-m", "coneflat", "flatten", "in.obj", "-o", str(output)]
    return line + (["--report", "report.json"] if rng.random() < 0.3 else []), output


def _handle_signals() -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


def run_without_streams(rng: Random, outcome: Outcome) -> None:
    """Run a command with closed standard streams, which must write its file all the same."""
    line, output = _make_process(rng)
    closed = str(rng.choice([">&-", "2>&-", "<&-", ">&- 2>&-", "<&- >&- 2>&-"]))
    outcome.recipe = f"{' '.join(line[1:])} {closed}"
    told = f'"$0" "$@" {closed}'
    done = subprocess.run(
        ["sh", "-c", told, *line], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    if done.returncode or "internal error" in done.stderr:
        outcome.breach(f"process: exit code {done.returncode} with {closed}", done.stdout + done.stderr)
    if not output.exists() or not len(READERS[output.suffix](output)[0]):
        outcome.breach(f"process: no output with {closed}")


def interrupt_command(rng: Random, outcome: Outcome) -> None:
    """End a command by a signal, half of the cases as soon as it writes; it must leave all of its files or none."""
    line, output = _make_process(rng)
    name = str(rng.choice(["SIGTERM", "SIGINT", "SIGHUP"]))
    delay = float(rng.uniform(0, 3)) if rng.random() < 0.5 else None
    outcome.recipe = (
        f"{' '.join(line[1:])}, {name} {'when it writes' if delay is None else f'after {delay:.2f} s'}"
    )
    # A worker ignores SIGINT, `nohup` SIGHUP, and so does what they start.
    command = subprocess.Popen(
        line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=_handle_signals
    )
    ends = time.perf_counter() + (PATIENCE if delay is None else delay)
    while time.perf_counter() < ends and command.poll() is None:
        if delay is None and len(os.listdir()) > 1:
            break
        time.sleep(0.001)
    number = getattr(signal, name)
    command.send_signal(number)
    _, said = command.communicate(timeout=PATIENCE)
    # Before the command has set up, and after it has ended, Python itself handles the signal.
    if command.returncode not in (0, 128 + number, -number, 1 if "KeyboardInterrupt" in said else 0):
        outcome.breach(f"process: exit code {command.returncode} after {name}", said)
    if "internal error" in said:
        outcome.breach(f"process: internal error after {name}", said)
    left = {*os.listdir()} - {"in.obj", "report.json", output.name}
    if left:
        outcome.breach(f"process: {name} leaves incomplete files", left)
    if output.exists() and not len(READERS[output.suffix](output)[0]):
        outcome.breach(f"process: {name} leaves an incomplete output", output)
