"""What untangling promises: no winding, nothing prescribed is moved, both sides of seams equal, bounded work."""

from __future__ import annotations

from importlib import import_module
from itertools import pairwise

import numpy as np
import pytest
import shapes
from stored_meshes import stored_heights

import coneflat
from coneflat import TriangleMesh
from coneflat.geometry import edge_lengths, rest_sides
from coneflat.geometry.planar import heights, signed_double_areas
from coneflat.geometry.straight import FlatTriangles
from coneflat.mesh.connectivity import joined_meshes
from coneflat.optimise import embedded_disks
from coneflat.optimise.untangling import DEGENERATE_HEIGHT, Patches, untangle

UNTANGLING = import_module("coneflat.optimise.untangling")


def fan(rim, noise, seed):
    """A hub in the middle of a circle, moved up and down at random."""
    turn = 2 * np.pi * np.arange(rim) / rim
    points = np.concatenate([np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]), [[0, 0, 0]]])
    points[:, 2] = noise * stored_heights(seed, rim + 1)
    around = np.arange(rim)
    return points, np.column_stack([around, np.roll(around, -1), np.full(rim, rim)])


def spikes(cells, noise, seed):
    points, faces = shapes.grid(cells, cells)
    points[:, 2] = noise * stored_heights(seed, len(points))
    return points, faces


def folded(noise, cells=16):
    """A curved sheet, moved up and down at random."""
    points, faces = shapes.hill(cells, cells)
    points[:, 2] += noise * stored_heights("5", len(points))
    return points, faces


def stretched(mesh, factor):
    points, faces = mesh
    return points * [factor, 1, 1], faces


def laid_out_angles(result):
    """The angles at each corner of the layout, negative where it is flipped."""
    at = result.corner_uv @ [1, 1j]
    return np.angle((at[:, [2, 0, 1]] - at) / (at[:, [1, 2, 0]] - at))


def angle_sums(result):
    return np.bincount(result.faces.ravel(), laid_out_angles(result).ravel(), len(result.vertices))


def is_upright(result):
    """Vertices with no triangle around that is flipped, and on no seam where sides of seams have changed."""
    upright = np.ones(len(result.vertices), dtype=bool)
    upright[result.faces[laid_out_angles(result).min(axis=1) <= 0]] = False
    if any("at the expense of" in note for note in result.notes):
        upright[result.seams] = False
    return upright


def inside(result):
    mesh = TriangleMesh(result.vertices, result.faces)
    free = ~mesh.is_boundary_vertex
    free[result.cones] = False
    return free


WILD = {
    **{f"fan {noise} {seed}": fan(24, noise, seed) for noise in (6, 30) for seed in "35"},
    **{f"spikes {noise} {seed}": spikes(12, noise, seed) for noise in (0.3, 1.0) for seed in "02"},
}


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.slow] * ("spikes 1.0" in name)) for name in WILD],
)
def untangled(request):
    """The result of a wild mesh in one chart, and the patches that were untangled for it."""
    seen = []

    def watched(flat, faces, angles, on_boundary, stays, target_shapes, rings):
        result = untangle(flat, faces, angles, on_boundary, stays, target_shapes, rings)
        seen.append((result, faces, angles, flat, on_boundary))
        return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(import_module("coneflat.layout.laying_out"), "untangle", watched)
        return coneflat.flatten(*WILD[request.param], charts="one"), seen


