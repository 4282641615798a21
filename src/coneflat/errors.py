"""Exceptions of the package; every failure that a user can cause raises one of these. And its one warning.

All exceptions derive from `ConeflatError`. A message is one line: what is wrong, where, and what to do about it.

Examples:
    >>> try:
    ...     coneflat.read_mesh("missing.obj")
    ... except coneflat.errors.MeshFileError as error:
    ...     print(error)
    missing.obj: there is no such file
"""

from __future__ import annotations


class ConeflatError(Exception):
    """Base of every exception that coneflat raises on purpose.

    Examples:
        >>> try:
        ...     coneflat.flatten([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 9]])
        ... except coneflat.ConeflatError as error:
        ...     print(error)
        1 face with a vertex index outside 0..2: 0; face 0 is (0, 1, 9)
    """

    def __str__(self) -> str:
        """Return the message in one line, also with file names that contain line breaks."""
        return " ".join(super().__str__().splitlines())


class MeshError(ConeflatError, ValueError):
    """The mesh cannot be flattened."""


class EmptyMeshError(MeshError):
    """The mesh has no vertices or no faces."""


class ArrayShapeError(MeshError):
    """An array has the wrong shape or type."""


class NonFiniteError(MeshError):
    """A coordinate is NaN or infinite."""


class FaceIndexError(MeshError):
    """A face has the index of a vertex that does not exist."""


class DegenerateFaceError(MeshError):
    """A face uses a vertex twice, or has no area."""


class NonManifoldError(MeshError):
    """An edge has more than two faces, or the faces at a vertex form more than one fan."""


class NonOrientableError(MeshError):
    """The faces cannot be oriented consistently (a Moebius strip, a Klein bottle)."""


class LengthError(MeshError):
    """Side lengths are not a metric: they break the triangle inequality, or differ between the two sides of an edge."""


class MissingUVError(MeshError):
    """The mesh has no UV coordinates, or none that are finite."""


class OptionError(ConeflatError, ValueError):
    """An option is unknown, has an invalid value, or contradicts another option."""


class CurvatureError(ConeflatError, ValueError):
    """No metric has the required curvatures (Gauss-Bonnet is violated, or a curvature is 2 pi or more)."""


class SeamError(ConeflatError, ValueError):
    """The required seams are impossible."""


class MetricError(ConeflatError, ArithmeticError):
    """No usable flat metric or layout was found."""


class ConvergenceError(MetricError):
    """A solver stopped before it reached its tolerance."""


class TooLargeError(ConeflatError, MemoryError):
    """The computation needs more memory than is free."""


class GridError(MetricError):
    """No integer grid was found."""


class CoarseGridError(GridError):
    """The number of quads is too small for the surface; the message has a number that is large enough, if known.

    Attributes:
        quads: the number of quads that is large enough, or None.
    """

    quads: int | None = None

    def __init__(self, text: str, quads: int | None = None) -> None:
        super().__init__(text)
        self.quads = quads


class MeshFileError(ConeflatError, OSError):
    """A file cannot be read or written, or its content does not match its format."""


class UnknownFormatError(MeshFileError):
    """The file extension does not belong to a supported format."""


class CacheError(ConeflatError, OSError):
    """Compiled kernels cannot be cached."""


class ProjectError(ConeflatError, ValueError):
    """A studio project cannot be read, or its mesh has changed since it was saved."""


class StudioError(ConeflatError, ValueError):
    """The studio cannot perform a request."""


class GuaranteeWarning(UserWarning):
    """A result does not meet a guarantee, or a request; its text is that of the first notes.

    A call of a public function gives one warning at most. `warnings.filterwarnings` ignores it or makes it an error;
    the command line prints notes instead.

    Attributes:
        notes: the notes on all unmet guarantees of the call, one sentence each.

    Examples:
        >>> import warnings
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]]
        >>> with warnings.catch_warnings():
        ...     warnings.simplefilter("error", coneflat.GuaranteeWarning)
        ...     try:
        ...         coneflat.flatten(*square, cone_count=5)
        ...     except coneflat.GuaranteeWarning as warning:
        ...         print(len(warning.notes), warning.notes[0].partition(":")[0])
        1 0 cones instead of the 5 asked for
    """

    def __init__(self, text: str, notes: tuple[str, ...] = ()) -> None:
        super().__init__(text)
        self.notes = notes
