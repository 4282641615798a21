"""Methods side by side, and their pictures."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
import shapes
from compare import main
from comparisons import COMPARED_METHODS, Comparison, Entry, compare_methods, flatten_by
from comparisons.atlases import ATLAS_BASELINES, AtlasBaseline, installed_baselines, run_baseline
from comparisons.methods import CONE_BASELINES
from comparisons.pictures import aligned_layouts, draw_layouts, draw_qualities
from comparisons.tables import COLUMNS, comparison_csv, comparison_markdown, numbers

import coneflat
from coneflat import errors, flatten
from coneflat.apps.view import Look


@pytest.fixture(scope="module")
def ball():
    return shapes.sphere(3)


@pytest.fixture(scope="module")
def compared(ball):
    return compare_methods(*ball, atlases=())


def test_every_method_has_the_same_cones_and_cut(compared):
    assert [entry.method for entry in compared.entries] == list(COMPARED_METHODS)
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
    assert table.count("| ") >= (len(COMPARED_METHODS) + 2) * len(COLUMNS)
    assert "- lscm: " in table
    assert "| bff (reimplemented here) |" in table
    assert "| exact |" in table
    rows = list(csv.DictReader(io.StringIO(comparison_csv(compared))))
    assert [row["method"] for row in rows] == list(COMPARED_METHODS)
    assert set(COLUMNS) < set(rows[0])
    assert float(rows[0]["QC mean"]) == compared["exact"].result.distortion.qc_mean


def test_a_method_that_fails_is_named_with_its_reason(ball, monkeypatch):
    def fail(*_):
        raise errors.ConvergenceError("bff did not converge")

    monkeypatch.setitem(CONE_BASELINES, "bff", fail)
    comparison = compare_methods(*ball, methods=("exact", "bff"), atlases=())
    assert comparison["bff"].result is None
    assert comparison["bff"].note == "bff did not converge"
    assert "bff did not converge" in comparison_markdown(comparison)
    assert [method for method, _ in comparison.drawn] == ["exact"]


@pytest.mark.parametrize("name", ATLAS_BASELINES)
def test_baselines_are_measured_as_our_results(ball, name):
    if name not in installed_baselines():
        pytest.skip(f"{name} is not installed")
    comparison = compare_methods(*ball, methods=("exact",), atlases=(name,))
    assert comparison[name].result is not None, comparison[name].note
    assert comparison[name].result.distortion.qc_mean < 1.5


@pytest.mark.slow
def test_the_map_for_textures_is_a_row_with_its_energy(ball):
    comparison = compare_methods(*ball, methods=("exact",), atlases=("unwrap",))
    expected = coneflat.unwrap(*ball).distortion
    energy, charts = (list(COLUMNS).index(name) for name in ("energy", "charts"))
    row = numbers(comparison["unwrap"])
    assert row[energy] == pytest.approx(expected.energy, rel=1e-9)
    assert row[energy] <= 4.1 < numbers(comparison["exact"])[energy]
    assert row[charts] == expected.charts
    assert "unwrap: short seams with free sides" in comparison_markdown(comparison)


def test_uvs_of_others_are_welded_and_measured(ball, monkeypatch):
    ours = flatten(*ball)
    monkeypatch.setitem(
        ATLAS_BASELINES, "larger", AtlasBaseline("numpy", lambda base: base.corner_uv * 3 - 1, "")
    )
    theirs, _ = run_baseline("larger", ours)
    assert len(theirs.uv) == len(ours.uv)
    assert theirs.distortion.qc_mean == pytest.approx(ours.distortion.qc_mean)
    assert {tuple(edge) for edge in np.sort(theirs.seams)} == {tuple(edge) for edge in np.sort(ours.seams)}
    assert len(theirs.cones) == 0


def run_script(monkeypatch, *words):
    """Run `compare.py` in this process and return its exit code; 0 if it does not exit."""
    monkeypatch.setattr("sys.argv", ["compare.py", *map(str, words)])
    try:
        main()
    except SystemExit as stopped:
        return stopped.code
    return 0


@pytest.mark.slow
def test_the_script_prints_and_writes_tables_and_pictures(tmp_path, ball, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    mesh = shapes.write_obj(tmp_path / "ball.obj", *ball)
    words = (
        mesh,
        "-o",
        tmp_path / "out",
        "--methods",
        "exact,linear",
        "--no-atlases",
        "--options",
        "max_cones=8",
    )
    assert run_script(monkeypatch, *words) == 0
    assert "exact" in capsys.readouterr().out
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"compare.md", "compare.csv", "layouts.png", "quality.png"}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["missing.obj", "-o", "out"], "there is no such file"),
        (["ball.obj", "--methods", "exact,"], "unknown method ''"),
        (["ball.obj", "-o", "out", "--eye", "nowhere"], "unknown eye 'nowhere'"),
        (["ball.obj", "-o", "busy"], "it is a folder"),
    ],
)
def test_the_script_refuses_invalid_arguments_before_the_work(
    words, message, tmp_path, ball, monkeypatch, capsys
):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    shapes.write_obj(tmp_path / "ball.obj", *ball)
    (tmp_path / "busy" / "compare.md").mkdir(parents=True)

    def work(*_, **__):
        raise AssertionError("went to work")

    monkeypatch.setattr("comparisons.methods.flatten_source", work)
    assert run_script(monkeypatch, *words) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert printed.err.count("\n") == 1


def test_the_script_names_unknown_options(tmp_path, ball, monkeypatch, capsys):
    mesh = shapes.write_obj(tmp_path / "ball.obj", *ball)
    assert run_script(monkeypatch, mesh, "--options", "max_cone=3") == 2
    assert "unknown option max_cone" in capsys.readouterr().err


def test_scale_motion_and_numbering():
    vertices, faces = shapes.sphere(3)
    renumbered_vertices, renumbered_faces, numbers = shapes.renumber(vertices, faces)
    base = flatten_by("bff", vertices, faces, cones="greedy")
    for mesh in (
        (vertices * 1e-6, faces),
        (vertices * 1e6, faces),
        (vertices @ shapes.rotation().T, faces),
        (renumbered_vertices, renumbered_faces),
    ):
        result = flatten_by("bff", *mesh, cones="greedy")
        assert result.distortion.qc_mean == pytest.approx(base.distortion.qc_mean, rel=1e-7)
        assert result.distortion.qc_max == pytest.approx(base.distortion.qc_max, rel=1e-6)
    np.testing.assert_array_equal(result.cones, numbers[base.cones])
    np.testing.assert_allclose(result.log_scale[numbers], base.log_scale, atol=1e-6)


LONG = "a method with a long name"


@pytest.fixture(scope="module")
def hill():
    return coneflat.flatten(*shapes.hill(10, 8), cones="none")


def rotated(result, angle, factor=1.0, shift=0.0):
    turn = factor * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return replace(result, uv=result.uv @ turn + shift)


@pytest.mark.parametrize("angle", [0.3, np.pi / 2, -2.9])
def test_layouts_are_turned_back_to_lie_as_the_first(hill, angle):
    turned = [rotated(hill, angle), rotated(hill, angle, 0.4, 3.0)]
    first, second, third = aligned_layouts([hill, *turned])
    assert first is hill
    sides = [np.diff(layout.uv[layout.uv_faces], axis=1) for layout in (first, second, third)]
    np.testing.assert_allclose(sides[1], sides[0], atol=1e-12)
    np.testing.assert_allclose(sides[2], 0.4 * sides[0], atol=1e-12)


def test_layouts_of_other_charts_stay(hill):
    box = coneflat.flatten(*shapes.box(3), sharp_angle=1.0)
    assert aligned_layouts([hill, box])[1] is box


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
        for k, label in enumerate(labels):
            for next_label in labels[k + 1 :]:
                assert not label.overlaps(next_label)
        assert min(text.get_fontsize() for text in figure.texts) > 5
