from __future__ import annotations

import numpy as np
import pytest
from polyhedra import box_on_box, cube, icosphere, turned
from shapes import annulus, box, cylinder, grid, join, renumber, rotation, torus, without

from coneflat import TriangleMesh, check_mesh
from coneflat.apps.patterns.sheet.bends import find_bends
from coneflat.apps.patterns.sheet.sheet import develop_sheet
from coneflat.apps.patterns.sheet.thickness import thickness_of
from coneflat.apps.patterns.units import percentage
from coneflat.errors import MeshError


def extruded(profile, width: float = 40.0, rows: int = 3) -> TriangleMesh:
    """The sheet of a profile (k, 2) in the plane of x and z, along y."""
    steps = np.linspace(0, width, rows + 1)
    vertices = np.array([[x, y, z] for x, z in profile for y in steps])
    first = np.array([i * (rows + 1) + j for i in range(len(profile) - 1) for j in range(rows)])
    second = first + rows + 1
    faces = [np.stack([first, first + 1, second + 1], 1), np.stack([first, second + 1, second], 1)]
    return check_mesh(vertices, np.concatenate(faces)).mesh


def round_profile(radius: float, angle: float, facets: int = 8):
    """A flat part 30 long, an arc, and a flat part 20 long."""
    turns = np.linspace(0, angle, facets + 1)
    arc = np.stack([30 + radius * np.sin(turns), radius - radius * np.cos(turns)], axis=1)
    return np.concatenate([[[0, 0]], arc, [arc[-1] + 20 * np.array([np.cos(angle), np.sin(angle)])]])


def solid(profile, thickness: float, width: float = 40.0) -> TriangleMesh:
    """The same as a closed solid, mitred at the corners of the profile."""
    profile = np.asarray(profile, dtype=float)
    along = np.diff(profile, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    mitre = (across[1:] + across[:-1]) / (1 + (across[1:] * across[:-1]).sum(axis=1))[:, None]
    normals = np.concatenate([across[:1], mitre, across[-1:]])
    ring = np.concatenate([profile, (profile - thickness * normals)[::-1]])
    count = len(ring)
    vertices = np.concatenate([np.insert(ring, 1, y, axis=1) for y in (0.0, width)])
    faces = []
    for i in range(count):
        j = (i + 1) % count
        faces += [[i, j, count + j], [i, count + j, count + i]]
    for i in range(len(profile) - 1):
        j, k, l = i + 1, count - 2 - i, count - 1 - i  # noqa: E741
        faces += [[i, k, j], [i, l, k], [count + i, count + j, count + k], [count + i, count + k, count + l]]
    mesh = check_mesh(vertices, np.array(faces)).mesh
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    is_outward = np.einsum("ij,ij->", a, np.cross(b, c)) > 0
    return mesh if is_outward else TriangleMesh(mesh.vertices, mesh.faces[:, ::-1].copy())


def exact(mesh: TriangleMesh):
    """Return the exact development of a mesh in one piece, and its bends."""
    surface = develop_sheet(mesh).surface
    assert surface.pieces.max() == 0
    assert np.abs(surface.edges.strains(surface.points)).max() < 1e-9
    assert not len(surface.overlaps())
    return surface, find_bends(surface)


def test_sharp_bends_are_lines_with_the_angle_of_the_profile():
    surface, bends = exact(extruded([[0, 0], [10, 0], [20, 10], [40, 10], [50, 0], [60, 0]]))
    assert not len(surface.seams)
    assert [bend.radius for bend in bends] == [0] * 4
    angles = np.degrees([bend.angle for bend in bends])
    np.testing.assert_allclose(np.abs(angles), 45)
    np.testing.assert_allclose(sorted(angles), [-45, -45, 45, 45])
    stations = sorted(np.abs((bend.line - bends[0].line[0]) @ _across(bends[0])).mean() for bend in bends)
    diagonal = 10 * 2**0.5
    np.testing.assert_allclose(stations, [0, diagonal, diagonal + 20, 2 * diagonal + 20], atol=1e-9)
    assert all(np.linalg.norm(np.diff(bend.line, axis=0)) == pytest.approx(40) for bend in bends)


def _across(bend):
    along = (bend.line[1] - bend.line[0]) / np.linalg.norm(bend.line[1] - bend.line[0])
    return np.array([-along[1], along[0]])


@pytest.mark.parametrize(("radius", "degrees", "facets"), [(5, 90, 8), (10, 60, 12), (3, 135, 20)])
def test_a_round_bend_is_one_line_with_its_angle_and_radius(radius, degrees, facets):
    surface, (bend,) = exact(extruded(round_profile(radius, np.radians(degrees), facets)))
    assert abs(np.degrees(bend.angle)) == pytest.approx(degrees)
    assert bend.radius == pytest.approx(radius)
    assert bend.width == pytest.approx(2 * radius * facets * np.sin(np.radians(degrees) / facets / 2))
    # Its line is in the middle of the bent part, which is between flat parts 30 and 20 long.
    stations = (surface.points - bend.line[0]) @ _across(bend)
    np.testing.assert_allclose(
        sorted([-stations.min(), stations.max()]), [20 + bend.width / 2, 30 + bend.width / 2]
    )


def arc(radius: float, turns):
    """Points on a circle at given angles."""
    return radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)