class TestWinding:
    def test_no_untangled_patch_winds_around_a_vertex(self, untangled):
        """Otherwise triangles stay flipped, and are reported."""
        _, seen = untangled
        assert seen
        for result, faces, angles, before, on_boundary in seen:
            for vertex in np.setdiff1d(
                np.unique(faces[touched(before, result.flat)]), np.flatnonzero(on_boundary)
            ):
                sides = result.flat.sides.reshape(-1, 3)[(faces == vertex).any(axis=1)]
                if heights(sides).min() > DEGENERATE_HEIGHT:
                    assert total_angle(result.flat, faces, vertex) == pytest.approx(angles[vertex], abs=1e-6)

    def test_the_residual_is_that_of_the_layout(self, untangled):
        result, _ = untangled
        inner = inside(result)
        np.testing.assert_allclose(
            result.curvature_residual[inner], (angle_sums(result) - 2 * np.pi)[inner], atol=1e-7
        )

    def test_curvature_counts_double_winding(self):
        """Six triangles of 120 degrees at the hub: all upright, 4 pi in all."""
        _, faces = fan(6, 0, "0")
        turn = 2 * np.pi * np.arange(7) / 3
        points = np.append(np.column_stack([np.cos(turn[:6]), np.sin(turn[:6])]), [[0, 0]], axis=0)
        from coneflat.geometry.planar import layout_curvature

        mesh = TriangleMesh(np.column_stack([points, np.zeros(7)]), faces)
        curvature = layout_curvature(mesh, points[faces])
        assert curvature[6] == pytest.approx(-2 * np.pi)
        np.testing.assert_allclose(curvature[:6], np.pi - 2 * np.pi / 6)

    def test_a_triangle_on_a_line_is_neither_upright_nor_inverted(self):
        from coneflat.geometry.planar import layout_curvature

        points = np.array([[0, 0], [1, 0.0], [0.5, 0]])
        mesh = TriangleMesh(np.column_stack([points, np.zeros(3)]), np.array([[0, 1, 2]]))
        for height in (0.0, 1e-14, -1e-14):
            points[2, 1] = height
            np.testing.assert_allclose(
                layout_curvature(mesh, points[mesh.faces]), [np.pi, np.pi, 0], atol=1e-12
            )


class TestFreeSeams:
    @pytest.mark.parametrize(
        "mesh",
        [
            pytest.param(spikes(11, 1.0, "2"), marks=pytest.mark.slow),
            stretched(shapes.torus(30, 12), 60),
            stretched(shapes.sphere(3), 100),
        ],
    )
    def test_triangles_that_need_unequal_seams_are_untangled_with_a_note(self, mesh):
        result = coneflat.flatten(*mesh, charts="one")
        assert result.distortion.flipped == result.distortion.degenerate == 0
        sums = angle_sums(result)[inside(result)]
        exact = abs(sums - 2 * np.pi).max() < 1e-6 and result.distortion.seam_mismatch_max < 1e-6
        said = " ".join(result.notes)
        assert exact != ("they are positively oriented, but" in said)
        assert exact or "of seams differ in length" in said or "angle sum differs from" in said

    @pytest.mark.slow
    def test_seams_of_quarter_turns_stay(self):
        result = coneflat.flatten(*stretched(shapes.torus(30, 12), 60), quantise=np.pi / 2, charts="one")
        assert result.distortion.seam_mismatch_max < 1e-6

    def test_an_embedded_disk_is_upright(self):
        mesh = TriangleMesh(*spikes(9, 1.0, "0"))
        count = len(mesh.faces)
        points = embedded_disks(mesh, np.zeros(count, dtype=int), np.full(count, 1.5 / count))
        assert signed_double_areas(points[mesh.faces]).min() > 0
        assert signed_double_areas(points[mesh.faces]).sum() == pytest.approx(3)

    def test_embedded_disks_may_have_holes(self):
        vertices, faces = spikes(12, 1.0, "0")
        x, y = vertices[faces].mean(axis=1)[:, :2].T
        is_hole = (np.hypot(x - 0.3, y - 0.3) < 0.13) | (np.hypot(x - 0.7, y - 0.6) < 0.2)
        pierced = coneflat.check_mesh(vertices, faces[~is_hole], repair=True).mesh
        mesh = joined_meshes([pierced, TriangleMesh(vertices, faces)])
        disk = np.repeat([0, 1], [len(pierced.faces), len(faces)])
        points = embedded_disks(mesh, disk, np.ones(len(disk)))
        assert signed_double_areas(points[mesh.faces]).min() > 0


def touched(before, after):
    return np.flatnonzero((before.sides != after.sides).reshape(-1, 3).any(axis=1))


def total_angle(flat, faces, vertex):
    sides = flat.sides.reshape(-1, 3)
    angles = np.angle(-sides[:, [1, 2, 0]] / sides[:, [2, 0, 1]])
    return angles[faces == vertex].sum()


RULES = ["free", "lengths", "disk", "straight"]


