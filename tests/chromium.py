"""The Chromium of this machine, for all that opens a page in one."""

from __future__ import annotations

import os
import shutil

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
ARGUMENTS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # no graphics card is needed


def browser_path() -> str | None:
    """Return the browser that CHROMIUM or else the search path names; None if there is none."""
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
