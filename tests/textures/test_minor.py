"""Cuts of many small components: the same promises as for large ones, in less time."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import shapes

from coneflat import unwrap
from coneflat.geometry import double_areas, edge_lengths, triangle_energies
from coneflat.mesh import label_faces
from coneflat.textures import cut_search, work

KINDS = {
    "icosphere": shapes.sphere(2),
    "box": shapes.box(),
    "tetrahedron": shapes.tetrahedron(),
    "torus": shapes.torus(),
    "two handles": shapes.genus(2),
    "hill": shapes.hill(),
    "annulus": shapes.annulus(),
    "cylinder": shapes.cylinder(),
    "triangle": (np.eye(3), np.array([[0, 1, 2]])),
}


def crumbs(kinds, count: int, seed: int = 0):
    """Return many components of different proportions, none a copy of another."""
    random = np.random.default_rng(seed)
    parts = []
    for i in range(count):
        vertices, faces = kinds[i % len(kinds)]
        stretched = np.asarray(vertices, dtype=float) * random.uniform(0.3, 1, 3)
        parts.append((stretched + random.uniform(-100, 100, 3), faces))
    return shapes.join(*parts)


@pytest.fixture
def every_part_is_minor(monkeypatch):
    monkeypatch.setattr(work, "MINOR_SHARE", 1.0)
    monkeypatch.setattr(cut_search, "best_cut", lambda _: pytest.fail("a component is searched alone"))


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_promises_hold_for_every_kind_of_component(name, every_part_is_minor):
    vertices, faces = crumbs([KINDS[name]], 6)
    result = unwrap(vertices, faces)
    d = result.distortion
    assert (d.flipped, d.degenerate, d.overlapping_pairs, result.notes) == (0, 0, 0, ())
    component = label_faces(result.faces, len(result.vertices))[1]
    for i in range(6):
        is_inside = component == i
        energy = triangle_energies(
            edge_lengths(vertices, faces[is_inside]), result.corner_uv[is_inside] / result.uv_scale
        )
        area = double_areas(edge_lengths(vertices, faces[is_inside])).sum() / 2
        assert energy.sum() < 4.1 * (1 + 1e-3) * area  # at the scale that all components share
    assert d.energy < 4.1


@pytest.mark.slow
def test_seams_are_as_short_as_when_components_are_cut_alone(monkeypatch):
    vertices, faces = crumbs([KINDS["icosphere"], KINDS["hill"]], 12)

    def length():
        ends = vertices[unwrap(vertices, faces).seams]
        return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()

    alone = length()
    monkeypatch.setattr(work, "MINOR_SHARE", 1.0)
    assert length() < 1.15 * alone


def test_sizes_that_differ_by_a_million_change_nothing(every_part_is_minor):
    first, second = (crumbs([KINDS["icosphere"]], 2, seed) for seed in (0, 1))
    seams = len(unwrap(*shapes.join(first, second), charts="one").seams)
    assert len(unwrap(*shapes.join(first, (1e-6 * second[0], second[1])), charts="one").seams) == seams


def test_a_needle_whose_tips_are_neighbours_gives_no_warning(every_part_is_minor):
    vertices = np.array([[0.0, 0, 0], [5, 0, 0], [2.5, 0.1, 0], [2.5, 0, 0.1]])
    needle = vertices, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = unwrap(*shapes.join(needle, KINDS["hill"]))
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)


@pytest.mark.slow
def test_a_large_bound_needs_fewer_cones(every_part_is_minor):
    parts = crumbs([KINDS["icosphere"]], 3)
    assert len(unwrap(*parts, max_energy=50).cones) < len(unwrap(*parts).cones)


@pytest.mark.slow
def test_the_numbering_of_components_changes_nothing(every_part_is_minor):
    vertices, faces = crumbs(list(KINDS.values()), 9)
    component = label_faces(faces, len(vertices))[1]
    order = np.random.default_rng(3).permutation(component.max() + 1)
    shuffled = np.concatenate([np.flatnonzero(component == i) for i in order])
    result, renumbered = unwrap(vertices, faces), unwrap(vertices, faces[shuffled])
    assert len(result.seams) == len(renumbered.seams)
    assert result.distortion.energy == pytest.approx(renumbered.distortion.energy, rel=1e-6)
    assert set(map(tuple, np.sort(result.seams))) == set(map(tuple, np.sort(renumbered.seams)))


@pytest.mark.slow
def test_a_component_that_would_overlap_itself_is_separated(every_part_is_minor):
    # A long spiral strip, of which the relaxed layout overlaps itself in one chart.
    turns = np.linspace(0, 6 * np.pi, 300)
    inner = np.column_stack([np.cos(turns), np.sin(turns), 0.02 * turns])
    rows = np.concatenate([inner, 1.5 * inner * [1, 1, 2 / 3]])
    a = np.arange(299)
    strip = np.concatenate([np.column_stack([a, a + 300, a + 1]), np.column_stack([a + 1, a + 300, a + 301])])
    result = unwrap(*crumbs([(rows, strip)], 2))
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)
    assert result.distortion.charts > 2
