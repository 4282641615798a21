"""No measure that is reported is NaN without a note."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.measures import MAP_MEASURES
from coneflat.measures.distortion import measure_map
from coneflat.measures.guarantees import unmet_guarantees

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0]]), np.array([[0, 1, 2], [1, 3, 2]])


def named(notes):
    """Return the measures that a note names as undefined."""
    (note,) = [note for note in notes if note.startswith("Measures that are not defined: ")] or [": ;"]
    return set(note.partition(": ")[2].partition(";")[0].split(", ")) - {""}


@pytest.mark.parametrize("collapsed", ["nothing", "model", "plane"])
def test_measured_uvs_without_area_have_a_note(collapsed):
    vertices, faces = SQUARE
    uv = vertices[faces][:, :, :2]
    if collapsed == "model":
        vertices = vertices * [1, 0, 0]
    elif collapsed == "plane":
        uv = uv * [1, 0]
    measures = coneflat.measure_uv(vertices, faces, uv)
    unknown = {name for name, value in measures.values().items() if not np.isfinite(value)}
    assert named(measures.notes) == unknown
    assert bool(unknown) == (collapsed != "nothing")


def test_a_flattening_without_area_has_a_note():
    result = coneflat.flatten(*SQUARE)
    assert not named(unmet_guarantees(result))
    flat = coneflat.check_mesh(SQUARE[0] * [1, 0, 0], SQUARE[1]).mesh
    collapsed = replace(result, vertices=flat.vertices, distortion=measure_map(flat, result.corner_uv))
    unknown = {name for name in MAP_MEASURES if not np.isfinite(getattr(collapsed.distortion, name))}
    assert {"qc_mean", "energy", "density_spread"} < unknown
    assert named(unmet_guarantees(collapsed)) == unknown


def test_a_file_of_coarse_numbers_says_so_when_it_is_measured():
    vertices, faces = shapes.hill(12, 12)
    uv = vertices[faces][:, :, :2]
    vertices = (3 * vertices * [1, 1, 0] + [4e6, 5e6, 0]).astype("f4").astype(float)
    notes = coneflat.measure_uv(vertices, faces, uv).notes
    assert any("because its coordinates are rounded to steps of 0.5" in note for note in notes)
