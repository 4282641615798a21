"""The model that ships with the package: a small creature of genus 1, about ten thousand triangles."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def sample_path() -> Path:
    """Return the path of the sample, an OBJ file without UVs; y is up.

    It is a closed surface of genus 1: 5,300 vertices and 10,600 triangles, in one component, in model units without a
    name. The file is part of the package, is not to be written to, and is there without a network. Nothing is
    raised.

    Examples:
        >>> coneflat.sample_path().name
        'sample.obj'
        >>> coneflat.read_mesh(coneflat.sample_path()).vertices.shape
        (5300, 3)
    """
    return Path(str(files(__name__) / "sample.obj"))
