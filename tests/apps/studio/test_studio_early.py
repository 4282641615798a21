"""The studio's first views of layouts, and what the process that flattens keeps."""

from __future__ import annotations

import os
import sys
import threading
import time
from contextlib import ExitStack

import numpy as np
import pytest
import shapes

import coneflat
from coneflat.apps.studio.child import PLACEHOLDER, JobRunner, Jobs, serve
from coneflat.apps.studio.choices import Choices
from coneflat.apps.studio.layouts import MAX_LAYOUTS
from coneflat.apps.studio.session import Session
from coneflat.apps.studio.worker import SentPictures, read_frame, with_hashes, write_frame
from coneflat.apps.view.page.payload import pack
from coneflat.base.progress import check_cancelled
from coneflat.errors import StudioError


class Mute:
    """A process that is given jobs, and says nothing by itself."""

    is_alive = True

    def __init__(self):
        self.jobs = []

    def send(self, job):
        self.jobs.append(job)

    def end(self):
        pass


class TestFirstViews:
    """The first view of a layout, which comes before it."""

    @pytest.fixture
    def session(self, tmp_path):
        session = Session(tmp_path)
        session._worker = Mute()
        session.open(shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(1)))
        return session

    @staticmethod
    def answer(session, kind, job, name):
        told = {"head": {"title": name, "arrays": []}, "found": [job], "seconds": {"metric": 1.0}}
        session._on_message({"job": job, kind: told}, name.encode())

    def shown(self, session):
        return (
            session.picture()[0]["title"],
            session.state()["early"],
            bool(session.state()["busy"]),
            session.state()["layout"],
        )

    def test_previews_are_shown_and_replaced(self, session):
        job = session._worker.jobs[-1]["job"]
        self.answer(session, "early", job, "first")
        assert self.shown(session) == ("first", True, True, 1)
        assert session.state()["found"] == [job]
        self.answer(session, "done", job, "last")
        assert self.shown(session) == ("last", False, False, 2)

    def test_previews_of_older_jobs_are_dropped(self, session):
        old = session._worker.jobs[-1]["job"]
        session.act({"do": "set", "name": "stretch", "value": 0.5})
        newest = session._worker.jobs[-1]["job"]
        self.answer(session, "early", old, "old")
        assert session.picture() is None
        self.answer(session, "early", newest, "new")
        self.answer(session, "early", old, "old")
        self.answer(session, "done", old, "old")
        assert self.shown(session) == ("new", True, True, 1)
        self.answer(session, "done", newest, "newest")
        self.answer(session, "early", old, "old")
        assert self.shown(session) == ("newest", False, False, 2)


@pytest.mark.slow
def test_a_first_view_comes_before_the_layout_and_has_no_numbers(tmp_path):
    path = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(3))
    events = []
    bench = JobRunner(early_from=1000)
    job = {"mesh": str(path), "sha256": "", "choices": Choices().as_plain()}
    for choices in (Choices(), Choices().with_option("stretch", 0.5)):
        job["choices"] = choices.as_plain()
        events.clear()
        head, _ = bench.flatten(
            job,
            lambda stage, fraction: events.append((stage, fraction)),
            lambda head, body: events.append(("shown", head, body)),
        )
        names = [event[0] for event in events]
        assert names.count("shown") == 1
        assert names.index("shown") < names.index("atlas")
        fractions = [event[1] for event in events if event[0] != "shown"]
        assert fractions == sorted(fractions)
        _, first, early_body = events[names.index("shown")]
        assert {value for _, value, _ in first["head"]["rows"]} == {PLACEHOLDER}
        assert PLACEHOLDER not in {value for _, value, _ in head["head"]["rows"]}
        assert first["found"] == head["found"]
        assert len(early_body)
        result = coneflat.flatten(path, **choices.keywords())
        np.testing.assert_array_equal(bench.result.uv, result.uv)
    small = JobRunner(early_from=2000)
    events.clear()
    small.flatten(job, lambda *_: None, lambda *preview: events.append(preview))
    assert not events


class TestKnownArrays:
    """Arrays that the page has already."""

    @staticmethod
    def picture(**arrays):
        listed, block = pack({name: np.array(values) for name, values in arrays.items()})
        return with_hashes({"arrays": listed}, block), block

    @staticmethod
    def arrays_of(picture, received=None):
        """What a page makes of a picture, with those of another one."""
        head, block = picture
        arrays = {}
        for entry in head["arrays"]:
            kind = np.dtype(entry["type"])
            begin = entry["offset"]
            arrays[entry["name"]] = (
                received[entry["name"]]
                if begin is None
                else np.frombuffer(block, kind, entry["count"], begin).tolist()
            )
        return arrays

    def test_only_arrays_that_changed_are_sent(self):
        sent = SentPictures()
        first = sent.numbered(self.picture(places=[1.0, 2.0], tints=np.uint8([1, 2, 3]), uv=[0.5]))
        second = sent.numbered(self.picture(places=[1.0, 2.0], tints=np.uint8([1, 2, 4]), uv=[0.5]))
        complete = sent.without(0, second)
        less = sent.without(first[0]["number"], second)
        assert [entry["offset"] is None for entry in less[0]["arrays"]] == [True, False, True]
        assert len(less[1]) < len(complete[1])
        assert self.arrays_of(less, self.arrays_of(first)) == self.arrays_of(complete)
        assert self.arrays_of(complete) == {"places": [1.0, 2.0], "tints": [1, 2, 4], "uv": [0.5]}


