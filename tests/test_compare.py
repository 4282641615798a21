"""Methods side by side, and the paper's experiments."""

import csv
import io
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import shapes
from click.testing import CliRunner

from coneflat import MeshFile, errors, flatten
from coneflat.apps.cli.main import cli, main
from coneflat.apps.compare import compare_methods, reproduce
from coneflat.apps.compare.paper import METHODS as PAPER_METHODS
from coneflat.apps.compare.peers import PEERS, installed_peers, with_uv
from coneflat.apps.compare.published import MODELS, model_of
from coneflat.apps.compare.table import COLUMNS, comparison_csv, comparison_markdown
from coneflat.flat.methods import other_method
from coneflat.options import METHODS, VARIANTS


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
    held = [reached[name] for name in ("exact", "circle-patterns", "ricci", "linear-abf", "abf++")]
    assert np.ptp(held) < 1e-3, reached
    assert all(1.04 < qc < 1.12 for qc in reached.values()), reached


def test_tables_hold_what_was_measured(compared):
    table = comparison_markdown(compared)
    assert table.count("| ") >= (len(METHODS) + 2) * len(COLUMNS)
    assert "- lscm: " in table
    rows = list(csv.DictReader(io.StringIO(comparison_csv(compared))))
    assert [row["method"] for row in rows] == list(METHODS)
    assert set(COLUMNS) < set(rows[0])
    assert float(rows[0]["QC mean"]) == compared["exact"].result.distortion.qc_mean


def test_a_method_that_fails_is_named_with_its_reason(ball, monkeypatch):
    def fail(name):
        raise errors.ConvergenceError(f"{name} did not converge")

    monkeypatch.setattr("coneflat.flat.methods.other_method", fail)
    found = compare_methods(*ball, methods=("exact", "bff"), peers=())
    assert found["bff"].result is None
    assert found["bff"].note == "bff did not converge"
    assert "bff did not converge" in comparison_markdown(found)
    assert [entry.method for entry in found.drawn] == ["exact"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"methods": ("exact", "magic")}, "unknown method 'magic'"),
        ({"peers": ("magic",)}, "unknown peer 'magic'"),
    ],
)
def test_bad_options(ball, options, message):
    with pytest.raises(errors.OptionError, match=message):
        compare_methods(*ball, **options)


def test_a_peer_that_is_not_installed(ball, monkeypatch):
    monkeypatch.setattr("coneflat.apps.compare.run.installed_peers", tuple)
    with pytest.raises(errors.OptionError, match="xatlas is not installed"):
        compare_methods(*ball, peers=("xatlas",))


@pytest.mark.parametrize("name", PEERS)
def test_peers_are_measured_like_us(ball, name):
    if name not in installed_peers():
        pytest.skip(f"{name} is not installed")
    found = compare_methods(*ball, methods=("exact",), peers=(name,))
    assert found[name].result is not None, found[name].note
    assert found[name].result.distortion.qc_mean < 1.5


def test_libigl_gets_each_chart():
    pytest.importorskip("igl")
    two = shapes.join(shapes.sphere(2), shapes.hill(8, 8))
    found = compare_methods(*two, methods=("lscm",), peers=("libigl LSCM",))
    ours, theirs = (found[name].result.distortion for name in ("lscm", "libigl LSCM"))
    assert theirs.charts == 2
    assert theirs.overlap < 1e-9
    assert theirs.qc_mean == pytest.approx(ours.qc_mean, abs=0.02)


def test_uvs_of_others_are_welded_and_measured(ball):
    ours = flatten(*ball)
    theirs = with_uv(ours, ours.corner_uv * 3 - 1)
    assert len(theirs.uv) == len(ours.uv)
    assert theirs.distortion.qc_mean == pytest.approx(ours.distortion.qc_mean)
    assert {tuple(edge) for edge in np.sort(theirs.seams)} == {tuple(edge) for edge in np.sort(ours.seams)}
    assert theirs.uv.min() == 0
    assert theirs.uv.max() == 1


