"""Unmet guarantees of every public function: one warning for a call, with the numbers, at the caller's line."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
import threading
import warnings

import numpy as np
import pytest
import shapes
from command import command

import coneflat
import coneflat.xatlas
from coneflat import GuaranteeWarning
from coneflat.apps.batch import find_jobs, run_batch
from coneflat.apps.studio.session import Session
from coneflat.base import Unmet

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
SHEET = shapes.grid(6, 5)
#: A square has no inner vertex, so that a cone is impossible.
NO_CONES = "0 cones instead of the 5 asked for"
FLAT_FACES = np.array([[0, 1, 2], [0, 2, 2], [1, 1, 1]])


def rings(count=24, factor=0.3):
    """A disk whose triangles, all of one shape, become too small for 32-bit numbers at its centre."""
    vertices, faces = shapes.grid(12, count, wrap=(True, False))
    radius, angle = factor ** (count * vertices[:, 1]), 2 * np.pi * vertices[:, 0]
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    return vertices, faces


def generated(vertices, faces):
    atlas = coneflat.xatlas.Atlas()
    atlas.add_mesh(vertices, faces)
    return atlas


#: Calls with an unmet guarantee, and what the warning says; then the same without.
CALLS = {
    "flatten": (lambda: coneflat.flatten(*SQUARE, cone_count=5), NO_CONES, lambda: coneflat.flatten(*SQUARE)),
    "Flattener": (
        lambda: coneflat.Flattener(*SQUARE).flatten(cone_count=5),
        NO_CONES,
        lambda: coneflat.Flattener(*SQUARE).flatten(),
    ),
    "unwrap": (
        lambda: coneflat.unwrap(*shapes.tetrahedron(), charts=9),
        "4 charts instead of 9",
        lambda: coneflat.unwrap(*shapes.tetrahedron()),
    ),
    "find_cones": (
        lambda: coneflat.find_cones(*SQUARE, cone_count=5),
        NO_CONES,
        lambda: coneflat.find_cones(*SQUARE),
    ),
    "integer_grid": (
        lambda: coneflat.integer_grid(*SHEET, quads=7),
        "9 squares, not 7",
        lambda: coneflat.integer_grid(*SHEET, quads=9),
    ),
    "quads": (
        lambda: coneflat.quads(*SHEET, quads=7),
        "9 squares, not 7",
        lambda: coneflat.quads(*SHEET, quads=9),
    ),
    "xatlas.parametrize": (
        lambda: coneflat.xatlas.parametrize(SQUARE[0], FLAT_FACES),
        "2 faces without area",
        lambda: coneflat.xatlas.parametrize(*SQUARE),
    ),
    "xatlas.Atlas": (
        lambda: generated(SQUARE[0], FLAT_FACES).generate(),
        "2 faces without area",
        lambda: generated(*SQUARE).generate(),
    ),
    "as_written": (
        lambda: RINGS.as_written(".glb"),
        "degenerate triangles",
        lambda: RINGS.as_written(".npz"),
    ),
}
RINGS = coneflat.flatten(*rings())
UNMET = pytest.mark.parametrize(("call", "text"), [case[:2] for case in CALLS.values()], ids=CALLS)


@UNMET
def test_an_unmet_guarantee_is_one_warning_at_the_callers_line(call, text):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    (warning,) = (record for record in caught if record.category is GuaranteeWarning)
    assert text in str(warning.message)
    assert text in " ".join(warning.message.notes)
    lines, start = inspect.getsourcelines(call)
    assert warning.filename == __file__
    assert start <= warning.lineno < start + len(lines)


@pytest.mark.parametrize("call", [case[2] for case in CALLS.values()], ids=CALLS)
def test_without_one_there_is_no_warning(call):
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        call()


@UNMET
def test_as_an_error_it_reaches_the_caller_and_no_thread_remains(call, text):
    before = threading.active_count()
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        with pytest.raises(GuaranteeWarning, match=text):
            call()
    assert threading.active_count() == before


def test_ignored_it_is_silent():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", GuaranteeWarning)
        coneflat.flatten(*SQUARE, cone_count=5)
    assert caught == []


def test_repairs_are_no_warnings():
    vertices, faces = SQUARE
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        result = coneflat.flatten(vertices, np.concatenate([faces, faces]), repair=True)
    assert any("Put 2 faces on the same three vertices" in note for note in result.notes)
    assert not any(isinstance(note, Unmet) for note in result.notes)


def test_saving_warns_of_what_the_format_breaks(tmp_path):
    with pytest.warns(GuaranteeWarning, match="degenerate triangles") as caught:
        RINGS.save(tmp_path / "disk.glb")
    assert len(caught) == 1
    assert caught[0].filename == __file__
    assert (tmp_path / "disk.glb").exists()
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        RINGS.save(tmp_path / "disk.npz")


def test_a_grid_that_is_given_has_been_warned_of():
    with pytest.warns(GuaranteeWarning, match="9 squares, not 7"):
        grid = coneflat.integer_grid(*SHEET, quads=7)
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        assert coneflat.quads(grid).notes == grid.notes


def test_the_accessor_of_pyvista():
    pyvista = pytest.importorskip("pyvista", minversion="0.48")
    mesh = pyvista.PolyData.from_regular_faces(*SQUARE)
    with pytest.warns(GuaranteeWarning, match=NO_CONES) as caught:
        mesh.coneflat.flatten(cone_count=5)
    assert [record.filename for record in caught] == [__file__]


def test_flat_maps_of_brains(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    from coneflat.apps.brains import flatten_cortex

    nibabel.freesurfer.write_geometry(tmp_path / "lh.pial", *SQUARE)
    with pytest.warns(GuaranteeWarning, match=NO_CONES) as caught:
        flat = flatten_cortex(tmp_path / "lh.pial", cone_count=5)
    assert [record.filename for record in caught] == [__file__]
    assert any(NO_CONES in note for note in flat.result.notes)


def test_transfer_between_different_models(tmp_path):
    pytest.importorskip("PIL.Image")
    from coneflat.apps.transfer import transfer

    vertices, faces = SQUARE
    result = coneflat.flatten(vertices, faces)
    result.save(tmp_path / "old.glb", texture="checker")
    coneflat.flatten(vertices * [1.0, 1.5, 1], faces).save(tmp_path / "new.glb")
    with pytest.warns(GuaranteeWarning, match=r"up to \d+\.\d% of the size") as caught:
        transfer(tmp_path / "old.glb", tmp_path / "new.glb", resolution=32)
    assert [record.filename for record in caught] == [__file__]
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        transfer(tmp_path / "old.glb", tmp_path / "old.glb", resolution=32)


@pytest.fixture
def square_file(tmp_path):
    shapes.write_obj(tmp_path / "square.obj", *SQUARE)
    return tmp_path / "square.obj"


@pytest.mark.parametrize(
    "words",
    [
        ("flatten", "square.obj", "-o", "out.obj", "--cone-count", 5),
        ("cones", "square.obj", "--cone-count", 5),
    ],
    ids=lambda words: words[0],
)
def test_the_command_prints_the_note_once_and_no_warning(words, square_file):
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        done = command(*words, cwd=square_file.parent)
    assert done.returncode == 0
    assert (done.stdout + done.stderr).count(NO_CONES) == 1
    assert f"note: {NO_CONES}" in done.stdout
    assert "Warning" not in done.stdout + done.stderr


def test_the_command_as_a_process(square_file):
    words = [sys.executable, "-m", "coneflat", "flatten", square_file, "-o", "out.obj", "--cone-count", "5"]
    environment = {**os.environ, "PYTHONWARNINGS": "error::UserWarning"}
    done = subprocess.run(words, capture_output=True, text=True, cwd=square_file.parent, env=environment)
    assert (done.returncode, done.stdout.count(NO_CONES)) == (0, 1)
    assert "Warning" not in done.stdout + done.stderr


def test_workers_of_a_batch_report_notes_only(square_file, monkeypatch):
    monkeypatch.setenv("PYTHONWARNINGS", "error::UserWarning")
    out = square_file.parent / "out"
    jobs = find_jobs([str(square_file)], out, ".obj", {"cone_count": 5}, None)
    (row,) = run_batch(jobs, out, processes=1).rows
    assert (row["status"], NO_CONES in row["notes"]) == ("done", True)


def test_the_studio_shows_notes_only(square_file, monkeypatch):
    monkeypatch.setenv("PYTHONWARNINGS", "error::UserWarning")
    session = Session(square_file.parent)
    try:
        session.open(square_file)
        session.act({"do": "set", "name": "cone_count", "value": 5})
        assert session.wait_until_idle(120)
        assert session.state()["trouble"] is None
        assert any(NO_CONES in note for note in session.picture()[0]["notes"])
    finally:
        session.close()
