"""Methods side by side, and their pictures."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
import shapes
from click.testing import CliRunner
from command import command

import coneflat
from coneflat import errors, flatten
from coneflat.apps.cli.main import cli
from coneflat.apps.peers import METHODS, compare_methods, flatten_by
from coneflat.apps.peers.methods import PEERS as METHODS_OF_OTHERS
from coneflat.apps.peers.packages import PEERS, Peer, installed_peers, run_peer
from coneflat.apps.peers.pictures import aligned_layouts, draw_layouts, draw_qualities
from coneflat.apps.peers.run import (
    COLUMNS,
    Comparison,
    Entry,
    comparison_csv,
    comparison_markdown,
    numbers,
)
from coneflat.apps.view import Look


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(3)


@pytest.fixture(scope="module")
def compared(ball):
    return compare_methods(*ball, peers=())


def test_every_method_has_the_same_cones_and_cut(compared):
    assert [entry.method for entry in compared.entries] == list(METHODS)
    first = compared["exact"].result
    for entry in compared.entries:
        assert entry.result is not None, entry.note
        assert np.array_equal(entry.result.cones, first.cones)
        assert np.array_equal(entry.result.seams, first.seams)
        assert "other edges" not in entry.note
        assert entry.seconds > 0


def test_conformal_methods_agree(compared):
    reached = {entry.method: entry.result.distortion.qc_mean for entry in compared.entries}
    assert abs(reached["exact"] - reached["linear"]) < 0.01, reached
    assert all(1.04 < qc < 1.12 for qc in reached.values()), reached


def test_tables_hold_what_was_measured(compared):
    table = comparison_markdown(compared)
    assert table.count("| ") >= (len(METHODS) + 2) * len(COLUMNS)
    assert "- lscm: " in table
    assert "| bff (reimplemented here) |" in table
    assert "| exact |" in table
    rows = list(csv.DictReader(io.StringIO(comparison_csv(compared))))
    assert [row["method"] for row in rows] == list(METHODS)
    assert set(COLUMNS) < set(rows[0])
    assert float(rows[0]["QC mean"]) == compared["exact"].result.distortion.qc_mean


def test_a_method_that_fails_is_named_with_its_reason(ball, monkeypatch):
    def fail(*_):
        raise errors.ConvergenceError("bff did not converge")

    monkeypatch.setitem(METHODS_OF_OTHERS, "bff", fail)
    found = compare_methods(*ball, methods=("exact", "bff"), peers=())
    assert found["bff"].result is None
    assert found["bff"].note == "bff did not converge"
    assert "bff did not converge" in comparison_markdown(found)
    assert [method for method, _ in found.drawn] == ["exact"]


@pytest.mark.parametrize("name", PEERS)
def test_peers_are_measured_like_us(ball, name):
    if name not in installed_peers():
        pytest.skip(f"{name} is not installed")
    found = compare_methods(*ball, methods=("exact",), peers=(name,))
    assert found[name].result is not None, found[name].note
    assert found[name].result.distortion.qc_mean < 1.5


@pytest.mark.slow
def test_the_map_for_textures_is_a_row_with_its_energy(ball):
    found = compare_methods(*ball, methods=("exact",), peers=("unwrap",))
    expected = coneflat.unwrap(*ball).distortion
    energy, charts = (list(COLUMNS).index(name) for name in ("energy", "charts"))
    row = numbers(found["unwrap"])
    assert row[energy] == pytest.approx(expected.energy, rel=1e-9)
    assert row[energy] <= 4.1 < numbers(found["exact"])[energy]
    assert row[charts] == expected.charts
    assert "unwrap: short seams with free sides" in comparison_markdown(found)


def test_uvs_of_others_are_welded_and_measured(ball, monkeypatch):
    ours = flatten(*ball)
    monkeypatch.setitem(PEERS, "larger", Peer("numpy", lambda base: base.corner_uv * 3 - 1, ""))
    theirs, _ = run_peer("larger", ours)
    assert len(theirs.uv) == len(ours.uv)
    assert theirs.distortion.qc_mean == pytest.approx(ours.distortion.qc_mean)
    assert {tuple(edge) for edge in np.sort(theirs.seams)} == {tuple(edge) for edge in np.sort(ours.seams)}
    assert len(theirs.cones) == 0


@pytest.mark.slow
def test_commands(tmp_path, ball):
    pytest.importorskip("matplotlib")
    mesh = shapes.write_obj(tmp_path / "ball.obj", *ball)
    run = CliRunner().invoke(
        cli,
        ["compare", str(mesh), "-o", str(tmp_path / "out"), "--methods", "exact,linear", "--no-peers"],
        catch_exceptions=False,
    )
    assert run.exit_code == 0
    assert "exact" in run.output
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"compare.md", "compare.csv", "layouts.png", "quality.png"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["compare", "missing.obj", "-o", "out"], "there is no such file"),
        (["compare", "ball.obj", "--methods", "exact,"], "unknown method ''"),
        (
            ["compare", "ball.obj", "--eye", "front"],
            "--eye has no effect without -o: add -o",
        ),
        (["compare", "ball.obj", "-o", "out", "--eye", "nowhere"], "unknown eye 'nowhere'"),
        (["compare", "ball.obj", "-o", "busy"], "it is a folder"),
    ],
)
def test_what_cannot_work_is_refused_before_the_work(words, message, tmp_path, ball, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    shapes.write_obj(tmp_path / "ball.obj", *ball)
    for name in ("compare.md",):
        (tmp_path / "busy" / name).mkdir(parents=True)

    def work(*_, **__):
        raise AssertionError("went to work")

    monkeypatch.setattr("coneflat.apps.peers.run.flatten_by", work)
    done = command(*words)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_scale_motion_and_numbering():
    vertices, faces = shapes.sphere(3)
    other_vertices, other_faces, new = shapes.renumber(vertices, faces)
    base = flatten_by("bff", vertices, faces, cones="greedy")
    for mesh in (
        (vertices * 1e-6, faces),
        (vertices * 1e6, faces),
        (vertices @ shapes.rotation().T, faces),
        (other_vertices, other_faces),
    ):
        other = flatten_by("bff", *mesh, cones="greedy")
        assert other.distortion.qc_mean == pytest.approx(base.distortion.qc_mean, rel=1e-7)
        assert other.distortion.qc_max == pytest.approx(base.distortion.qc_max, rel=1e-6)
    np.testing.assert_array_equal(other.cones, new[base.cones])
    np.testing.assert_allclose(other.log_scale[new], base.log_scale, atol=1e-6)


LONG = "a method with a long name"


@pytest.fixture(scope="module")
def hill():
    return coneflat.flatten(*shapes.hill(10, 8), cones="none")


def rotated(result, angle, factor=1.0, shift=0.0):
    turn = factor * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return replace(result, uv=result.uv @ turn + shift)


@pytest.mark.parametrize("angle", [0.3, np.pi / 2, -2.9])
def test_layouts_are_turned_back_to_lie_as_the_first(hill, angle):
    others = [rotated(hill, angle), rotated(hill, angle, 0.4, 3.0)]
    first, second, third = aligned_layouts([hill, *others])
    assert first is hill
    sides = [np.diff(each.uv[each.uv_faces], axis=1) for each in (first, second, third)]
    np.testing.assert_allclose(sides[1], sides[0], atol=1e-12)
    np.testing.assert_allclose(sides[2], 0.4 * sides[0], atol=1e-12)


def test_layouts_of_other_charts_stay(hill):
    other = coneflat.flatten(*shapes.box(3), sharp_angle=1.0)
    assert aligned_layouts([hill, other])[1] is other


@pytest.mark.slow
@pytest.mark.parametrize("stretch", [1.0, 8.0])
def test_no_text_runs_into_another_or_over_the_edge(stretch):
    pytest.importorskip("matplotlib")
    vertices, faces = shapes.sphere(1)
    result = coneflat.flatten(vertices * [1, stretch, 1], faces)
    entries = tuple(Entry(LONG, result, 1.0) for _ in range(7))
    comparison = Comparison(entries)
    for figure in (draw_layouts(comparison), draw_qualities(comparison, Look())):
        width, height = figure.get_size_inches() * figure.dpi
        boxes = [text.get_window_extent() for text in figure.texts]
        labels = [text.get_window_extent() for text in figure.texts if text.get_text().startswith(LONG)]
        assert len(labels) == 7
        for box in boxes:
            assert box.x0 >= 0
            assert box.x1 <= width + 1
            assert 0 <= box.y0 <= box.y1 <= height + 1
        for k, one in enumerate(labels):
            for other in labels[k + 1 :]:
                assert not one.overlaps(other)
        assert min(text.get_fontsize() for text in figure.texts) > 5
