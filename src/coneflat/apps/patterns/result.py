"""The pattern of a surface: pieces in the plane, in millimetres, and how they are sewn together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ...base import EntryPoint, FloatArray, IntArray, plural
from .drawing.allowances import shapely
from .drawing.counterparts import Counterparts
from .drawing.drawing import Drawing
from .drawing.shapes import PieceShape, piece_shapes
from .drawing.tiling import Tile, tiles_of
from .finish import HEM, SEWN, Finish
from .net.tabs import Tab
from .papers import DEFAULT_PAPER, EDGE, Paper
from .pieces.borders import Borders, Seam, find_borders
from .pieces.cut_surface import CutSurface, largest_stretches
from .sheet.bends import Bend, find_bends

_DRAWING = EntryPoint[Drawing]("apps.patterns.drawing.outlines:drawing_of")
_COUNTERPARTS = EntryPoint[Counterparts]("apps.patterns.drawing.counterparts:counterparts_of")
_WRITE = EntryPoint[Path]("apps.patterns.files.files:write_pattern")
_SHOW = EntryPoint[Path]("apps.patterns.page:show_pattern")
_REPORT = EntryPoint[dict[str, Any]]("apps.patterns.report:report_of")


@dataclass(frozen=True, eq=False)
class Pattern:
    """Pieces of a surface that are cut out of cloth, paper or sheet; all lengths are millimetres.

    Attributes:
        kind: cloth, net, gores or sheet.
        surface: the surface at its final size, cut into pieces, which lie side by side in the plane without overlap,
            the grain, if there is one, along the second axis.
        millimetres: millimetres per unit of the model.
        folds: (f, 2) points of fold lines inside pieces, and `fold_angles` (f,) their dihedral angles in radians,
            positive for mountain folds, negative for valleys.
        tabs: tabs for glue, beside the pieces.
        notes: what was changed, assumed, or could not be met.
        settings: the options.

    Examples:
        >>> corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
        >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
        >>> net = coneflat.pattern(corners, faces, kind="net", unit="cm")
        >>> net.piece_count, len(net.seams), len(net.folds)
        (1, 3, 3)
    """

    kind: str
    surface: CutSurface
    millimetres: float
    folds: IntArray = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    fold_angles: FloatArray = field(default_factory=lambda: np.empty(0))
    tabs: tuple[Tab, ...] = ()
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def borders(self) -> Borders:
        """The borders of the pieces, their seams, darts and hems."""
        return find_borders(self.surface)

    @property
    def piece_count(self) -> int:
        """The number of pieces."""
        return len(self.borders.loops)

    @property
    def is_sewn(self) -> bool:
        """Whether it is a pattern for cloth, with seam allowances, notches and darts."""
        return self.kind in SEWN

    @property
    def has_grain(self) -> bool:
        """Whether pieces have a grain, and are turned by half turns only."""
        return self.is_sewn and self.settings.get("grain") != "none"

    @property
    def seams(self) -> tuple[Seam, ...]:
        """The seams between different pieces or parts of pieces, darts among them."""
        return self.borders.seams

    @property
    def darts(self) -> tuple[Seam, ...]:
        """The seams that end in a tip inside a piece; none in nets and sheets, which are not sewn."""
        return tuple(seam for seam in self.seams if seam.is_dart and self.is_sewn)

    @property
    def corner_cuts(self) -> tuple[Seam, ...]:
        """The cuts of nets and sheets that end inside a piece, as at the corners of a tray; its sides are joined."""
        return tuple(seam for seam in self.seams if seam.is_dart and not self.is_sewn)

    @cached_property
    def bends(self) -> tuple[Bend, ...]:
        """The bends of a sheet; none of other kinds, and of pieces that are stretched."""
        return find_bends(self.surface) if self.kind == "sheet" else ()

    @cached_property
    def counterparts(self) -> Counterparts:
        """Which pieces have the same shape, and which are mirror images of each other."""
        return _COUNTERPARTS(self)

    @cached_property
    def finish(self) -> Finish:
        """The widths of the seam allowances, and their corners."""
        return Finish.of(self.kind, self.settings)

    @property
    def allowances(self) -> tuple[float, ...]:
        """The widths of the seam allowances of all sides, mm, each once, the smallest first."""
        names = [seam.name for seam in self.seams] + ([HEM] if self.borders.hems else [])
        return tuple(sorted({self.finish.width(name) for name in names}))

    @cached_property
    def paper(self) -> Paper:
        """The paper of a PDF."""
        return Paper.of(self.settings.get("page", DEFAULT_PAPER))

    @cached_property
    def shapes(self) -> tuple[PieceShape, ...]:
        """The pieces as they are cut out, with allowances and tabs."""
        return tuple(piece_shapes(self.surface, self.borders, self.finish, self.tabs))

    @cached_property
    def sheet_size(self) -> tuple[float, float]:
        """The width and the height of the sheet on which the pieces lie side by side, mm."""
        width, height = (shapely().total_bounds([shape.cut for shape in self.shapes])[2:] + EDGE).tolist()
        return width, height

    @cached_property
    def tiles(self) -> tuple[Tile, ...]:
        """The parts of the sheet that are printed on pages."""
        return tuple(tiles_of([shape.cut for shape in self.shapes], *self.sheet_size, self.paper))

    @cached_property
    def strains(self) -> FloatArray:
        """(k,) the relative change of length of each edge of the pieces, `surface.edges`."""
        return self.surface.edges.strains(self.surface.points)

    @cached_property
    def stretches(self) -> FloatArray:
        """(m,) the relative change of length of each triangle in the direction in which it is largest.

        It can exceed those of the edges, where cloth is sheared.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return largest_stretches(self.surface)

    def __repr__(self) -> str:
        size = " x ".join(f"{extent:.3g}" for extent in np.ptp(self.surface.mesh.vertices, axis=0))
        counts = f"{plural(self.piece_count, 'piece')}, {plural(len(self.seams), 'seam')}"
        return f"<Pattern ({self.kind}): {counts}, {size} mm>"

    def drawing(self) -> Drawing:
        """Return the drawing: what is cut, folded and marked, with numbers and names, at its true size.

        Raises:
            OptionError: options of the pattern cannot be met, or shapely is not installed.
        """
        return self._drawn

    @cached_property
    def _drawn(self) -> Drawing:
        return _DRAWING(self)

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the pattern at its true size, and return the path: .pdf in pages, .svg or .dxf as a single sheet.

        Raises:
            UnknownFormatError, MeshFileError: the file cannot be written.
            OptionError: options of the pattern cannot be met, or a package is not installed.
        """
        return _WRITE(self, path)

    def view(self, path: str | PathLike[str] | None = None) -> Path:
        """Write an interactive page, one self-contained HTML file, and return its path.

        It shows the model next to its pieces, which have numbers and colours, both sides of each seam, the darts, and
        the strain.

        Args:
            path: the page, .html; by default a new temporary file, which is opened in the browser.

        Raises:
            UnknownFormatError, MeshFileError: the file cannot be written.
            OptionError: a package is not installed.
        """
        return _SHOW(self, path)

    def report(self) -> dict[str, Any]:
        """Return all measures as a dictionary that can be written as JSON; lengths in mm, areas in mm^2."""
        return _REPORT(self)
