"""Comparison of coneflat with baselines: other methods, and other packages.

`methods.py` has the baselines that flatten with given cones, implemented here: boundary first flattening (`bff.py`),
least squares conformal maps (`disk_maps.py`), angle based flattening (`abf.py`) and circle patterns (`patterns.py`),
which are also an independent way to the exact metric and verify it. `atlases.py` has those that find their own cut:
`coneflat.unwrap`, and the packages xatlas and uvunwrap, if they are installed.

Examples:
    >>> from comparisons import flatten_by
    >>> vertices = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> flatten_by("bff", vertices, faces)
    <Flattening: 4 triangles, 4 cones, 1 chart, QC 1.0000>
"""

from .comparison import Comparison, Entry, compare_methods
from .methods import COMPARED_METHODS, METHODS, flatten_by, label_of

__all__ = ["COMPARED_METHODS", "METHODS", "Comparison", "Entry", "compare_methods", "flatten_by", "label_of"]
