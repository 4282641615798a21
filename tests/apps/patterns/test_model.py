from __future__ import annotations

import numpy as np
import pytest
from shapes import cylinder, grid, sphere, torus

import coneflat
from coneflat.apps.patterns.units import percentage
from coneflat.errors import MeshError, OptionError

FLAT = grid(4, 3)


@pytest.mark.parametrize("turns", [0, 1, 2])
def test_the_height_of_a_flat_model_is_along_an_axis_in_which_it_extends(turns):
    vertices, faces = FLAT
    result = coneflat.pattern(np.roll(vertices, turns, axis=1), faces, height=100.0)
    extents = np.ptp(result.surface.mesh.vertices, axis=0)
    assert np.isclose(extents, 100).any()
    assert sorted(extents / extents.max()) == pytest.approx(
        sorted(np.ptp(vertices, axis=0) / np.ptp(vertices, axis=0).max())
    )


def test_no_height_along_an_axis_that_is_given_is_an_error_that_names_it():
    with pytest.raises(OptionError, match="along the axis 0,0,1 is 0: give another axis"):
        coneflat.pattern(*FLAT, height=100.0, axis=(0, 0, 1))


@pytest.mark.parametrize(
    ("mesh", "axis"), [(torus(), (0, 0, 1)), (cylinder(), (0, 1, 0)), (torus(), (0, 3, 4))]
)
def test_gores_that_are_no_strips_name_the_axis(mesh, axis):
    text = ",".join(f"{number:.3g}" for number in np.array(axis) / np.linalg.norm(axis))
    with pytest.raises(MeshError, match=f"around the axis, here {text}, .* give another axis"):
        coneflat.pattern(*mesh, kind="gores", height=100.0, axis=axis)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seam_allowances": "A=5mm,A=7mm"}, "gives the seam A two widths, 5 and 7 mm"),
        ({"seam_allowances": "A=5m"}, "up to 500 mm"),
        ({"allowance": "5000mm"}, "at most 500 mm"),
        ({"kind": "gores", "gores": 900}, "from 2 to 200"),
    ],
)
def test_options_beyond_reason_are_errors(options, message):
    with pytest.raises(OptionError, match=message):
        coneflat.pattern(*FLAT, height=100.0, **options)


def test_the_same_width_twice_is_that_width():
    result = coneflat.pattern(
        *cylinder(12, 2), kind="gores", gores=3, axis=(0, 0, 1), height=100.0, seam_allowances="A=5mm,A=0.5cm"
    )
    assert result.settings["seam_allowances"] == "A=5mm,A=0.5cm"


def test_strain_of_gores_that_materials_do_not_have_is_noted():
    result = coneflat.pattern(*sphere(2), kind="gores", gores=4, axis=(0, 1, 1), height=100.0)
    strain = np.abs(result.strains).max()
    assert strain > 0.05
    assert any(f"change by up to {percentage(strain)}:" in note for note in result.notes)


@pytest.mark.parametrize(
    ("strain", "text"),
    [
        (2.4, "240 %"),
        (5e-16, "0 %"),
        (0.237, "24 %"),
        (0.0294, "2.9 %"),
        (0.00055, "0.055 %"),
        (12.3, "1,230 %"),
    ],
)
def test_percentages_have_no_exponents(strain, text):
    assert percentage(strain) == text


def with_flat_triangle_at_the_border():
    """A grid of 4 x 3 units, with a triangle without area on a border edge that reaches 10 units high."""
    vertices, faces = FLAT
    edge = coneflat.check_mesh(vertices, faces).mesh
    tail, head = edge.edges[edge.is_boundary_edge & (vertices[edge.edges][:, :, 1] == 0).all(axis=1)][0]
    along = vertices[head] - vertices[tail]
    tip = vertices[head] + 5 * along
    return np.vstack([vertices, tip]), np.vstack([faces, [head, tail, len(vertices)]])


@pytest.mark.parametrize("kind", ["cloth", "sheet", "net"])
def test_triangles_without_area_at_the_border_do_not_count(kind):
    result = coneflat.pattern(*with_flat_triangle_at_the_border(), kind=kind, height=100.0, axis=(1, 0, 0))
    plain = coneflat.pattern(*FLAT, kind=kind, height=100.0, axis=(1, 0, 0))
    assert "Left out 1 triangle without area at the border." in result.notes
    extents = [np.ptp(pattern.surface.mesh.vertices, axis=0) for pattern in (result, plain)]
    assert extents[0] == pytest.approx(extents[1])


def test_a_seam_along_a_triangle_without_area_continues_along_its_short_sides():
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 0.0]])
    faces = [[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]]
    result = coneflat.pattern(corners, faces, unit="mm", seams=[[0, 2]])
    cut = result.surface.mesh.edges[result.surface.seams].tolist()
    assert sorted(cut) == [[0, 4], [2, 4]]
    assert result.piece_count == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"height": 10**400}, "height must be a length"),
        ({"strain": 10**400}, "strain must be from 0.01 % to 100 %"),
        ({"strain": 1e-12}, "strain must be from 0.01 % to 100 %"),
    ],
)
def test_numbers_beyond_reason_are_errors(options, message):
    with pytest.raises(OptionError, match=message):
        coneflat.pattern(*sphere(1), **{"unit": "mm", **options} if "height" not in options else options)


def test_allowances_of_single_seams_exclude_tabs():
    with pytest.raises(OptionError, match="seam_allowances and tabs of a net cannot be combined"):
        coneflat.pattern(*sphere(1), kind="net", unit="mm", seam_allowances="A=5mm")
