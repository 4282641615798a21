"""Many meshes: what fails or hangs stops nothing, what is done is not done again, and a cluster does the same."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import sys
import time
from functools import partial

import pytest
import shapes
from click.testing import CliRunner
from command import command

from coneflat import errors, measure_uv
from coneflat.apps.batch import find_jobs, run_batch
from coneflat.apps.batch.child import ProgressLines
from coneflat.apps.batch.process import Child, Running
from coneflat.apps.cli.main import cli


@pytest.fixture
def models(tmp_path):
    shapes.write_obj(tmp_path / "models" / "ball.obj", *shapes.sphere(2))
    shapes.write_obj(tmp_path / "models" / "hill.obj", *shapes.hill(8, 6))
    (tmp_path / "models" / "broken.obj").write_text("v 0 0 0\nf 1 2 3\n")
    (tmp_path / "models" / "notes.txt").write_text("no mesh")
    return tmp_path / "models"


def rows_of(path):
    with open(path, newline="") as file:
        return {os.path.basename(row["mesh"]): row for row in csv.DictReader(file)}


def invoke(*arguments):
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


@pytest.mark.slow
def test_a_mesh_that_fails_does_not_stop_the_batch(models, tmp_path):
    out = tmp_path / "out"
    result = invoke("batch", models, "--out", out, "--jobs", 2)
    assert result.exit_code == 1
    assert "2 of 3 meshes are flattened; 1 failed" in result.output
    assert f"coneflat: error: 1 of 3 meshes failed, see {out / 'summary.csv'}" in result.output
    rows = rows_of(out / "summary.csv")
    assert {name: row["status"] for name, row in rows.items()} == {
        "ball.obj": "done",
        "hill.obj": "done",
        "broken.obj": "failed",
    }
    assert "vertex" in rows["broken.obj"]["error"]
    assert int(rows["ball.obj"]["cones"]) >= 3
    assert float(rows["ball.obj"]["curvature_error_max"]) < 1e-10
    assert (out / "ball.obj").read_text().count("\nvt ") > 100
    assert not (out / "broken.obj").exists()


@pytest.mark.slow
def test_textures(models, tmp_path):
    result = invoke(
        "batch", models / "ball.obj", "--out", tmp_path, "--max-energy", 4.2, "--require", "energy<=4.2"
    )
    assert result.exit_code == 0, result.output
    assert 4 < measure_uv(tmp_path / "ball.obj").distortion.energy <= 4.2
    refused = invoke("batch", models, "--out", tmp_path, "--max-energy", 4)
    assert refused.exit_code == 1
    assert "above 4" in str(refused.exception)


@pytest.mark.slow
def test_a_further_run_flattens_only_the_missing_meshes(models, tmp_path):
    out = tmp_path / "out"
    run = partial(invoke, "batch", models, "--out", out, "--jobs", 1)
    run()
    before = (out / "ball.obj").stat().st_mtime_ns
    shapes.write_obj(models / "broken.obj", *shapes.torus(12, 8))
    result = run()
    assert result.exit_code == 0
    assert "3 of 3 meshes are flattened, 2 of them before" in result.output
    assert (out / "ball.obj").stat().st_mtime_ns == before
    # Other options, another mesh, a result that is gone: each is a reason to work again.
    assert "of them before" not in run("--distortion", 0.5).output
    shapes.write_obj(models / "ball.obj", *shapes.sphere(1))
    (out / "hill.obj").unlink()
    assert "1 of them before" in run("--distortion", 0.5).output
    assert "of them before" not in run("--distortion", 0.5, "--redo").output
    # So is an incomplete result.
    (out / "hill.obj").write_bytes((out / "hill.obj").read_bytes()[:1000])
    assert "2 of them before" in run("--distortion", 0.5).output


@pytest.mark.slow
def test_a_mesh_that_hangs_is_ended(models, tmp_path):
    jobs = find_jobs([str(models / "ball.obj"), str(models / "hill.obj")], tmp_path, ".npz", {}, None)
    child = Child()
    try:
        hanging = child.flatten(jobs[0], 0.05)
        assert hanging["status"] == "failed"
        assert "longer than 0.05 s" in hanging["error"]
        assert child.flatten(jobs[1], 60)["status"] == "done"
    finally:
        child.end()


def test_progress_is_written_between_the_rows_at_intervals(monkeypatch):
    now, written = [0.0], io.StringIO()
    monkeypatch.setattr("coneflat.apps.batch.child.time.perf_counter", lambda: now[0])
    lines = ProgressLines(written)
    for step in range(20):
        now[0] = step / 10
        lines("search", step / 20)
    told = [json.loads(line) for line in written.getvalue().splitlines()]
    assert [message["fraction"] for message in told] == [0.25, 0.5, 0.75]
    assert {message["stage"] for message in told} == {"search"}


def test_the_progress_of_a_batch_counts_meshes_in_work(models, tmp_path):
    jobs = find_jobs([str(models / "ball.obj"), str(models / "hill.obj")], tmp_path, ".npz", {}, None)
    told = []
    running = Running(4, lambda text, fraction: told.append((text, fraction)))
    running.report(jobs[0], "search", 0.5)
    running.report(jobs[1], "read", 0.2)
    running.end(jobs[0])
    running.report(jobs[1], "pack", 0.6)
    assert [fraction for _, fraction in told] == pytest.approx([0.125, 0.175, 0.4])
    assert told[0][0] == "0 of 4 meshes; ball.obj: search"
    assert told[-1][0] == "1 of 4 meshes; hill.obj: pack"


@pytest.mark.slow
def test_a_batch_moves_before_its_first_mesh_ends(tmp_path):
    mesh = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(5))
    events = []
    run_batch(
        find_jobs([str(mesh)], tmp_path / "out", ".npz", {"max_energy": 4.05}, None),
        tmp_path / "out",
        processes=1,
        listener=lambda row, done, count: events.append(1.0),
        progress=lambda text, fraction: events.append(fraction),
    )
    assert len(events) > 2
    assert events == sorted(events)
    assert len({fraction for fraction in events if 0 < fraction < 1}) > 1
    assert events[-1] == 1.0


def test_progress_does_not_extend_the_time_limit(models, tmp_path, monkeypatch):
    """A process that reports progress for ever."""
    monkeypatch.setattr("coneflat.apps.batch.process.COMMAND", [sys.executable, "-c", ENDLESS])
    (job,) = find_jobs([str(models / "ball.obj")], tmp_path, ".npz", {}, None)
    child, told = Child(), []
    try:
        row = child.flatten(job, 1.5, lambda stage, fraction: told.append(fraction))
    finally:
        child.end()
    assert "longer than 1.5 s" in row["error"]
    assert set(told) == {0.1}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing*.obj", "--out", "out"], "matches no mesh"),
        (["models", "--out", "models"], "would overwrite"),
        (["models", "--out", "out", "--jobs", "0"], "at least one process"),
        (["models", "--out", "out", "--time-limit", "0"], "must be positive"),
        (["models", "--out", "out", "--summary", "table.xls"], "summaries are written as .csv"),
        (["models", "--out", "out", "--distortion", "-1"], "distortion must be a number above 0"),
        (["models", "--out", "out", "--jobs", "2", "--dask", "tcp://localhost:1"], "leave out --jobs"),
        (["models", "--out", "broken", "--cones", "none", "--distortion", "2"], "leave out --distortion"),
    ],
)
def test_refusals(models, monkeypatch, arguments, message):
    monkeypatch.chdir(models.parent)
    result = invoke("batch", *arguments)
    text = result.output if result.exception is None else str(result.exception) + result.output
    assert result.exit_code != 0
    assert message in text


@pytest.mark.slow
def test_a_cluster_does_the_same_even_if_it_loses_a_worker(models, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")
    for i in range(6):
        shapes.write_obj(models / f"ball{i}.obj", *shapes.sphere(2, seed=i))
    local, remote = tmp_path / "here", tmp_path / "there"
    local.mkdir()
    remote.mkdir()
    run_batch(find_jobs([str(models)], local, ".obj", {}, None), local)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        killed = []

        def listener(row, done, count):
            if not killed:
                killed.append(next(iter(cluster.workers.values())).process.pid)
                os.kill(killed[0], signal.SIGKILL)

        summary = run_batch(
            find_jobs([str(models)], remote, ".obj", {}, None),
            remote,
            dask=cluster.scheduler_address,
            limit=60,
            listener=listener,
        )
    assert killed
    assert summary.failed == 1
    local_rows, remote_rows = rows_of(local / "summary.csv"), rows_of(remote / "summary.csv")
    for name in local_rows:
        for column in ("status", "error", "cones", "qc_mean", "seam_length", "curvature_error_max"):
            assert local_rows[name][column] == remote_rows[name][column]
        if local_rows[name]["status"] == "done":
            assert (local / name).read_bytes() == (remote / name).read_bytes()


@pytest.mark.slow
def test_interrupted_batches_keep_what_they_have(models, tmp_path):
    jobs = find_jobs([str(models)], tmp_path, ".obj", {}, None)

    def listener(row, done, count):
        raise KeyboardInterrupt

    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        run_batch(jobs, tmp_path, listener=listener)
    assert time.perf_counter() - start < 60
    assert len(rows_of(tmp_path / "summary.csv")) == 1
    assert len(run_batch(jobs, tmp_path).rows) == 3


def test_interrupted_batches_say_that_they_can_continue(models, tmp_path, monkeypatch):
    def interrupted(jobs, folder, *, listener, **_):
        listener({"mesh": "a.obj", "status": "failed", "error": "none", "seconds": None}, 1, 2)
        raise KeyboardInterrupt

    monkeypatch.setattr("coneflat.apps.batch.run_batch", interrupted)
    for words, expected in (
        ((), "interrupted after 1 mesh: if the same command is run again, it continues with the others"),
        (("--redo",), "with --redo, all are flattened again"),
    ):
        done = command("batch", models, "--out", tmp_path / "out", *words)
        assert done.returncode == 130
        assert expected in done.stderr.splitlines()[-1]


@pytest.mark.slow
def test_a_link_that_leads_nowhere_is_one_failed_mesh(models, tmp_path):
    (models / "dangling.obj").symlink_to("nowhere.obj")
    (models / "loop.obj").symlink_to("loop.obj")
    out = tmp_path / "out"
    result = invoke("batch", models, "--out", out)
    assert result.exit_code == 1
    assert "2 of 5 meshes are flattened; 3 failed" in result.output
    again = invoke("batch", models, "--out", out, "--quiet")
    assert again.exit_code == 1
    assert again.output == f"coneflat: error: 3 of 5 meshes failed, see {out / 'summary.csv'}\n"
    rows = rows_of(out / "summary.csv")
    assert "there is no such file: it is a broken link" in rows["dangling.obj"]["error"]
    assert "symbolic links" in rows["loop.obj"]["error"]


@pytest.mark.slow
def test_broken_lines_of_the_journal_are_left_out_and_named(models, tmp_path):
    out = tmp_path / "out"
    run = partial(invoke, "batch", "--out", out, "--jobs", 1, models / "ball.obj")
    run()
    with (out / "batch.jsonl").open("ab") as file:
        file.write(b'\xff\xfe\x00\n[]\n{"output": []}\n' + b"[" * 100_000 + b'\n{"mesh": "hal')
    result = run(models / "hill.obj")
    assert "Left out 5 broken lines of the journal" in result.output
    assert "2 of 2 meshes are flattened, 1 of them before" in result.output
    # What is written after a line that was cut off is whole.
    assert "2 of them before" in run(models / "hill.obj").output


def test_paths_that_cannot_be_written_are_errors_before_the_work(models, tmp_path):
    jobs = find_jobs([str(models)], tmp_path, ".obj", {}, None)
    (tmp_path / "file").write_text("")
    (tmp_path / "journal" / "batch.jsonl").mkdir(parents=True)

    def listener(row, done, count):
        raise AssertionError("work was done")

    for folder, summary in (
        (tmp_path / "file" / "out", None),
        (tmp_path / "journal", None),
        (tmp_path, tmp_path / "missing" / "summary.csv"),
        (tmp_path, tmp_path / "file" / "summary.csv"),
    ):
        with pytest.raises(errors.MeshFileError, match=r"cannot (be written|create the folder)"):
            run_batch(jobs, folder, summary=summary, listener=listener)


def test_every_result_has_a_name_of_its_own_in_the_folder(tmp_path):
    names = ["a/ball.obj", "a/ball.OBJ", "a/Ball.obj", "b/ball.obj", "ball.ply", "ball_ply.obj", "a_ball.obj"]
    for name in names:
        shapes.write_obj(tmp_path / "models" / name, *shapes.tetrahedron())
    jobs = find_jobs([str(tmp_path / "models" / "**")], tmp_path / "out", ".obj", {}, None)
    results = {job.output.lower() for job in jobs}
    assert len(results) == len({job.mesh for job in jobs})
    assert {os.path.dirname(job.output) for job in jobs} == {str(tmp_path / "out")}


MESSAGE = b'{"level": 20, "message": "coneflat: compiling a kernel"}\n'


@pytest.mark.slow
@pytest.mark.parametrize("printed", [b"", b"no JSON\n", b'{"half": ', MESSAGE])
def test_a_worker_that_crashes_fails_its_mesh_alone_and_leaves_nothing_half_written(
    models, tmp_path, monkeypatch, printed
):
    """The process for ball.obj begins to write, says something, and kills itself."""
    monkeypatch.setattr(
        "coneflat.apps.batch.process.COMMAND", [sys.executable, "-c", CRASHING, printed.decode()]
    )
    jobs = find_jobs([str(models / "ball.obj"), str(models / "hill.obj")], tmp_path, ".obj", {}, None)
    summary = run_batch(jobs, tmp_path, processes=1)
    assert [row["status"] for row in summary.rows] == ["failed", "done"]
    assert "SIGKILL" in summary.rows[0]["error"]
    assert not list(tmp_path.glob(".*.tmp"))
    assert not (tmp_path / "ball.obj").exists()


ENDLESS = """
import json, time
while True:
    print(json.dumps({"stage": "search", "fraction": 0.1}), flush=True)
    time.sleep(0.05)