def test_models_are_known_by_their_names(tmp_path):
    assert model_of(tmp_path / "Rocker-Arm.OBJ") == "rockerarm"
    assert model_of(tmp_path / "isi_horse.ply") == "isi-horse"
    assert model_of(tmp_path / "cow.obj") is None
    assert MODELS["fandisk"].has_as_many(12_946)
    assert not MODELS["hand"].has_as_many(15_982)
    assert MODELS["torso"].qc == {"linear-abf/free": 1.004, "linear": 1.005}


def test_the_experiments_of_the_paper(tmp_path, ball):
    shapes.write_obj(tmp_path / "fandisk.obj", *ball)
    shapes.write_obj(tmp_path / "another.obj", *shapes.hill(12, 12))
    (tmp_path / "gargoyle.obj").write_text("v 0 0 0\n")
    found = reproduce([tmp_path])
    assert [model.name for model in found.models] == ["fandisk", "another"]
    assert found.failed[0][0] == "gargoyle.obj"
    assert "gargoyle" in found.missing
    assert "fandisk" not in found.missing
    first, second = found.table_1()
    assert first[4] / first[5] == pytest.approx(first[6])
    assert np.isnan(second[5])
    rows = [row for row in found.table_2() if row[0] == "fandisk"]
    assert len(rows) == len(PAPER_METHODS)
    assert rows[0][1:4:2] == ["circle-patterns/fixed (CP)", 1.013]
    text = found.markdown()
    assert "Not among the files: rockerarm, foot" in text
    assert "gargoyle.obj" in text
    assert "In another resolution" in text


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
    run = CliRunner().invoke(cli, ["paper", str(mesh), "-o", str(tmp_path / "paper")], catch_exceptions=False)
    assert run.exit_code == 0
    assert "Table 2" in run.output
    written = {path.name for path in (tmp_path / "paper").iterdir()}
    assert written == {"paper.md", "table1.csv", "table2.csv", *(f"figure{k}.png" for k in range(2, 6))}


