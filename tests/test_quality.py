"""Lint, format and types, as part of the tests."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize(
    "arguments", [["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy", "--num-workers", "2"]]
)
def test_lint_format_and_types_pass(arguments):
    pytest.importorskip(arguments[0])
    if arguments[0] == "mypy" and np.lib.NumpyVersion(np.__version__) < "2.4.0":
        pytest.skip(
            "earlier numpy declares types of arrays by their number of axes, which later ones gave up"
        )
    done = subprocess.run(
        [sys.executable, "-m", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