"""


CRASHING = """
import json, os, signal, sys
from coneflat.apps.batch import child
from coneflat.io import atomic_write
job = json.loads(sys.stdin.readline())
if job["mesh"].endswith("ball.obj"):
    with atomic_write(job["output"]) as file:
        file.write(b"half")
        file.flush()
        os.write(1, sys.argv[1].encode())
        os.kill(os.getpid(), signal.SIGKILL)
os.write(1, (json.dumps(child.flatten_file(job)) + chr(10)).encode())
"""


@pytest.mark.slow
def test_a_search_time_gives_a_result(models, tmp_path):
    """The search ends at once, long before the time limit, after which a mesh fails."""
    result = invoke("batch", models / "ball.obj", "--out", tmp_path / "out", "--jobs", 1, "--search-time", 0)
    assert result.exit_code == 0
    (row,) = rows_of(tmp_path / "out" / "summary.csv").values()
    assert row["status"] == "done"
    assert "The layout alone took" in row["notes"]


@pytest.mark.parametrize(
    ("times", "message"),
    [
        (("--search-time", "-1"), "search_time must be a number, 0 or more, got -1"),
        (("--search-time", "nan"), "search_time must be a number, 0 or more, got nan"),
        (("--search-time", "soon"), "'soon' is not a"),
        (("--search-time", "9", "--time-limit", "8"), "--search-time must be below --time-limit"),
    ],
)
def test_bad_search_times_are_refused(models, tmp_path, times, message):
    done = command("batch", models, "--out", tmp_path / "out", *times)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert message in line
    assert not (tmp_path / "out").exists()
