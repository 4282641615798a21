"""Options of patterns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from ...errors import OptionError
from ...options import Choice, Direction, Edges, Number, RunOptions, declarations, option
from .finish import MAX_ALLOWANCE, Allowances, read_allowances
from .papers import DEFAULT_PAPER, PaperName
from .units import MILLIMETRES, Length, Percentage

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

KINDS = ("cloth", "net", "gores", "sheet")
#: Largest number of gores: more would be narrower than their allowances.
MAX_GORES = 200
#: Options that not all kinds have.
OWN_OPTIONS = {
    "cloth": ("strain", "stretch_warp", "stretch_weft", "darts", "symmetry", "seams", "tolerance", "grain"),
    "net": ("tabs",),
    "gores": ("gores", "grain"),
}


@dataclass(frozen=True, kw_only=True)
class PatternOptions(RunOptions):
    """Pattern.

    Attributes:
        kind: cloth: the shortest seams for a strain. net: an exact unfolding of a polyhedron, with folds and glue tabs.
            gores: strips from pole to pole. sheet: one piece, with bend lines.
        unit: Unit of the coordinates of the model.
        scale: Factor of its size.
        height: Height of the finished object, instead of unit and scale.
        strain: Largest relative change of the length of any edge of cloth.
        stretch_warp: The same along the grain only, for cloth that stretches differently.
        stretch_weft: The same across the grain only.
        darts: auto: cuts that end inside a piece become darts. none: they go on to another border.
        symmetry: auto: cloth of a surface with a plane of symmetry is symmetric, too. none: it need not be.
        seams: Edges that must be cut, as pairs of vertices; or input, for the seams of the UVs in the file.
        tolerance: Largest distance from the surface at which seams of cloth are made smooth, and mean distance at which
            dense meshes are simplified; 0 for neither.
        gores: Number of strips from pole to pole.
        axis: Upward direction of the model, along which its height and the poles of gores are; by default that of
            its format, or of its shape; for gores the coordinate axis around which they have the least strain.
        grain: Direction on the model along which the grain of cloth and gores is; by default the axis. none: pieces
            have no grain, and are rotated to save material.
        allowance: Width of the seam allowance: 7 mm for cloth and gores by default, else 0.
        seam_allowances: Widths of single seams by name, such as A=10mm,B=0.
        corners: Corners of the allowance: mitred or round.
        tabs: Width of the glue tabs of a net; 0 for none.
        page: Paper of a PDF: a page size, onto which the pattern is tiled; roll:WIDTH; or none for one page as large as
            the pattern.
    """

    #: Options of the group that patterns refuse.
    REFUSED: ClassVar = ("lengths",)

    kind: str = option("cloth", Choice(KINDS))
    unit: str | None = option(None, Choice((*MILLIMETRES,)))
    scale: float = option(1.0, Number(is_positive=True))
    height: float | None = option(None, Length(optional=True, is_positive=True))
    strain: float = option(0.03, Percentage())
    stretch_warp: float | None = option(None, Percentage(optional=True))
    stretch_weft: float | None = option(None, Percentage(optional=True))
    darts: str = option("auto", Choice(("auto", "none")))
    symmetry: str = option("auto", Choice(("auto", "none")))
    seams: ArrayLike | str | None = option(None, Edges(("input",)), one_mesh=True)
    tolerance: float = option(0.5, Length())
    gores: int = option(12, Number(2, MAX_GORES, is_integer=True))
    axis: tuple[float, float, float] | None = option(None, Direction())
    grain: tuple[float, float, float] | str | None = option(None, Direction(("none",)))
    allowance: float | None = option(None, Length(optional=True, maximum=MAX_ALLOWANCE))
    seam_allowances: str = option("", Allowances())
    corners: str = option("mitred", Choice(("mitred", "round")))
    tabs: float = option(8.0, Length())
    page: str = option(DEFAULT_PAPER, PaperName())

    def __post_init__(self) -> None:
        if self.height is not None and (self.unit is not None or self.scale != 1.0):
            raise OptionError("height and unit or scale cannot be combined: leave out one of them")
        for name in _names_of_other_kinds(self.kind):
            if _differs(getattr(self, name), declarations(PatternOptions)[name].default):
                raise OptionError(f"{name} and kind {self.kind} cannot be combined: leave out one of them")
        if self.grain == "none" and (self.stretch_warp is not None or self.stretch_weft is not None):
            raise OptionError(
                "grain none and stretch_warp or stretch_weft cannot be combined: leave out one of them"
            )
        if self.kind == "net" and self.tabs:
            for name, widths in (
                ("allowance", [self.allowance or 0.0]),
                ("seam_allowances", read_allowances(self.seam_allowances).values()),
            ):
                if any(widths):
                    raise OptionError(f"{name} and tabs of a net cannot be combined: give 0 as one of them")
        for name in self.REFUSED:
            if getattr(self, name) is not None:
                raise OptionError(f"{name} and patterns cannot be combined: leave out {name}")


def _differs(value: object, default: object) -> bool:
    return value is not default and (not isinstance(value, (str, int, float)) or value != default)


def _names_of_other_kinds(kind: str) -> list[str]:
    """Return the names of the options that a kind of patterns does not have."""
    names = dict.fromkeys(name for group in OWN_OPTIONS.values() for name in group)
    return [name for name in names if name not in OWN_OPTIONS.get(kind, ())]
