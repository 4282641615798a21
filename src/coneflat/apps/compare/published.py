"""What the paper measured (Ben-Chen, Gotsman and Bunin 2008, Tables 1 and 2; a 1.4 GHz processor)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

# Relative: a model with as many triangles, to the thousand, is the paper's.
SAME = 0.03


@dataclass(frozen=True)
class Published:
    """A model's row in the paper's tables.

    Attributes:
        thousands: of triangles.
        curvature_error: ||K_target - K|| / n over pi, of the paper's method.
        qc: mean QC distortion, by method, where it is given.
        seconds: running time, by method, likewise.
    """

    thousands: float
    curvature_error: float
    qc: Mapping[str, float]
    seconds: Mapping[str, float]

    def has_as_many(self, triangles: int) -> bool:
        """Whether a mesh has the resolution of the paper's."""
        return abs(triangles / 1000 - self.thousands) <= max(SAME * self.thousands, 0.5)


#: The paper's names of the methods, by ours. Its circle patterns ran on the triangles as they are, and its
#: linear ABF left cones free.
NAMES = {"circle-patterns/fixed": "CP", "linear-abf/free": "LABF", "linear": "CF"}


def _published(
    thousands: float, error: float, qc: tuple[float, ...], seconds: tuple[float, ...]
) -> Published:
    """Return a row; its numbers are those of CP, LABF and CF, or the last so many of them."""
    methods = list(NAMES)
    return Published(
        thousands,
        error,
        dict(zip(methods[-len(qc) :], qc, strict=True)),
        dict(zip(methods[-len(seconds) :], seconds, strict=True)),
    )


#: By model, in the paper's order.
MODELS = {
    "fandisk": _published(13, 4.6e-6, (1.013, 1.007, 1.012), (20, 0.9, 0.5)),
    "rockerarm": _published(20, 1.4e-5, (1.045, 1.027, 1.028), (21, 1.5, 0.4)),
    "foot": _published(20, 2.7e-5, (1.029, 1.016, 1.020), (29, 1.4, 0.6)),
    "gargoyle": _published(20, 2.9e-5, (1.213, 1.032, 1.037), (29, 1.6, 0.7)),
    "elephant": _published(40, 1.6e-5, (1.028, 1.022, 1.027), (44, 4.8, 1.1)),
    "horse": _published(40, 1.8e-5, (1.035, 1.017, 1.077), (62, 4.1, 1.3)),
    "hand": _published(106, 3.2e-6, (1.009, 1.008, 1.009), (903, 26, 3.8)),
    "torso": _published(284, 1.4e-6, (1.004, 1.005), (86, 24)),
    "isi-horse": _published(358, 8.4e-7, (1.009,), (32,)),
}


def model_of(path: Path) -> str | None:
    """Return the name of the paper's model that a file has; None if it has none of them."""
    stem = re.sub(r"[^a-z0-9]", "", path.stem.lower())
    return next((name for name in MODELS if name.replace("-", "") == stem), None)