EVEN, UNEVEN = np.linspace(0, 1.2, 20), 1.2 * np.linspace(0, 1, 20) ** 1.5


@pytest.mark.parametrize("turns", [EVEN, UNEVEN, np.linspace(0, 1.2, 61)], ids=["even", "uneven", "fine"])
def test_a_rolled_plate_is_one_bend_from_border_to_border(turns):
    plate = extruded(arc(50, turns))
    surface, (bend,) = exact(plate)
    assert np.degrees(abs(bend.angle)) == pytest.approx(np.degrees(1.2))
    assert bend.radius == pytest.approx(50)
    assert bend.width == pytest.approx(np.ptp(surface.points @ _across(bend)))
    np.testing.assert_allclose(
        bend.line.mean(axis=0) @ _across(bend),
        np.mean([(surface.points @ _across(bend)).min(), (surface.points @ _across(bend)).max()]),
        atol=1e-9,
    )
    vertices, faces, _ = renumber(plate.vertices, plate.faces)
    _, (moved,) = exact(check_mesh(1e-3 * vertices @ rotation().T + 7, faces).mesh)
    np.testing.assert_allclose(
        [abs(moved.angle), 1e3 * moved.radius], [abs(bend.angle), bend.radius], rtol=1e-6
    )


@pytest.mark.parametrize("facets", [3, 4, 12])
@pytest.mark.parametrize("web", [1.0, 5.0, 30.0])
def test_round_bends_on_both_sides_of_a_web_are_two(facets, web):
    first = np.add([4, 0], arc(4, np.linspace(np.pi, 1.5 * np.pi, facets + 1)))
    second = np.add([4 + web, 0], arc(4, np.linspace(1.5 * np.pi, 2 * np.pi, facets + 1)))
    _, bends = exact(extruded(np.concatenate([[[0, 20]], first, second, [[8 + web, 20]]])))
    np.testing.assert_allclose(np.degrees([abs(bend.angle) for bend in bends]), [90, 90])
    np.testing.assert_allclose([bend.radius for bend in bends], [4, 4])


def test_a_hole_divides_a_round_bend_in_two():
    bracket = extruded(round_profile(5, np.pi / 2), 60, 12)
    middle = bracket.vertices[bracket.faces].mean(axis=1)
    is_hole = (np.abs(middle[:, 1] - 30) < 6) & (middle[:, 0] > 30) & (middle[:, 2] < 5)
    _, bends = exact(check_mesh(*without(bracket.vertices, bracket.faces, is_hole)).mesh)
    np.testing.assert_allclose(np.degrees([abs(bend.angle) for bend in bends]), [90, 90])
    np.testing.assert_allclose([bend.radius for bend in bends], [5, 5])


def test_two_flanges_beside_a_web_are_two_bends():
    _, bends = exact(extruded([[0, 20], [0, 0], [20, 0], [20, 20]]))
    assert len(bends) == 2


def test_a_tube_is_one_bend_and_a_cone_has_none():
    mesh = check_mesh(*cylinder(24, 6)).mesh
    surface, (bend,) = exact(mesh)
    assert surface.seam_length == pytest.approx(3)
    assert bend.radius == pytest.approx(1)
    # The first and the last facet are half inside the bend about their folds, and half beyond.
    assert np.degrees(abs(bend.angle)) == pytest.approx(360)
    assert bend.width == pytest.approx(24 * 2 * np.sin(np.pi / 24))
    assert exact(turned(np.linspace(1, 0.4, 7), np.linspace(0, 1, 7)))[1] == ()


