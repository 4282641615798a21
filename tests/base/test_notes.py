"""The warning of unmet guarantees: one for a call, at the caller's line, by every public function."""

from __future__ import annotations

import pickle
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from coneflat import GuaranteeWarning
from coneflat.base import Unmet, inner_calls, warn_of, warns
from coneflat.base.notes import MAX_QUOTED


def result_with(*notes):
    return SimpleNamespace(notes=notes)


@warns()
def inner(*notes):
    return result_with(*notes)


@warns("map.notes")
def outer(*notes):
    inner(Unmet("An inner note."))
    return result_with(*notes)


def caught(call, *args):
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        call(*args)
    return warned


def test_information_does_not_warn():
    assert caught(inner, "Dropped 2 faces.") == []
    assert caught(inner) == []


def test_a_call_warns_once_and_inner_calls_do_not():
    (warning,) = caught(outer, Unmet("One is unmet."), "Dropped 2 faces.", Unmet("Two are unmet."))
    assert warning.category is GuaranteeWarning
    assert str(warning.message) == "One is unmet. Two are unmet. (see map.notes)"
    assert warning.message.notes == ("One is unmet.", "Two are unmet.")
    assert {type(note) for note in warning.message.notes} == {str}
    assert caught(outer, "Dropped 2 faces.") == []


def test_further_notes_are_counted():
    notes = [Unmet(f"Note {i}.") for i in range(MAX_QUOTED + 2)]
    (warning,) = caught(inner, *notes)
    quoted = " ".join(notes[:MAX_QUOTED])
    assert str(warning.message) == f"{quoted} (2 more unmet guarantees; all are in result.notes)"
    (warning,) = caught(inner, *notes[: MAX_QUOTED + 1])
    assert str(warning.message).endswith("(1 more unmet guarantee; all are in result.notes)")


def test_the_warning_is_at_the_callers_line():
    def explicit():
        warn_of([Unmet("One is unmet.")], "result.notes")

    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        outer(Unmet("One is unmet."))
        explicit()
    lines = open(__file__, encoding="utf-8").read().splitlines()  # noqa: SIM115
    assert [lines[warning.lineno - 1].strip() for warning in warned] == [
        'outer(Unmet("One is unmet."))',
        "explicit()",
    ]
    assert {warning.filename for warning in warned} == {__file__}


def test_notes_that_an_argument_has_are_not_repeated():
    grid = result_with(Unmet("One is unmet."), "Dropped 2 faces.")

    @warns()
    def extracted(grid):
        return result_with(*grid.notes, Unmet("Two are unmet."))

    for warned in (caught(extracted, grid), caught(lambda: extracted(grid=grid))):
        assert [warning.message.notes for warning in warned] == [("Two are unmet.",)]


def test_as_an_error_it_leaves_the_state_clean():
    with warnings.catch_warnings():
        warnings.simplefilter("error", GuaranteeWarning)
        for _ in range(2):
            with pytest.raises(GuaranteeWarning, match="One is unmet"):
                outer(Unmet("One is unmet."))
    assert len(caught(inner, Unmet("One is unmet."))) == 1


def test_errors_leave_the_state_clean():
    @warns()
    def fails():
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        fails()
    assert len(caught(inner, Unmet("One is unmet."))) == 1


def test_threads_do_not_silence_each_other():
    """While one thread is inside a call, another warns."""
    is_inside, may_end = threading.Event(), threading.Event()

    def stay():
        with inner_calls():
            is_inside.set()
            may_end.wait(60)

    with ThreadPoolExecutor(1) as pool:
        pool.submit(stay)
        is_inside.wait(60)
        try:
            assert len(caught(inner, Unmet("One is unmet."))) == 1
        finally:
            may_end.set()


def test_notes_are_strings_and_the_warning_survives_pickling():
    note = Unmet("One is unmet.")
    assert note == "One is unmet."
    assert repr((note,)) == "('One is unmet.',)"
    assert isinstance(pickle.loads(pickle.dumps(note)), Unmet)
    again = pickle.loads(pickle.dumps(GuaranteeWarning("text", ("one",))))
    assert (str(again), again.notes) == ("text", ("one",))