def test_cones_of_the_paper_and_others(tmp_path, ball):
    mesh = shapes.write_obj(tmp_path / "ball.obj", *ball)
    run = CliRunner().invoke(cli, ["compare", str(mesh), "--paper", "--cone-count", "5"])
    assert run.exit_code == 2
    assert "--paper says which cones: leave out --cone-count" in run.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["compare", "missing.obj", "-o", "out"], "there is no such file"),
        (["compare", "ball.obj", "--methods", "exact,"], "unknown method ''"),
        (["compare", "ball.obj", "--eye", "front"], "pictures need a folder: give -o, or leave out --eye"),
        (["compare", "ball.obj", "-o", "out", "--eye", "nowhere"], "unknown eye 'nowhere'"),
        (["compare", "ball.obj", "-o", "busy"], "it is a folder"),
        (["paper", "missing.obj", "-o", "out"], "'missing.obj' matches no mesh"),
        (["paper", "busy", "-o", "out"], "'busy' matches no mesh"),
        (["paper", "ball.obj", "-o", "out", "--eye", "nowhere"], "unknown eye 'nowhere'"),
        (["paper", "ball.obj", "-o", "busy"], "it is a folder"),
    ],
)
def test_what_cannot_work_is_refused_before_the_work(words, message, tmp_path, ball, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    shapes.write_obj(tmp_path / "ball.obj", *ball)
    for name in ("compare.md", "paper.md"):
        (tmp_path / "busy" / name).mkdir(parents=True)

    def work(*_, **__):
        raise AssertionError("went to work")

    monkeypatch.setattr("coneflat.apps.compare.run.flatten", work)
    monkeypatch.setattr(sys, "argv", ["coneflat", *words])
    error = io.StringIO()
    monkeypatch.setattr(sys, "stderr", error)
    with pytest.raises(SystemExit, match="2"):
        main()
    assert message in error.getvalue()
    assert error.getvalue().count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_nothing_that_came_out_is_an_error(tmp_path):
    pytest.importorskip("matplotlib")
    vertices, faces = shapes.sphere(3)
    mesh = shapes.write_obj(tmp_path / "squashed.obj", vertices * [1, 1, 1e-3], faces)
    words = ["compare", str(mesh), "--methods", "abf++", "--no-peers", "-o", str(tmp_path / "out")]
    with pytest.raises(errors.MetricError, match=r"no method came to a layout: abf\+\+: .* did not converge"):
        CliRunner().invoke(cli, words, catch_exceptions=False)
    (tmp_path / "empty.obj").write_text("")
    with pytest.raises(errors.MeshError, match=r"no mesh could be flattened: empty.obj: "):
        reproduce([tmp_path / "empty.obj"])
    with pytest.raises(errors.OptionError, match="unknown method 'magic'"):
        reproduce([mesh], methods=("magic",))


def test_cones_where_a_repair_split_a_vertex():
    """Spheres that share vertex 3; as three cones are what each needs, its two copies are cones."""
    vertices, faces = shapes.join(shapes.sphere(1), shapes.sphere(2))
    first = len(shapes.sphere(1)[0])
    faces[faces == first + 7] = 3
    found = compare_methods(
        vertices,
        faces,
        methods=("exact", "linear"),
        peers=(),
        repair=True,
        allowed_cones=[3, 5, 9, first + 5, first + 9],
    )
    one, two = (found[name].result for name in ("exact", "linear"))
    assert (one.vertex_origin[one.cones] == 3).sum() == 2
    assert set(one.cones.tolist()) == set(two.cones.tolist())
    assert one.notes[0].startswith("Split 1")
    assert "Split" not in found["linear"].note
    assert "other edges" not in found["linear"].note


def test_a_folder_that_cannot_be_made(tmp_path, ball):
    pytest.importorskip("matplotlib")
    mesh = shapes.write_obj(tmp_path / "ball.obj", *ball)
    with pytest.raises(errors.MeshFileError, match="cannot make the folder"):
        CliRunner().invoke(cli, ["compare", str(mesh), "-o", str(mesh)], catch_exceptions=False)


def test_every_list_of_methods_is_the_same():
    others = [other_method(name) for name in (METHODS + VARIANTS)[2:]]
    assert len({(one.func, str(one.keywords)) if isinstance(one, partial) else one for one in others}) == 10
    with pytest.raises(errors.OptionError, match="unknown method 'magic'"):
        other_method("magic")
    page = (Path(__file__).parents[1] / "docs" / "methods.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in page for name in METHODS + VARIANTS)


def test_names_of_files_are_kept(tmp_path, ball):
    from coneflat import read_mesh

    source = read_mesh(shapes.write_obj(tmp_path / "ball.obj", *ball))
    assert isinstance(source, MeshFile)
    assert compare_methods(source, methods=("exact",), peers=()).name.endswith("ball.obj")


@pytest.mark.parametrize(("method", "accuracy"), [("circle-patterns", 1e-7), ("ricci", 1e-8)])
def test_scale_motion_and_numbering(method, accuracy):
    vertices, faces = shapes.sphere(3)
    other_vertices, other_faces, new = shapes.renumber(vertices, faces)
    base = flatten(vertices, faces, cones="greedy", method=method)
    for mesh in (
        (vertices * 1e-6, faces),
        (vertices * 1e6, faces),
        (vertices @ shapes.rotation().T, faces),
        (other_vertices, other_faces),
    ):
        other = flatten(*mesh, cones="greedy", method=method)
        assert other.distortion.qc_mean == pytest.approx(base.distortion.qc_mean, rel=1e-7)
        assert other.distortion.qc_max == pytest.approx(base.distortion.qc_max, rel=1e-6)
    np.testing.assert_array_equal(other.cones, new[base.cones])
    np.testing.assert_allclose(other.log_scale[new], base.log_scale, atol=accuracy)