class TestPrescribed:
    def test_prescribed_corners_keep_their_angles(self):
        """Three corners in a row: much is folded, and the four sides of the sheet lie on three straight lines."""
        points, faces = shapes.grid(9, 7, lambda x, y: np.sin(6.3 * x))
        result = coneflat.flatten(points * [9, 7, 1], faces, boundary=[0, 1, 2])
        assert np.abs(result.curvature_residual[is_upright(result)]).max() < 1e-9

    @pytest.mark.parametrize(
        ("boundary", "cells"),
        [
            ("disk", 16),
            pytest.param("straight", 12, marks=pytest.mark.slow),
            (dict.fromkeys((0, 16, 288, 272), np.pi / 2), 16),
        ],
    )
    def test_a_prescribed_boundary_is_not_moved(self, boundary, cells):
        result = coneflat.flatten(*folded(0.3, cells), boundary=boundary)
        assert result.solve.untangled_triangles
        border = TriangleMesh(result.vertices, result.faces).is_boundary_vertex
        if isinstance(boundary, dict):
            prescribed = np.zeros(len(border))
            prescribed[list(boundary)] = np.pi / 2
            sums = angle_sums(result)
            held = border & is_upright(result)
            np.testing.assert_allclose((np.pi - sums - prescribed)[held], 0, atol=1e-9)
        off = np.abs(result.curvature_residual[border & is_upright(result)]).max()
        assert off < 1e-9 or any("the angle sum differs" in note for note in result.notes)

    @pytest.mark.slow
    def test_lengths_of_the_boundary_are_kept(self):
        result = coneflat.flatten(*folded(0.3), boundary="lengths")
        assert result.solve.untangled_triangles
        mesh = TriangleMesh(result.vertices, result.faces)
        sides = mesh.edge_halfedges[mesh.is_boundary_edge, 0]
        at = result.corner_uv @ [1, 1j] / result.uv_scale
        flat = np.abs(at[:, [2, 0, 1]] - at[:, [1, 2, 0]]).ravel()[sides]
        np.testing.assert_allclose(flat, edge_lengths(mesh.vertices, mesh.faces).ravel()[sides], rtol=1e-9)

    def test_untangling_a_free_boundary_leaves_no_residual(self):
        result = coneflat.flatten(*fan(12, 6, "2"))
        assert result.solve.untangled_vertices
        assert np.abs(result.curvature_residual).max() < 1e-9


class TestMarkedSeams:
    @pytest.mark.parametrize("boundary", RULES)
    @pytest.mark.parametrize("noise", [0.0, 0.1, pytest.param(0.2, marks=pytest.mark.slow)])
    def test_both_sides_are_equal_whatever_the_boundary(self, boundary, noise):
        result = coneflat.flatten(*folded(noise), boundary=boundary, seams=self.seams(), charts="one")
        assert result.distortion.charts == 3
        # The sides of other seams may differ where triangles could not be untangled between them.
        marked = np.isin(self.keys(result.seams), self.keys(self.seams()))
        assert np.count_nonzero(marked) == 32
        np.testing.assert_allclose(result.seam_data.seam_scale[marked], 1, rtol=1e-9)

    @pytest.mark.parametrize("boundary", ["free", pytest.param("lengths", marks=pytest.mark.slow)])
    def test_seams_whose_lengths_cannot_be_equal_are_reported(self, boundary, monkeypatch):
        """Where triangles at a seam are too coarse for the curvature beside it, there is no metric with their sides."""
        monkeypatch.setattr(import_module("coneflat.retries"), "MAX_SEARCHES", 1)  # other cones may help
        monkeypatch.setattr(import_module("coneflat.retries"), "MAX_CORRECTIONS", 0)
        result = coneflat.flatten(*folded(0.3), boundary=boundary, seams=self.seams())
        assert result.distortion.seam_mismatch_max > 0.1
        assert any("could not keep their lengths" in note for note in result.notes)

    def keys(self, edges):
        """Edges as numbers."""
        return np.sort(edges, axis=1) @ [1000, 1]

    def seams(self):
        """A seam across a sheet from border to border, and one that is closed."""
        points, _ = folded(0.0)
        at = np.rint(points[:, :2] * 16).astype(int)
        number = {(i, j): v for v, (i, j) in enumerate(at.tolist())}
        across = [(number[4, j], number[4, j + 1]) for j in range(16)]
        ring = [(8, 4), (12, 4), (12, 8), (8, 8), (8, 4)]
        for (i, j), (last, end) in pairwise(ring):
            di, dj = np.sign(last - i), np.sign(end - j)
            across += [
                (number[i + di * s, j + dj * s], number[i + di * (s + 1), j + dj * (s + 1)]) for s in range(4)
            ]
        return np.array(across)

    @pytest.mark.parametrize("boundary", RULES)
    @pytest.mark.parametrize("rounds", [0, 2])
    def test_a_tetrahedron_of_four_sides(self, boundary, rounds):
        mesh = (
            np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1.0]]),
            np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
        )
        for _ in range(rounds):
            mesh = shapes.subdivide(*mesh)
        result = coneflat.flatten(*mesh, boundary=boundary, sharp_angle=1.0)
        assert result.distortion.charts == 4
        assert result.distortion.seam_mismatch_max < 1e-9

    def test_a_straight_boundary_is_straight_beside_the_seams(self):
        points, faces = shapes.hill(12, 12)
        at = np.rint(points[:, :2] * 12).astype(int)
        number = {(i, j): v for v, (i, j) in enumerate(at.tolist())}
        seam = np.array([(number[6, j], number[6, j + 1]) for j in range(12)])
        result = coneflat.flatten(points, faces, boundary="straight", seams=seam)
        border = TriangleMesh(result.vertices, result.faces).is_boundary_vertex
        border[seam] = False
        turned = np.pi - angle_sums(result)[border]
        assert np.count_nonzero(np.abs(turned) > 1e-9) < 8


