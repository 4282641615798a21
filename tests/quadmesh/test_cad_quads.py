"""Quads of mechanical parts in long thin triangles, as CAD programs export them, follow the sharp edges."""

from __future__ import annotations

import cad_parts
import numpy as np
import pytest
import shapes

from coneflat import check_mesh, measure_quads, quads
from coneflat.quadmesh.crease_fit import FOLLOWED, crease_fit
from coneflat.quadmesh.cross_field import SHARP_ANGLE, is_mechanical
from coneflat.quadmesh.mirror_choice import MAX_UNFOLLOWED
from coneflat.quadmesh.remesh import is_thin, remeshed

SHARP = np.deg2rad(40)
#: Least share of the length of sharp edges on edges of quads.
LEAST_SHARE = 0.9


@pytest.fixture(params=["round_hole", "nut", "pocket"])
def part(request):
    return cad_parts.SHAPES[request.param]()


@pytest.mark.parametrize("name", cad_parts.SHAPES)
def test_parts_are_closed_thin_and_mechanical(name):
    vertices, faces = cad_parts.SHAPES[name]()
    mesh = check_mesh(vertices, faces).mesh
    assert not mesh.is_boundary_edge.any()
    assert (
        np.einsum("ij,ij->", vertices[faces[:, 0]], np.cross(*vertices[faces[:, 1:]].transpose(1, 0, 2))) > 0
    )
    assert is_thin(mesh).mean() > 0.1
    assert is_mechanical(mesh)


def test_box_with_a_hole_has_144_triangles():
    _, faces = cad_parts.round_hole()
    assert len(faces) == 144


@pytest.mark.parametrize("angle", [None, SHARP], ids=["default", "required"])
def test_quads_lie_on_sharp_edges(part, angle):
    mesh = quads(*part, quads=1500, sharp_angle=angle)
    measures = measure_quads(mesh)
    assert crease_fit(mesh, SHARP).share >= LEAST_SHARE
    assert measures.angle_mean < 4
    assert measures.inverted == 0
    assert mesh.euler_characteristic == mesh.surface_euler


@pytest.mark.slow
@pytest.mark.parametrize("count", [1000, 3000])
@pytest.mark.parametrize("name", cad_parts.SHAPES)
def test_required_edges_are_not_worse(name, count):
    part = cad_parts.SHAPES[name]()
    preferred, required = (
        crease_fit(quads(*part, quads=count, sharp_angle=angle), SHARP) for angle in (None, SHARP)
    )
    # With few quads the teeth of the gear are as narrow as some quads.
    assert preferred.share >= (LEAST_SHARE if count >= 3000 else 0.7)
    assert required.is_complete or required.score >= preferred.score


@pytest.mark.slow
def test_symmetric_quads_follow_as_many_sharp_edges():
    """Symmetric quads of the gear, of about as many irregular vertices, leave out a sixth of its sharp edges."""
    auto, plain = (quads(*cad_parts.gear(), quads=3000, symmetry=symmetry) for symmetry in ("auto", "none"))
    shares = [crease_fit(mesh, SHARP).share for mesh in (auto, plain)]
    assert shares[0] >= shares[1] - MAX_UNFOLLOWED
    assert "of the length of sharp edges would be on edges of quads instead of" in auto.notes[-1]


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_scale_does_not_matter(scale):
    vertices, faces = cad_parts.nut()
    plain, scaled = (quads(size * vertices, faces, quads=800) for size in (1.0, scale))
    np.testing.assert_array_equal(plain.valences, scaled.valences)
    np.testing.assert_allclose(scaled.vertices / scale, plain.vertices, atol=1e-6)
    assert crease_fit(scaled, SHARP).share == pytest.approx(crease_fit(plain, SHARP).share, abs=1e-3)


def test_numbering_does_not_matter(part):
    """The remeshed part is the same. Its cones may be others, as parts are symmetric, but not worse."""
    vertices, faces = part
    rng = np.random.default_rng(0)
    order = rng.permutation(len(vertices))
    renumbered = vertices[order], np.argsort(order)[faces][rng.permutation(len(faces))]
    corners = []
    for mesh in (part, renumbered):
        simple = remeshed(check_mesh(*mesh).mesh, 2000)[0]
        corners.append(np.array(sorted(simple.vertices[simple.faces].mean(axis=1).round(9).tolist())))
        assert crease_fit(quads(*mesh, quads=1500), SHARP).share >= LEAST_SHARE
    np.testing.assert_allclose(corners[1], corners[0], atol=1e-8)


def test_share_of_edges_by_hand():
    """Quads of a cube follow all its edges; moved by half a quad along the diagonal they follow none."""
    mesh = quads(*shapes.box(3, (1.0, 1.0, 1.0)), quads=150, sharp_angle=SHARP)
    assert crease_fit(mesh, SHARP).share == pytest.approx(1.0)
    assert crease_fit(mesh, SHARP).is_complete
    mesh.vertices[:] += 0.05
    assert crease_fit(mesh, SHARP).share < 1 - FOLLOWED + 0.1


def test_surface_without_sharp_edges():
    mesh = quads(*shapes.sphere(3), quads=200)
    assert crease_fit(mesh, SHARP_ANGLE).share == 1.0
    assert not is_mechanical(mesh.surface)
