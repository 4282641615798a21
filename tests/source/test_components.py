"""Parts of a mesh as they are flattened."""

from __future__ import annotations

import numpy as np

from coneflat.io import as_input
from coneflat.options import read_options
from coneflat.source import Source


def test_areas_of_components_are_those_before_triangles_are_opened():
    """The area distortion is measured with them: opening makes a long triangle without area a large one."""
    vertices = np.array([[0, 0, 0], [1000, 0, 0], [2000, 0, 0], [1000, -0.1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2]])
    (component,) = Source(as_input(vertices, faces)).prepared(read_options({})).components
    opened, areas = component.lengths, component.double_areas / component.double_areas.max()
    np.testing.assert_allclose(areas, [0, 1, 1], atol=1e-9)
    assert (opened[0].max() < np.sort(opened[0])[:2].sum()).all()
