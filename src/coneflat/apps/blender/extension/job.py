"""Processes that run beside Blender, with their progress and their errors; without bpy."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

#: A line of progress of a command: seconds, percent and stage.
_PROGRESS = re.compile(r"\s*[\d.]+ s +(\d+)%\s+(\S.*)")
#: An error, without the reference to the help of the command.
_ERROR = re.compile(r"(?:coneflat: )?error: (.+?)(?: \(see `.+`\))?$", re.IGNORECASE)
HINT = "in the preferences of the extension, name a Python that has coneflat, or a folder of wheels"
#: Seconds to wait for the end of a process that was killed.
_PATIENCE = 5.0


def popen_options() -> dict[str, Any]:
    """Return the options of a process that prints UTF-8 into one pipe, without a window or a terminal."""
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    environment.pop("PYTHONHOME", None)  # Blender's own
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    text = {"text": True, "encoding": "utf-8", "errors": "replace"}
    hidden = {"creationflags": getattr(subprocess, "CREATE_NO_WINDOW", 0)}
    return {"env": environment, "start_new_session": os.name == "posix", **pipes, **text, **hidden}


class Failure(Exception):
    """The reason why an operator ended without a result, in one line."""


class Job:
    """A process, which is ended when the job is left as a context.

    Attributes:
        name: what it does, for messages.
        stage: what it does now, "" before the first progress.
        fraction: the completed fraction of its work, 0 to 1.
    """

    def __init__(self, name: str, command: Sequence[str], folder: Path | None = None) -> None:
        """Start the process.

        Args:
            name: what it does, for messages.
            command: program and arguments.
            folder: the current folder of the process.

        Raises:
            Failure: the program cannot be started.
        """
        self.name, self.stage, self.fraction = name, "", 0.0
        self._lines = deque[str](maxlen=50)
        try:
            self._process = subprocess.Popen(command, cwd=folder, **popen_options())
        except OSError as error:
            raise Failure(f"{command[0]} cannot be started: {error.strerror or error}") from error
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Job:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _read(self) -> None:
        """Read what the process prints, until it ends; a full pipe would stop it."""
        stream = self._process.stdout
        assert stream is not None
        with stream, suppress(ValueError, OSError):
            for line in stream:
                match = _PROGRESS.fullmatch(line.rstrip())
                if match:
                    self.fraction, self.stage = int(match[1]) / 100, match[2]
                elif line.strip():
                    self._lines.append(line.rstrip())

    @property
    def is_done(self) -> bool:
        """Return whether the process has ended."""
        return self._process.poll() is not None

    def stop(self) -> None:
        """End the process, and those that it has started, if it runs."""
        if self.is_done:
            return
        with suppress(OSError):
            if sys.platform == "win32":
                self._process.kill()
            else:
                os.killpg(self._process.pid, signal.SIGKILL)
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_PATIENCE)

    def check(self) -> None:
        """Raise Failure if the process has ended with an error.

        Raises:
            Failure: the error that it has printed, or how it ended.
        """
        code = self._process.wait()
        if code == 0:
            return
        self._reader.join(_PATIENCE)
        if any("connection broken" in line for line in self._lines):
            raise Failure(f"{self.name}: there is no network; {HINT}")
        errors = [match[1] for line in self._lines if (match := _ERROR.match(line))]
        if errors:
            raise Failure(f"{self.name}: {errors[-1]}")
        ended = f"ended with code {code}"
        if code < 0:
            with suppress(ValueError):
                ended = f"crashed or was ended by {signal.Signals(-code).name}"
        last = [line[:200] for line in self._lines if not line.startswith((" ", "nanobind", "See "))][-1:]
        raise Failure(": ".join([f"{self.name} {ended}", *last]))
