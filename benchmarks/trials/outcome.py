"""The outcome of a case."""

from __future__ import annotations

import json
import re
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "coneflat"
#: Largest number of characters of a message that is readable as one line.
LONGEST_MESSAGE = 900


@dataclass
class Outcome:
    """The outcome of a case.

    Attributes:
        kind, seed: the case.
        status: "ok", "noted" (a promise is not kept and a note says so), "refused" or "breach".
        recipe: what was done, in words.
        message: of a refusal.
        breaches: (cause, details) of each promise broken.
        noted: promises not kept that a note names.
        seconds, memory: wall time; peak of resident memory above that before, MB.
    """

    kind: str
    seed: int
    status: str = "ok"
    recipe: str = ""
    message: str = ""
    breaches: list[tuple[str, str]] = field(default_factory=list)
    noted: list[str] = field(default_factory=list)
    seconds: float = 0.0
    memory: float = 0.0

    def breach(self, cause: str, details: object = "") -> None:
        """Add a breach; further ones of the same cause are ignored."""
        self.status = "breach"
        if cause not in dict(self.breaches):
            self.breaches.append((cause, " ".join(str(details).split())[:600]))

    def excuse(self, promise: str) -> None:
        """Add an unmet guarantee that is reported in a note."""
        self.noted.append(promise)
        if self.status == "ok":
            self.status = "noted"

    def refuse(self, message: str, expects_nan: bool = False) -> None:
        """Record an error of the package, whose message must be one readable line."""
        if self.status != "breach":
            self.status = "refused"
        self.message = message
        if not message.strip() or "\n" in message.strip() or len(message) > LONGEST_MESSAGE:
            self.breach("message: not one line", message)
        if not expects_nan and re.search(r"\b(nan|inf)\b", message):
            self.breach("message: speaks of nan", message)
        if "Traceback" in message or "internal error" in message:
            self.breach("message: internal error", message)

    @contextmanager
    def guarded(self, label: str = "", expects_nan: bool = False) -> Iterator[None]:
        """Run code that may raise an error of the package; any other error is a breach, and so is a warning."""
        from coneflat.errors import ConeflatError

        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                yield
            except ConeflatError as error:
                self.refuse(str(error), expects_nan)
            except Exception as error:
                self.breach(f"{label}{where(error)}", f"{type(error).__name__}: {error}")
        for warning in caught:
            if issubclass(warning.category, RuntimeWarning) and str(PACKAGE) in warning.filename:
                place = f"{Path(warning.filename).relative_to(PACKAGE)}:{warning.lineno}"
                self.breach(f"warning: {warning.message} at {place}")

    def as_json(self) -> str:
        return json.dumps(self.__dict__)


def where(error: BaseException) -> str:
    """Return the type of an error and the innermost function of the package in its traceback."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if Path(frame.filename).is_relative_to(PACKAGE)
    ]
    if not frames:
        return f"{type(error).__name__} outside the package"
    at = frames[-1]
    return f"{type(error).__name__} in {Path(at.filename).relative_to(PACKAGE)} {at.name}"
