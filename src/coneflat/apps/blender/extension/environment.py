"""The Python environment in which coneflat runs: found, checked and made; without bpy.

It is separate from Blender's own, which changes with each version, and which compiled libraries must fit.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .job import HINT, Failure, popen_options

#: The version of the extension, and the options of the commands.
OPTIONS_FILE = json.loads(Path(__file__).with_name("options.json").read_text(encoding="utf-8"))
#: Seconds to wait for a program that only prints its version.
_PATIENCE = 60.0
#: Prints whether a Python can make environments that coneflat supports.
_CAN_MAKE = "import sys, venv, ensurepip; print(sys.version_info >= (3, 10))"


@dataclass(frozen=True)
class Environment:
    """A program that runs coneflat.

    Attributes:
        command: the program and its first arguments.
        version: of coneflat.
    """

    command: tuple[str, ...]
    version: str

    def __str__(self) -> str:
        return f"coneflat {self.version}, {self.command[0]}"


def python_in(folder: Path) -> Path:
    """Return the path that the Python of an environment has."""
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def find(named: str, folder: Path) -> Environment:
    """Return the environment that a user names, else the extension's own, else one on the PATH.

    Args:
        named: a Python executable or a folder of an environment; "" for none.
        folder: the folder of the extension's environment, which may not exist.

    Raises:
        Failure: there is none, or the named one cannot run coneflat.
    """
    if named:
        path = Path(named).expanduser()
        return _checked((str(python_in(path) if path.is_dir() else path), "-m", "coneflat"))
    reason = f"coneflat is not installed: {HINT}"
    module = ("-m", "coneflat")
    own_python = str(python_in(folder))
    programs = ((own_python, module), ("coneflat", ()), ("python3", module), ("python", module))
    for name, words in programs:
        program = shutil.which(name)
        try:
            if program is not None:
                return _checked((program, *words))
        except Failure as failure:
            reason = str(failure) if name == own_python else reason
    raise Failure(reason)


def _checked(command: Sequence[str]) -> Environment:
    """Return the environment of a command.

    Raises:
        Failure: it does not run, or coneflat is older than the extension.
    """
    code, text = _output([*command, "--version"])
    match = re.search(r"coneflat, version (\d+(?:\.\d+)*)", text)
    if code != 0 or match is None:
        last = ([line.strip() for line in text.splitlines() if line.strip()] or [f"code {code}"])[-1]
        raise Failure(f"{command[0]} does not run coneflat: {last}")
    if _numbers(match[1]) < _numbers(OPTIONS_FILE["version"]):
        needed = OPTIONS_FILE["version"]
        raise Failure(f"coneflat {match[1]} of {command[0]} is older than the extension, {needed}: {HINT}")
    return Environment(tuple(command), match[1])


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall(r"\d+", version)[:3])


def _output(command: Sequence[str]) -> tuple[int, str]:
    """Return the exit code of a program and what it prints; 1 and the reason if it does not run."""
    try:
        done = subprocess.run(command, timeout=_PATIENCE, check=False, **popen_options())
    except OSError as error:
        return 1, error.strerror or str(error)
    except subprocess.TimeoutExpired:
        return 1, f"no answer within {_PATIENCE:.0f} s"
    return done.returncode, done.stdout


def install_commands(
    folder: Path, requirement: str, wheels: str, online: bool
) -> list[tuple[str, list[str]]]:
    """Return the commands that make the extension's environment, each with a name for messages.

    Args:
        folder: the folder of the environment; what it contains is removed.
        requirement: what pip installs; "" for coneflat, which is not in the package index, from the folder of wheels.
        wheels: a folder of wheels, to install without a network; "" for none.
        online: whether Blender allows access to the network.

    Raises:
        Failure: neither is possible, or no Python can make environments.
    """
    if wheels and not Path(wheels).is_dir():
        raise Failure(f"{wheels}, the folder of wheels, does not exist")
    if not wheels and not requirement.strip():
        raise Failure(f"coneflat is not installed: {HINT}")
    if not wheels and not online:
        raise Failure(f"online access is off: allow it; or, {HINT}")
    source = ["--no-index", "--find-links", wheels] if wheels else ["--retries", "1"]
    quiet = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"]
    python = str(python_in(folder))
    needed = requirement.strip() or f"coneflat>={OPTIONS_FILE['version']}"
    return [
        ("make environment", [_base_python(), "-m", "venv", "--clear", str(folder)]),
        ("install coneflat", [python, "-m", "pip", "install", *quiet, *source, needed]),
        # Else the first unwrapping would take half a minute longer.
        ("compile coneflat", [python, "-m", "coneflat", "warm-up", "-q"]),
    ]


def _base_python() -> str:
    """Return a Python that can make environments: Blender's own, which is always there, or one on the PATH."""
    running = sys.executable if Path(sys.executable).name.lower().startswith("python") else None
    for program in (
        running,
        *map(shutil.which, ("python3.12", "python3.11", "python3.10", "python3", "python")),
    ):
        if program and _output([program, "-c", _CAN_MAKE])[1].strip().endswith("True"):
            return program
    raise Failure(f"no Python 3.10 or later with venv was found: {HINT}")
