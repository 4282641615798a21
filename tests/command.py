"""The command, run in this process: what it prints, and its exit code; signals of a process of its own."""

from __future__ import annotations

import gc
import os
import signal
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from types import SimpleNamespace
from unittest.mock import patch

import pytest

from coneflat.apps.cli.main import main


def reset_signals():
    """Handle signals by default: `nohup` and `&` of a shell ignore SIGHUP and SIGINT, and so does what they start."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)


#: Arguments of `subprocess.Popen` for a process that signals interrupt.
INTERRUPTIBLE = {} if os.name == "nt" else {"preexec_fn": reset_signals}


def without_note_on_compilation(stderr: str) -> str:
    """Return what a process printed without the note on compilation, which depends on the cache of kernels."""
    lines = stderr.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith("coneflat: compiling"))


def command(*words, cwd="."):
    out, err, threshold, before = StringIO(), StringIO(), gc.get_threshold(), os.getcwd()
    argv = patch.object(sys, "argv", ["coneflat", *map(str, words)])
    os.chdir(cwd)
    try:
        with redirect_stdout(out), redirect_stderr(err), argv, pytest.raises(SystemExit) as stopped:
            main()
    finally:
        os.chdir(before)
        gc.unfreeze()
        gc.set_threshold(*threshold)
    stderr = without_note_on_compilation(err.getvalue())
    return SimpleNamespace(returncode=stopped.value.code, stdout=out.getvalue(), stderr=stderr)
