"""Why there is no grid: reasons that stages return, so that another grid can be tried."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

from ..errors import ConeflatError, ConvergenceError, CurvatureError, GridError, MetricError, SeamError

if TYPE_CHECKING:
    from .integer_map import IntegerGrid

P = ParamSpec("P")
Result = TypeVar("Result")

#: Errors of stages after which another grid may be found; all others end the search.
REASONS = (ConvergenceError, CurvatureError, GridError, MetricError, SeamError)


@dataclass(frozen=True, eq=False)
class NoGrid:
    """Why there is no grid, or none whose quads are a mesh.

    Attributes:
        error: the error for the user, if nothing else is found.
        coarse_grid: a grid that is so coarse that some of its quads are degenerate, with all notes; None if there is no
            grid at all.
    """

    error: ConeflatError
    coarse_grid: IntegerGrid | None = None

    @property
    def reason(self) -> str:
        """The reason as a text without a full stop."""
        return str(self.error)


def or_reason(stage: Callable[P, Result | NoGrid]) -> Callable[P, Result | NoGrid]:
    """Return a stage that returns the reason instead of raising one of the errors `REASONS`."""

    @wraps(stage)
    def call(*arguments: P.args, **options: P.kwargs) -> Result | NoGrid:
        try:
            return stage(*arguments, **options)
        except REASONS as error:
            # With its traceback, the error would keep the frames of the stage, and all arrays, in memory.
            return NoGrid(error.with_traceback(None))

    return call