@pytest.mark.slow
def test_a_change_cancels_the_separation_of_overlaps(tmp_path, monkeypatch):
    """The preview comes before the separation, which may take long, and the next change does not wait for it."""
    path = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(5))
    module, begun = sys.modules["coneflat.flattening"], threading.Event()
    separate = module.separate_overlaps

    def endless(*arguments):
        if begun.is_set():
            return separate(*arguments)
        begun.set()
        while True:
            check_cancelled()
            time.sleep(0.01)

    monkeypatch.setattr(module, "separate_overlaps", endless)
    (jobs_out, jobs_in), (answers_out, answers_in) = os.pipe(), os.pipe()
    with ExitStack() as stack:
        asking, answers, hearing = (
            stack.enter_context(os.fdopen(end, mode))
            for end, mode in ((jobs_in, "wb"), (answers_in, "wb"), (answers_out, "rb"))
        )
        thread = threading.Thread(target=serve, args=(Jobs(os.fdopen(jobs_out, "rb")), answers), daemon=True)
        thread.start()
        job = {"do": "flatten", "mesh": str(path), "sha256": "", "choices": Choices().as_plain()}
        write_frame(asking, {**job, "job": 1})
        heard = []
        while not (heard and "early" in heard[-1]):
            heard.append(read_frame(hearing)[0])
        assert begun.wait(60)
        write_frame(asking, {**job, "job": 2})
        while not (heard[-1]["job"] == 2 and "done" in heard[-1]):
            heard.append(read_frame(hearing)[0])
    assert {"job": 1, "given_up": "superseded"} in heard
    assert not any(message["job"] == 1 and "done" in message for message in heard)


class TestModelAlone:
    """The model, which is shown before its first layout is computed."""

    def test_the_model_comes_before_its_first_layout_alone(self, tmp_path):
        path = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(2))
        told, stages = [], []
        runner = JobRunner()
        job = {"mesh": str(path), "sha256": "", "choices": Choices().as_plain()}
        for is_first in (True, False):
            runner.flatten(
                {**job, "first": is_first},
                lambda stage, _: stages.append(stage),
                lambda head, body: None,
                lambda kind, head, body: told.append((kind, head, list(stages))),
            )
        assert [kind for kind, *_ in told] == ["model", "shape"]
        _, model, before = told[0]
        assert model["head"]["title"] == "Computing the first layout"
        assert (model["head"]["show"], model["head"]["triangles"], model["found"]) == ("plain", 320, [])
        assert set(before) == {"read", "check"}

    def test_it_is_shown_until_the_layout_comes(self, tmp_path):
        session = Session(tmp_path)
        session._worker = Mute()
        session.open(shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(1)))
        (job,) = session._worker.jobs
        assert (job["first"], job["bare"]) == (True, True)
        TestFirstViews.answer(session, "model", job["job"], "alone")
        state = session.state()
        assert (state["bare"], bool(state["busy"]), state["stale"]) == (True, True, False)
        # No cones are known, so that none of them can be placed by hand.
        with pytest.raises(StudioError, match="the cones are not found yet"):
            session.act({"do": "add", "vertex": 3})
        TestFirstViews.answer(session, "done", job["job"], "layout")
        assert (session.state()["bare"], session.picture()[0]["title"]) == (False, "layout")
        session.act({"do": "add", "vertex": 3})
        assert session._worker.jobs[-1]["first"] is False


class TestLatestLayouts:
    """Layouts that are shown again when steps are undone."""

    @pytest.fixture
    def calls(self, monkeypatch):
        """The options of all maps that are computed, in turn."""
        computed, flatten = [], coneflat.Flattener.flatten

        def counted(flattener, **options):
            computed.append(options)
            return flatten(flattener, **options)

        monkeypatch.setattr(coneflat.Flattener, "flatten", counted)
        return computed

    @staticmethod
    def flatten(runner, path, chosen):
        job = {"mesh": str(path), "sha256": path.name, "choices": chosen.as_plain()}
        head, body = runner.flatten(job, lambda *_: None, lambda *_: None)
        return head["head"]["title"], head["found"], body, runner.result.uv.tobytes()

    def test_undone_steps_compute_nothing(self, tmp_path, calls):
        path = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(1))
        runner = JobRunner()
        chosen = [Choices().with_option("stretch", step / 20) for step in range(MAX_LAYOUTS)]
        layouts = [self.flatten(runner, path, choices) for choices in chosen]
        assert len(calls) == MAX_LAYOUTS
        assert [self.flatten(runner, path, choices) for choices in reversed(chosen)] == layouts[::-1]
        self.flatten(runner, path, chosen[0].with_units("mm", "cm"))
        assert len(calls) == MAX_LAYOUTS
        # The one that was asked for longest ago is dropped.
        self.flatten(runner, path, Choices().with_option("stretch", 0.9))
        self.flatten(runner, path, chosen[0])
        assert len(calls) == MAX_LAYOUTS + 1
        assert self.flatten(runner, path, chosen[-1]) == layouts[-1]
        assert len(calls) == MAX_LAYOUTS + 2

    def test_layouts_of_another_mesh_are_not_taken(self, tmp_path, calls):
        runner = JobRunner()
        paths = [shapes.write_obj(tmp_path / f"{level}.obj", *shapes.sphere(level)) for level in (1, 2)]
        first, second = (self.flatten(runner, path, Choices()) for path in paths)
        assert first != second
        assert self.flatten(runner, paths[0], Choices()) == first
        assert len(calls) == 3

    def test_large_layouts_are_fewer(self, tmp_path, calls, monkeypatch):
        monkeypatch.setattr("coneflat.apps.studio.layouts.MAX_TRIANGLES", 200)
        path = shapes.write_obj(tmp_path / "ball.obj", *shapes.sphere(1))  # 80 triangles
        runner, chosen = JobRunner(), [Choices().with_option("stretch", step / 20) for step in range(3)]
        for choices in (*chosen, chosen[1], chosen[0]):
            self.flatten(runner, path, choices)
        assert len(calls) == 4