def patches_around(centres):
    """Hexagons whose centres are moved, and whose triangles are equilateral on the surface."""
    points, faces = [], []
    for i, centre in enumerate(centres):
        points += [*np.exp(1j * np.pi / 3 * np.arange(6)), centre]
        faces += [(7 * i + k, 7 * i + (k + 1) % 6, 7 * i + 6) for k in range(6)]
    places, faces = np.array(points)[np.array(faces)], np.array(faces)
    sides = places[:, [2, 0, 1]] - places[:, [1, 2, 0]]
    twin = coneflat.geometry.intrinsic.halfedge_twins(TriangleMesh(np.zeros((len(points), 3)), faces))
    flat = FlatTriangles(sides.ravel(), np.ones(sides.size, dtype=complex), twin)
    is_movable = np.arange(len(points)) % 7 == 6
    return Patches(flat, faces, sides, is_movable, rest_sides(np.ones((len(faces), 3))))


class TestPatches:
    def test_a_vertex_without_valid_position_stays_flipped(self):
        """A vertex whose six neighbours are held in an order around it that no place of it makes upright."""
        points = np.exp(1j * np.pi / 3 * np.array([0, 2, 1, 3, 4, 5]))
        points = np.append(points, 0)
        _, faces = fan(6, 0, "0")
        place = points[faces]
        sides = place[:, [2, 0, 1]] - place[:, [1, 2, 0]]
        twin = coneflat.geometry.intrinsic.halfedge_twins(TriangleMesh(np.zeros((7, 3)), faces))
        flat = FlatTriangles(sides.ravel(), np.ones(sides.size, dtype=complex), twin)
        movable = np.arange(7) == 6
        patches = Patches(flat, faces, sides, movable, rest_sides(np.ones((6, 3))))
        assert not (heights(patches.moved(patches.solve())) > 0).all()

    @pytest.mark.parametrize("singular", [0, 1, 2])
    def test_a_singular_patch_ends_alone(self, singular, monkeypatch):
        descend = UNTANGLING.descend

        def refuse_one(points, problem, **options):
            if 2 * singular in problem.elements.unknowns:
                raise coneflat.errors.MetricError("the Hessian is singular")
            return descend(points, problem, **options)

        centres = [1.5, 1.2j, -1.4]
        alone = np.concatenate([patches_around([centre]).solve() for centre in centres])
        assert (heights(patches_around(centres).moved(alone)) > 0).all()
        monkeypatch.setattr(UNTANGLING, "descend", refuse_one)
        shifts = patches_around(centres).solve()
        alone[singular] = 0
        assert np.allclose(shifts, alone, rtol=1e-9)
