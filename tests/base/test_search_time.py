"""The time of a search: optional work ends when it is up, other work never does."""

from __future__ import annotations

from itertools import count

import pytest

from coneflat.base import (
    check_cancelled,
    current_time,
    each_within_time,
    is_time_up,
    portion_of_time,
    search_time,
    within_time,
)
from coneflat.base.search_time import SearchTime


@pytest.fixture
def ticking(monkeypatch):
    """A clock that advances by a second whenever it is read."""
    reads = count()
    monkeypatch.setattr(SearchTime, "clock", staticmethod(lambda: float(next(reads))))


@pytest.fixture
def now(monkeypatch):
    """A list with the time that the clock shows."""
    times = [0.0]
    monkeypatch.setattr(SearchTime, "clock", staticmethod(lambda: times[0]))
    return times


def steps(number: int) -> int:
    for _ in range(number):
        check_cancelled()
    return number


@pytest.mark.parametrize("seconds", [0, 1, 5, 20])
def test_optional_work_ends_when_the_time_is_up(ticking, seconds):
    with search_time(seconds) as limit:
        assert within_time(lambda: steps(100)) is None
        assert limit.is_ended
        assert seconds <= limit.ended_after <= seconds + 1
        assert limit.attempts == 0


def test_work_that_is_complete_in_time_is_returned_and_counted(ticking):
    with search_time(50) as limit:
        assert list(each_within_time(steps, [3, 4, 100, 5])) == [3, 4, None, None]
        assert limit.attempts == 2


def test_other_work_is_never_ended(ticking):
    with search_time(0):
        assert steps(100) == 100
        assert is_time_up()


def test_without_a_limit_the_clock_is_not_read(monkeypatch):
    with search_time(None) as limit:
        monkeypatch.setattr(SearchTime, "clock", staticmethod(lambda: pytest.fail("the clock was read")))
        with portion_of_time(0.0):
            assert within_time(lambda: steps(100)) == 100
        assert not is_time_up()
        assert not limit.is_ended
    assert within_time(lambda: steps(3)) == 3
    assert current_time() is None


def test_inner_work_that_is_ended_ends_the_outer_at_its_next_step(now):
    reached = []

    def outer():
        now[0] = 2.0
        reached.append(within_time(lambda: steps(1)))
        check_cancelled()
        reached.append("too far")

    with search_time(1):
        assert within_time(outer) is None
    assert reached == [None]


def test_a_portion_ends_earlier_and_leaves_the_rest(now):
    with search_time(10) as limit:
        now[0] = 2.0
        with portion_of_time(0.5):
            now[0] = 5.9
            assert not is_time_up()
            now[0] = 6.0
            assert is_time_up()
            assert limit.ended_after == 6.0
        assert within_time(lambda: steps(1)) == 1


def test_errors_of_optional_work_are_raised():
    with search_time(10), pytest.raises(ZeroDivisionError):
        within_time(lambda: 1 // 0)
    with search_time(10) as limit:
        assert not limit.is_ended
