"""The search for seams within a time: valid results at any time, and the same ones if there is enough."""

from __future__ import annotations

from collections import Counter
from itertools import count

import numpy as np
import pytest
import shapes
from test_minor import crumbs

from coneflat import sample_path, unwrap
from coneflat.atlas import tight_packing
from coneflat.base import cancel_with
from coneflat.base.search_time import SearchTime
from coneflat.errors import OptionError
from coneflat.options import read_options
from coneflat.textures import UnwrapOptions, Unwrapper, cut_search, work
from coneflat.textures.candidates import CutModel
from coneflat.textures.work import TIME_FOR_PACKING

ENDED = ("The search for seams was ended", "The layout alone took")


def time_notes(result) -> list[str]:
    return [note for note in result.notes if note.startswith(ENDED)]


@pytest.fixture
def reads(monkeypatch):
    """The number of times that the clock was read; it advances by a second each time."""
    numbers = count()
    read = []

    def clock() -> float:
        read.append(next(numbers))
        return float(read[-1])

    monkeypatch.setattr(SearchTime, "clock", staticmethod(clock))
    return read


@pytest.fixture
def laid_out(monkeypatch):
    """The components of the candidates that were laid out, in order."""
    components = []
    original = CutModel.candidate
    monkeypatch.setattr(
        CutModel,
        "candidate",
        lambda model, *arguments: components.append(model.component) or original(model, *arguments),
    )
    return components


def check_note(result, taken, seconds) -> None:
    """Check that a note says that the time was up if it was; a part of it is reserved for packing."""
    notes = time_notes(result)
    assert len(notes) <= 1
    if taken >= seconds:
        assert notes
    if taken < (1 - TIME_FOR_PACKING) * seconds:
        assert not notes


def bracelet():
    """Return a surface with two handles, whose search has every stage."""
    return shapes.genus(2)


@pytest.mark.parametrize("seconds", [0, 10, 40, 100, 250])
@pytest.mark.parametrize("options", [{}, {"charts": 5}, {"packing_cuts": 1.0}, {"seams": "none"}])
def test_results_are_valid_whenever_the_time_is_up(reads, seconds, options):
    result = unwrap(*bracelet(), search_time=seconds, **options)
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)
    check_note(result, reads[-1], seconds)


@pytest.mark.parametrize("seconds", [0, 20, 50, 100, 200])
def test_results_of_large_components_are_valid_whenever_the_time_is_up(reads, monkeypatch, seconds):
    """Their cones are searched for on a coarse mesh."""
    monkeypatch.setattr("coneflat.source.coarse.COARSE", 300)
    result = unwrap(*shapes.sphere(4), search_time=seconds)
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)
    check_note(result, reads[-1], seconds)


def test_after_the_time_hardly_any_work_is_left(reads):
    """Each piece of optional work is refused once; none is begun."""
    refused = []
    for seconds in (10, 50, 100, 200):
        reads.clear()
        unwrap(*bracelet(), search_time=seconds)
        refused.append(sum(read - reads[0] >= seconds for read in reads))
    assert max(refused) <= 60


def test_without_time_each_component_is_laid_out_once(reads, laid_out):
    two = shapes.join(shapes.sphere(3), shapes.genus(2))
    (note, *_) = time_notes(unwrap(*two, search_time=0))
    assert len(laid_out) == 2
    assert note.startswith("The layout alone took")
    assert "more than the 0 s" in note


def test_without_time_small_components_are_laid_out_together(reads, monkeypatch):
    monkeypatch.setattr(work, "MINOR_SHARE", 1.0)
    monkeypatch.setattr(cut_search, "best_cut", lambda _: pytest.fail("a component is searched alone"))
    result = unwrap(*crumbs([shapes.sphere(2), shapes.torus()], 6), search_time=0)
    assert (result.distortion.flipped, result.distortion.overlapping_pairs) == (0, 0)
    assert time_notes(result)


def test_components_share_the_time(reads, laid_out):
    """Of two equal components, the second is searched as long as the first."""
    first, second = shapes.genus(2), shapes.genus(2)
    stretched = (np.asarray(second[0]) * [1, 1, 1.1] + 100, second[1])
    unwrap(*shapes.join(first, stretched), search_time=200)
    numbers = Counter(map(id, laid_out))
    assert len(numbers) == 2
    assert min(numbers.values()) > 1


