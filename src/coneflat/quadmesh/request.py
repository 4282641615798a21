"""What is asked of a grid: the mesh, the size of squares, and options, read once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import FloatArray, Stopwatch
from ..base.progress import as_part, rising
from ..errors import OptionError
from ..geometry import double_areas, edge_lengths
from ..io import as_input
from ..mesh import CheckedMesh
from ..mesh.connectivity import TriangleMesh
from ..optimise import StretchEnergy
from ..options import SEARCH_OPTIONS, Options, declarations, read_options
from ..result import Flattening
from ..source import Source
from .cross_field import SHARP_ANGLE
from .limits import NO_LIMIT, SquareLimit
from .mirror_planes import MirrorPlane
from .options import QUADS, QuadOptions, flattening_defaults
from .sizes import target_scales

# Options that only the search for the fewest cones takes into account.
SPARSE_OPTIONS = (*SEARCH_OPTIONS, "max_cones", "lengths")
# Least and largest size of squares, relative to the extent of the mesh: beyond, coordinates could overflow.
MIN_SIZE, MAX_SIZE = 1e-75, 1e75
# Least extent of a mesh, for one without area.
MIN_EXTENT = 1e-150


@dataclass(frozen=True, eq=False)
class GridRequest:
    """A grid that is asked for.

    Attributes:
        source: the mesh.
        flattening: its flattening, if this is given.
        size: the side of squares in model units.
        sizes: relative sizes of squares, or None.
        energy: the energy of the grid.
        sharp_angle: the dihedral angle of edges required on grid lines, or None.
        limit: largest number of squares of a grid.
        boundary: the option of that name of `integer_grid`.
        options: the other options, those of the flattening.
        stages: the stopwatch.
        loops: prefer integers for short loops.
        for_quads: a grid is searched until quads can be extracted from it.
        symmetry: the option of that name of `integer_grid`.
        mirror: the plane at which the mesh, a half of a symmetric surface, continues, in model units; or None.
    """

    source: Source
    flattening: Flattening | None
    size: float
    sizes: Any
    energy: StretchEnergy
    sharp_angle: float | None
    limit: SquareLimit
    boundary: Any
    options: Mapping[str, Any]
    stages: Stopwatch
    loops: bool = False
    for_quads: bool = False
    symmetry: str = "auto"
    mirror: MirrorPlane | None = None

    @classmethod
    def of(
        cls, mesh: Any, faces: ArrayLike | None, quad_options: Mapping[str, Any], options: Mapping[str, Any]
    ) -> GridRequest:
        """Return the request with the arguments of `integer_grid`; `quad_options` are its named options.

        Raises:
            OptionError: options are invalid.
            MeshError, MeshFileError: the mesh cannot be read.
        """
        chosen = read_options(quad_options, QuadOptions)
        length, sizes = (chosen.size, None) if isinstance(chosen.size, float) else (None, chosen.size)
        if chosen.quads is not None and length is not None:
            raise OptionError("quads and size must not be given together")
        flattening = mesh if isinstance(mesh, Flattening) else None
        is_auto = str(options.get("boundary", "auto")) == "auto"
        free_options = {name: value for name, value in options.items() if name != "boundary"}
        fixed_options = {
            "sharp_angle": chosen.sharp_angle,
            "boundary": "free" if is_auto else options["boundary"],
        }
        parsed = read_options({**flattening_defaults(options), **free_options, **fixed_options}, Options)
        stages = Stopwatch(parsed.progress)
        if parsed.progress is not None:
            free_options["progress"] = rising(parsed.progress)
            stages = Stopwatch(free_options["progress"])
        has_more = faces is not None or sizes is not None or chosen.sharp_angle is not None
        if flattening and (has_more or options.keys() - {"progress"}):
            raise OptionError("a flattening already has faces and options: no others can be given")
        arrays = (flattening.vertices, flattening.faces) if flattening else (mesh, faces)
        boundary = parsed.boundary.tolist() if isinstance(parsed.boundary, np.ndarray) else parsed.boundary
        request = cls(
            source=Source(as_input(*arrays)),
            flattening=flattening,
            size=1.0,
            sizes=sizes,
            energy=StretchEnergy(chosen.stretch),
            sharp_angle=chosen.sharp_angle,
            limit=NO_LIMIT,
            boundary="auto" if is_auto else boundary,
            options=free_options,
            stages=stages,
            symmetry=chosen.symmetry,
            loops=chosen.loops,
        )
        return request._with_size(length, chosen.quads)

    def _with_size(self, length: float | None, quads: int | None) -> GridRequest:
        """Return the request with a side of squares, or a number of quads, and the limit that follows."""
        extent = self.extent
        size = length or extent / float(np.sqrt(quads or QUADS))
        # Sizes beyond this range, whose squares could overflow, fail as those at its ends.
        size = min(max(size, MIN_SIZE * extent), MAX_SIZE * extent)
        squares = quads or (extent / size) ** 2
        return replace(self, size=size, limit=SquareLimit.of(squares, len(self.mesh.faces), extent))

    def as_part(self, start: float, end: float) -> GridRequest:
        """Return the request whose progress is that of a part of the work, between two fractions of it."""
        progress = self.options.get("progress")
        if progress is None:
            return self
        part = as_part(progress, start, end)
        stages = Stopwatch(part)
        stages.seconds = self.stages.seconds
        return replace(self, options={**self.options, "progress": part}, stages=stages)

    def with_quads(self, quads: int) -> GridRequest:
        """Return the request for another number of quads."""
        return self._with_size(None, quads)

    @property
    def checked(self) -> CheckedMesh:
        """The checked mesh, at about unit size."""
        return self.source.checked(bool(self.options.get("repair", False)))

    @property
    def mesh(self) -> TriangleMesh:
        """The triangles of the checked mesh."""
        return self.checked.mesh

    @property
    def extent(self) -> float:
        """The root of the area of the mesh, in model units."""
        checked = self.checked
        side_lengths = self.flattening.lengths if self.flattening else self.options.get("lengths")
        options = read_options(
            {"lengths": side_lengths, "repair": self.options.get("repair", False)}, Options
        )
        lengths = None if side_lengths is None else self.source.prepared(options).user_lengths
        if lengths is None:
            lengths = edge_lengths(checked.mesh.vertices, checked.mesh.faces)
        area = double_areas(lengths).sum() / 2
        return float(np.ldexp(max(np.sqrt(area), MIN_EXTENT), -checked.exponent))

    @cached_property
    def scales(self) -> FloatArray | None:
        """(n,) the target log conformal factor at the vertices of the checked mesh, if relative sizes are given."""
        return None if self.sizes is None else target_scales(self.source, self.checked, self.sizes)

    @property
    def angle(self) -> float:
        """The dihedral angle above which edges are sharp, radians."""
        return SHARP_ANGLE if self.sharp_angle is None else self.sharp_angle

    @property
    def leaves_cones_open(self) -> bool:
        """Whether the options leave open which cones a grid has, and where the boundary lies."""
        cones = self.options.get("cones", "auto")
        if not (isinstance(cones, str) and cones == "auto"):
            return False
        if any(name in self.options for name in SPARSE_OPTIONS):
            return False
        return self.boundary in ("auto", "straight") or not self.mesh.is_boundary_edge.any()


def names_vertices(request: GridRequest) -> bool:
    """Return whether options may name vertices: weights, and those that are not simple values."""
    options = {**request.options, "boundary": request.boundary}
    is_simple = all(
        value is None or isinstance(value, (str, Real)) or callable(value) for value in options.values()
    )
    return not (is_simple and options.keys() <= declarations(QuadOptions).keys() - {"weights"})
