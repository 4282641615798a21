"""The model that ships with the package: a small creature of genus 1, about ten thousand triangles."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def sample_path() -> Path:
    """Return the path of the sample, an OBJ file without UVs; y is up."""
    return Path(str(files(__name__) / "sample.obj"))