@pytest.mark.parametrize("shape", [shapes.sphere(3), shapes.genus(2), crumbs([shapes.box()], 3)])
def test_results_with_enough_time_are_those_without_a_limit(shape):
    free, limited = unwrap(*shape), unwrap(*shape, search_time=1e6)
    np.testing.assert_array_equal(free.uv, limited.uv)
    np.testing.assert_array_equal(free.uv_faces, limited.uv_faces)
    assert free.notes == limited.notes


def test_flat_components_need_no_time():
    flat = shapes.grid(6)
    np.testing.assert_array_equal(unwrap(*flat, search_time=0).uv, unwrap(*flat).uv)


def test_an_ended_search_is_noted_again_when_packed_again():
    unwrapper = Unwrapper(*bracelet())
    for padding in (1, 3):
        assert len(time_notes(unwrapper.unwrap(search_time=0, padding=padding))) == 1
    assert time_notes(unwrapper.unwrap(padding=3)) == []


def test_the_packer_ends_early_once_the_time_is_up(reads, monkeypatch):
    monkeypatch.setattr(tight_packing, "MAX_LATE_WORK", 0)
    tries = []
    original = tight_packing.changed_plan
    monkeypatch.setattr(
        tight_packing, "changed_plan", lambda *arguments: tries.append(1) or original(*arguments)
    )
    parts = crumbs([shapes.box()], 8)
    unwrap(*parts)
    assert len(tries) > 20
    tries.clear()
    unwrap(*parts, search_time=0)
    assert len(tries) <= 1


@pytest.mark.parametrize("value", [-1, float("nan"), "soon", "", [1], True])
def test_bad_times_are_refused(value):
    with pytest.raises(OptionError, match="search_time must be a number"):
        read_options({"search_time": value}, UnwrapOptions)


@pytest.mark.parametrize("value", [None, "none", 0, 2, 2.5, float("inf")])
def test_good_times_are_accepted(value):
    read_options({"search_time": value}, UnwrapOptions)


class Cancelled(Exception):
    pass


def test_progress_moves_within_the_search_and_never_backwards():
    told = []
    unwrap(sample_path(), progress=lambda stage, fraction: told.append((stage, fraction)))
    fractions = [fraction for _, fraction in told]
    assert fractions == sorted(fractions)
    assert fractions[-1] <= 1
    within = {fraction for stage, fraction in told if stage.startswith("search")}
    assert len(within) > 4
    details = " ".join(stage for stage, _ in told)
    for detail in ("candidate 1", "candidate 2", "cuts for packing", "moving the ends of seams"):
        assert detail in details


@pytest.mark.slow
@pytest.mark.parametrize(("how", "step"), [("told", 2), ("asked", 25)])
def test_cancelling_anywhere_changes_no_later_result(how, step):
    shape, calls = shapes.genus(2), count()
    with cancel_with(lambda: next(calls)):
        expected = unwrap(*shape)
    unwrapper, stops = Unwrapper(*shape), 0
    for stop in range(1, next(calls), step):
        calls_before = count(1)

        def interrupt(*_, calls=calls_before, stop=stop):
            if next(calls) == stop:
                raise Cancelled

        listener = {"progress": interrupt} if how == "told" else {}
        try:
            with cancel_with(interrupt if how == "asked" else lambda: None):
                unwrapper.unwrap(**listener)
        except Cancelled:
            stops += 1
        else:
            break  # Fewer calls than stops: progress is reported less often than cancelling is possible.
        np.testing.assert_array_equal(unwrapper.unwrap().uv, expected.uv)
        unwrapper = Unwrapper(*shape)
    assert stops > 5


def test_a_search_that_was_complete_is_not_said_to_be_ended_later(reads):
    """The time may be up while charts are packed; later packings of the same cuts are told nothing of it."""
    unwrapper, limit = Unwrapper(*bracelet()), None
    for seconds in range(20, 2000, 20):
        reads.clear()
        searched = Unwrapper(*bracelet())
        first = searched.unwrap(search_time=seconds, packing_cuts=1.0)
        complete = searched._searched._entry[1].ended is None
        if time_notes(first) and complete:
            unwrapper, limit = searched, seconds
            break
    assert limit is not None
    assert not time_notes(unwrapper.unwrap(search_time=limit, packing_cuts=0))


def test_texel_density_is_reached_whenever_the_time_is_up(reads):
    for seconds in (0, 50, 100, 150, 200):
        result = unwrap(*bracelet(), search_time=seconds, texel_density=50.0)
        assert result.uv_scale * result.settings["resolution"] >= 50
