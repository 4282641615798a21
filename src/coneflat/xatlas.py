"""`coneflat.unwrap` with the interface of the package xatlas: `import coneflat.xatlas as xatlas`.

All faces with valid indices get UVs in their own orientation: where faces do not form an oriented surface, they get
charts of their own, and faces without area get a point.

Examples:
    >>> import coneflat.xatlas as xatlas
    >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> vmapping, indices, uvs = xatlas.parametrize(vertices, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    >>> indices.shape, uvs.dtype, bool((uvs >= 0).all() and (uvs <= 1).all())
    ((4, 3), dtype('float32'), True)
"""

from .apps.xatlas.interface import Atlas, Chart, export, parametrize
from .apps.xatlas.options import ChartOptions, PackOptions

__all__ = ["Atlas", "Chart", "ChartOptions", "PackOptions", "export", "parametrize"]
