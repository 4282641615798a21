"""A metric of one's own: lengths on both sides of edges, triangles, and the numbers of the input."""

from __future__ import annotations

import numpy as np
import pytest
import shapes

from coneflat import TriangleMesh, check_mesh, errors
from coneflat.geometry import edge_lengths
from coneflat.geometry.intrinsic import check_lengths
from coneflat.source.input_mesh import at_unit_size, lengths_of_input

TWO = TriangleMesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]), np.array([[0, 1, 2], [1, 3, 2]]))
#: Sides of the two triangles, each opposite its corner; they share the edge 1-2.
SIDES = np.array([[1.5, 1.0, 1.0], [1.0, 1.5, 1.0]])


def changed(face, side, value):
    lengths = SIDES.copy()
    lengths[face, side] = value
    return lengths


class TestChecks:
    def test_lengths_of_a_mesh_pass_as_they_are(self):
        mesh = TriangleMesh(*shapes.torus())
        lengths = edge_lengths(mesh.vertices, mesh.faces)
        for flat in (False, True):
            np.testing.assert_array_equal(check_lengths(mesh, lengths, flat=flat), lengths)

    def test_rounding_differences_are_removed(self):
        """Both sides of an edge get the same bits."""
        checked = check_lengths(TWO, changed(1, 1, 1.5 * (1 + 1e-12)))
        assert checked[0, 0] == checked[1, 1]
        np.testing.assert_allclose(checked, SIDES, rtol=1e-11)

    def test_integers_are_accepted(self):
        assert check_lengths(TWO, np.ones((2, 3), dtype=int)).dtype == np.float64

    @pytest.mark.parametrize(
        ("lengths", "kind", "message"),
        [
            ("long", errors.ArrayShapeError, "lengths must be an array of numbers"),
            ([[1, 2], [1]], errors.ArrayShapeError, "lengths must be an array of numbers"),
            (
                SIDES[:1],
                errors.ArrayShapeError,
                r"the shape \(2, 3\), a number for each side .* got \(1, 3\)",
            ),
            (SIDES.ravel(), errors.ArrayShapeError, r"got \(6,\)"),
            (
                changed(1, 2, np.nan),
                errors.NonFiniteError,
                "1 face of 2 with lengths that are NaN or infinite: 1",
            ),
            (changed(0, 2, np.inf), errors.NonFiniteError, "NaN or infinite: 0"),
            (
                changed(1, 0, -0.5),
                errors.LengthError,
                "1 face of 2 with lengths that are not positive: 1; face 1 has sides of -0.5, 1.5 and 1",
            ),
            (changed(0, 1, 0.0), errors.LengthError, "not positive: 0"),
            (
                changed(1, 1, 1.6),
                errors.LengthError,
                "different lengths on their two sides: 1-2; edge 1-2 is 1.5 long in face 0 and 1.6 in face 1",
            ),
            (
                changed(0, 1, 2.75),
                errors.LengthError,
                "1 face of 2 that break the triangle inequality: 0; face 0 has sides of 1.5, 2.75 and 1",
            ),
            (
                1e90 * SIDES,
                errors.LengthError,
                r"lengths from 1e\+90 to 1.5e\+90 overflow .* scale them",
            ),
            (1e-90 * SIDES, errors.LengthError, "overflow or underflow"),
        ],
    )
    def test_what_is_no_metric_is_refused(self, lengths, kind, message):
        with pytest.raises(kind, match=message) as caught:
            check_lengths(TWO, lengths)
        assert "\n" not in str(caught.value)

    def test_flat_triangles_only_where_they_may_be(self):
        line = changed(0, 1, 2.5)
        with pytest.raises(
            errors.LengthError, match="1 face of 2 without area, which `coneflat.geometry.mollify` opens: 0"
        ):
            check_lengths(TWO, line)
        np.testing.assert_array_equal(check_lengths(TWO, line, flat=True), line)

    @pytest.mark.parametrize("size", [1e-200, 1e200])
    def test_any_size_where_it_is_changed_later(self, size):
        np.testing.assert_array_equal(check_lengths(TWO, size * SIDES, flat=True), size * SIDES)
        with pytest.raises(errors.LengthError, match="triangle inequality"):
            check_lengths(TWO, size * changed(0, 1, 2.75), flat=True)

    def test_too_different_in_size(self):
        with pytest.raises(errors.LengthError, match="lengths from 1e-300 to 1 overflow"):
            check_lengths(TWO, [[1e-300, 1, 1], [1, 1e-300, 1]], flat=True)


def broken_mesh():
    """Faces flipped, given twice, with a vertex twice; vertices without a face; an edge of three faces."""
    vertices, faces = shapes.join(shapes.sphere(1), shapes.hill(4, 3))
    vertices = np.concatenate([[[7.0, 7, 7]], 5 * vertices])
    faces = faces + 1
    faces[3] = faces[3, [0, 2, 1]]
    faces[90] = faces[90, [1, 0, 2]]
    fin = [*faces[10, :2], len(vertices)]
    vertices = np.concatenate([vertices, [[4.0, 4, 4]]])
    return vertices, np.concatenate([faces[:20], [[2, 2, 9]], faces[20:], faces[5:6], [fin]])


class TestInput:
    def test_lengths_are_repaired_with_the_mesh(self):
        """Those that the positions have come out as the repaired mesh's own, to the last bit."""
        vertices, faces = broken_mesh()
        checked = at_unit_size(check_mesh(vertices, faces, repair=True))
        assert len(checked.mesh.faces) < len(faces)
        assert checked.is_flipped.any()
        lengths = edge_lengths(vertices, faces)
        lengths[20] = np.nan  # of a face that is dropped
        repaired_lengths = lengths_of_input(checked, lengths, len(faces))
        np.testing.assert_array_equal(
            repaired_lengths, edge_lengths(checked.mesh.vertices, checked.mesh.faces)
        )

    def test_another_numbering_is_the_same_metric(self):
        vertices, faces = shapes.sphere(2)
        factor = np.random.default_rng(3).uniform(0.9, 1.1, len(vertices))

        def scaled(points, triangles, scale):
            ends = scale[triangles[:, [1, 2, 0]]] * scale[triangles[:, [2, 0, 1]]]
            return edge_lengths(points, triangles) * ends

        renumbered, turned, number = shapes.renumber(vertices, faces)
        moved = np.empty_like(factor)
        moved[number] = factor
        lengths = lengths_of_input(check_mesh(vertices, faces), scaled(vertices, faces, factor), len(faces))
        renumbered_lengths = lengths_of_input(
            check_mesh(renumbered, turned), scaled(renumbered, turned, moved), len(faces)
        )
        np.testing.assert_allclose(np.sort(lengths.ravel()), np.sort(renumbered_lengths.ravel()), rtol=1e-14)

    def test_names_are_those_of_the_input(self):
        vertices, faces = broken_mesh()
        checked = check_mesh(vertices, faces, repair=True)
        lengths = edge_lengths(vertices, faces)
        lengths[30, 0] = -1.0
        with pytest.raises(errors.LengthError, match="not positive: 30; face 30 has sides of -1"):
            lengths_of_input(checked, lengths, len(faces))
        lengths = edge_lengths(vertices, faces)
        a, b = sorted(faces[40, 1:])
        lengths[40, 0] *= 1.01
        with pytest.raises(errors.LengthError, match=f": {a}-{b}; edge {a}-{b} is .* in face (40|.*40$)"):
            lengths_of_input(checked, lengths, len(faces))
        with pytest.raises(errors.ArrayShapeError, match=rf"\({len(faces)}, 3\)"):
            lengths_of_input(checked, lengths[1:], len(faces))