def test_a_tray_is_cut_at_its_corners_only():
    vertices, faces = box(2, (4, 3, 1))
    mesh = check_mesh(*without(vertices, faces, vertices[faces].mean(axis=1)[:, 2] > 0.99)).mesh
    surface, bends = exact(mesh)
    assert surface.seam_length == pytest.approx(4)
    np.testing.assert_allclose(np.degrees([bend.angle for bend in bends]), 90)
    assert len(bends) == 4


def test_a_curved_sheet_is_strained_in_one_piece_without_cuts():
    surface = develop_sheet(check_mesh(*annulus(24, 5)).mesh).surface
    assert surface.pieces.max() == 0
    assert not len(surface.seams)
    assert 0.01 < np.abs(surface.edges.strains(surface.points)).max() < 0.3
    assert find_bends(surface) == ()


def test_a_stretched_component_leaves_the_bends_of_the_others():
    bent, curved = extruded(L_PROFILE), check_mesh(*annulus(24, 5)).mesh
    parts = (
        (bent.vertices, bent.faces),
        (curved.vertices + 100, curved.faces),
        (bent.vertices + 200, bent.faces),
    )
    developed = develop_sheet(check_mesh(*join(*parts)).mesh)
    bends = find_bends(developed.surface)
    stretched = int(developed.surface.pieces[len(bent.faces)])
    assert [bend.piece for bend in bends] == [piece for piece in range(3) if piece != stretched]
    np.testing.assert_allclose(np.degrees([abs(bend.angle) for bend in bends]), 90)
    (note,) = developed.notes
    assert note.startswith(f"no bend lines in 1 of 3 pieces ({stretched + 1})")
    strain = np.abs(developed.surface.edges.strains(developed.surface.points)).max()
    assert f"by up to {percentage(strain)};" in note
    assert develop_sheet(bent).notes == ()


def test_components_are_pieces_and_closed_surfaces_are_cut():
    two = join(grid(4, 4), (grid(4, 4)[0] + 3, grid(4, 4)[1]))
    assert develop_sheet(check_mesh(*two).mesh).surface.pieces.max() == 1
    surface, bends = exact(cube())
    assert len(surface.seams) == 7
    assert len(bends) == 5


def test_sheets_do_not_depend_on_numbers_motion_or_scale():
    mesh = extruded(round_profile(5, np.pi / 2))
    vertices, faces, _ = renumber(mesh.vertices, mesh.faces)
    for scale in (1e-6, 1e6):
        moved = check_mesh(scale * (vertices @ rotation().T + 7), faces).mesh
        _, (bend,) = exact(moved)
        assert abs(bend.angle) == pytest.approx(np.pi / 2)
        assert bend.radius == pytest.approx(5 * scale)


L_PROFILE = [[0, 0], [30, 0], [30, 25]]


@pytest.mark.parametrize("profile", [L_PROFILE, round_profile(5, np.pi / 2), [[0, 0], [60, 0]]])
@pytest.mark.parametrize("thickness", [1.0, 2.0])
def test_the_thickness_of_a_solid_is_measured(profile, thickness):
    mesh = solid(profile, thickness)
    assert thickness_of(mesh) == pytest.approx(thickness)
    scaled = mesh.moved_to(1e-3 * mesh.vertices @ rotation().T)
    assert thickness_of(scaled) == pytest.approx(1e-3 * thickness)


def test_a_solid_is_an_error_that_says_its_thickness():
    with pytest.raises(MeshError, match=r"a solid that is 2 mm thick"):
        develop_sheet(solid(L_PROFILE, 2.0))


@pytest.mark.parametrize(
    "mesh",
    [icosphere(2), cube(), box_on_box(), check_mesh(*box(4, (1, 1, 20))).mesh, check_mesh(*torus()).mesh],
    ids=["sphere", "cube", "tower", "rod", "torus"],
)
def test_other_closed_surfaces_are_no_sheets(mesh):
    assert thickness_of(mesh) is None
