"""Baselines that find their own cut: `coneflat.unwrap`, and other packages if these are installed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec

import numpy as np

from coneflat import Flattening, unwrap
from coneflat.apps.view import uv_flattening
from coneflat.base import FloatArray
from coneflat.errors import MetricError
from coneflat.io import as_uv_mesh


@dataclass(frozen=True)
class AtlasBaseline:
    """A method that finds its own cut, often of another package.

    Attributes:
        module: the module to import.
        run: returns (m, 3, 2) UVs for the mesh of a flattening, whose cut it may use.
        note: how it differs from the methods of this package.
    """

    module: str
    run: Callable[[Flattening], FloatArray]
    note: str


def installed_baselines() -> tuple[str, ...]:
    """Return the names of the baselines that are installed."""
    return tuple(name for name, baseline in ATLAS_BASELINES.items() if find_spec(baseline.module) is not None)


def run_baseline(name: str, base: Flattening) -> tuple[Flattening, float]:
    """Return the result of a baseline for the mesh of a flattening, and its running time in seconds.

    Raises:
        MetricError: the baseline fails, or its result is not a map of the mesh.
    """
    baseline = ATLAS_BASELINES[name]
    try:
        import_module(baseline.module)
        start = time.perf_counter()
        corner_uv = baseline.run(base)
    except Exception as error:  # other packages may raise anything
        raise MetricError(f"{name} failed: {type(error).__name__}: {error}") from error
    seconds = time.perf_counter() - start
    if corner_uv.shape != (len(base.faces), 3, 2) or not np.isfinite(corner_uv).all():
        raise MetricError(f"{name} did not return a finite map of all {len(base.faces):,} triangles")
    return uv_flattening(as_uv_mesh(base.vertices, base.faces, corner_uv)), seconds


def unwrap_charts(base: Flattening) -> FloatArray:
    """Return the UVs of `coneflat.unwrap` with its default options."""
    return unwrap(base.vertices, base.faces).corner_uv


def xatlas_charts(base: Flattening) -> FloatArray:
    """Return the UVs of xatlas, run at an area of 10,000 so that its absolute tolerances do not matter."""
    import xatlas

    sides = base.vertices[base.faces[:, 1:]] - base.vertices[base.faces[:, :1]]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1).sum() / 2
    _, corners, uv = xatlas.parametrize(base.vertices * (100 / np.sqrt(area)), base.faces)
    return np.asarray(uv, dtype=np.float64)[np.asarray(corners, dtype=np.int64)]


def uvunwrap_charts(base: Flattening) -> FloatArray:
    """Return the UVs of uvunwrap with its default options."""
    import uvunwrap

    mesh = uvunwrap.Mesh(base.vertices.ravel().tolist(), base.faces.ravel().tolist())
    unwrapped = uvunwrap.generate([mesh]).meshes[0]
    return np.array(unwrapped.corner_uvs, dtype=np.float64).reshape(-1, 3, 2)


#: The baselines by name.
ATLAS_BASELINES = {
    "unwrap": AtlasBaseline("coneflat", unwrap_charts, "short seams with free sides, for textures"),
    "xatlas": AtlasBaseline("xatlas", xatlas_charts, "own charts"),
    "uvunwrap": AtlasBaseline("uvunwrap", uvunwrap_charts, "own charts"),
}
