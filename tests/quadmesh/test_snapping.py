"""Vertices of quads are moved onto sharp edges beside them."""

from __future__ import annotations

import mechanical
import numpy as np
import pytest

from coneflat import quads
from coneflat.quadmesh.crease_fit import crease_fit
from coneflat.quadmesh.quad_mesh import QuadMesh, least_jacobians
from coneflat.quadmesh.smooth import MIN_JACOBIAN
from coneflat.quadmesh.snapping import snapped

SHARP = np.deg2rad(40)
NO_FEATURES = np.empty((0, 2), dtype=np.int64)


@pytest.fixture(scope="module")
def askew():
    """Quads of a wedge, made without regard to its sharp edges."""
    return quads(*mechanical.wedge(), quads=600, cones="sparse", boundary="free", smooth=0)


def test_more_of_the_sharp_edges_are_on_edges(askew: QuadMesh):
    nearer = snapped(askew, SHARP, NO_FEATURES)
    before, after = (crease_fit(mesh, SHARP) for mesh in (askew, nearer))
    assert before.share < 0.9
    assert after.share > before.share + 0.05
    assert after.score > before.score


def test_quads_remain_valid_and_on_the_surface(askew: QuadMesh):
    nearer = snapped(askew, SHARP, NO_FEATURES)
    np.testing.assert_array_equal(nearer.quads, askew.quads)
    jacobians = [least_jacobians(mesh.vertices, mesh.quads) for mesh in (askew, nearer)]
    assert jacobians[1].min() >= min(MIN_JACOBIAN, jacobians[0].min()) - 1e-9
    corners = nearer.surface.vertices[nearer.surface.faces[nearer.faces]]
    np.testing.assert_allclose(
        np.einsum("qi,qix->qx", nearer.barycentric, corners), nearer.vertices, atol=1e-9
    )


def test_quads_that_follow_all_sharp_edges_stay():
    mesh = quads(*mechanical.wedge(), quads=600)
    assert crease_fit(mesh, SHARP).is_complete
    assert snapped(mesh, SHARP, NO_FEATURES) is mesh
