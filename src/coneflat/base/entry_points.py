"""Functions of higher levels by name, which methods of results call: `save`, `view`, conversions.

Files and pages are made of results, so the modules that write them import those of the results. The methods by which
users reach them therefore name the function instead of importing it.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any, Generic, TypeVar, cast

Result = TypeVar("Result")


@dataclass(frozen=True)
class EntryPoint(Generic[Result]):
    """A function of this package that is imported when it is first called.

    Attributes:
        target: its module and its name, such as "io.write:as_written".

    Examples:
        >>> from coneflat.base import EntryPoint
        >>> EntryPoint[str]("base.text:plural")(3, "cone")
        '3 cones'
    """

    target: str

    def __call__(self, *arguments: Any, **keywords: Any) -> Result:
        """Return what the function returns."""
        module, _, name = self.target.partition(":")
        function = getattr(import_module(f"coneflat.{module}"), name)
        return cast("Result", function(*arguments, **keywords))
