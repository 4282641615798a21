"""Unwrapping of meshes for textures: `search_cuts` and `pack_searched` are the method, top to bottom."""

from __future__ import annotations

import pickle
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import is_time_up, search_time, stage, timing, warns
from ..base.progress import component_at_work
from ..evaluate import evaluate, packed_scale
from ..groups import with_copies
from ..io import as_input
from ..options import Options, declarations, read_options, takes
from ..result import Flattening
from ..source import Component, LatestCache, Prepared, Source
from ..source.copies import Copy
from ..stages import Layout
from .candidates import Candidate
from .cut_search import Searched, search_cuts
from .density import expected_resolution, least_resolution
from .free_seams import measured, seam_edges
from .further_cuts import cut_to_pack
from .notes import FREE, with_notes
from .options import UnwrapOptions, options_of_stages
from .sharing import with_shared_texels
from .work import FINISHING, double_component_areas, threads_for


@takes(UnwrapOptions)
@warns()
def unwrap(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Return UVs for a texture: the shortest seams for which the layout is nearly isometric.

    Unlike in `flatten`, the two sides of a seam may differ, which lowers the distortion. Cones are only the ends of
    seams. Branches of charts are cut off where the texture gains more than the seams cost, by the strength
    `packing_cuts`; not if `charts` is "one" or a number, `seams` is "none", or `up` is given.

    Args:
        mesh, faces: as for `coneflat.flatten`.
        options: see below.

    Returns:
        The layout in the unit square with its seams and measures. Its energy is `distortion.energy`.

    Raises:
        OptionError: the bound is not above 4, or an option is unknown or invalid.
        MeshError, MeshFileError, CurvatureError, SeamError, MetricError, TooLargeError: as for `coneflat.flatten`.

    Warns:
        GuaranteeWarning: a guarantee, or a request, is not met; notes of the result say which.

    References:
        M. Li, D. Kaufman, V. Kim, J. Solomon, A. Sheffer, "OptCuts: joint optimization of surface cuts and
        parameterization", 2018, for the problem. J. Smith, S. Schaefer, "Bijective parameterization with free
        boundaries", 2015, for the energy.

    Examples:
        >>> result = coneflat.unwrap(coneflat.sample_path())
        >>> result.distortion.energy < 4.1, result.distortion.flipped, result.distortion.overlapping_pairs
        (True, 0, 0)
    """
    return Unwrapper(mesh, faces).unwrap(**options)


class Unwrapper:
    """Unwraps one mesh repeatedly; cuts are searched again only if options other than those of packing change.

    The results are those of `unwrap`. With other options of packing (`PACKING`), three models of 6,000 to 28,000
    triangles take 0.06 to 0.8 s instead of 1.4 to 4.9.
    """

    def __init__(self, mesh: Any, faces: ArrayLike | None = None) -> None:
        """Args:
        mesh, faces: as for `unwrap`.
        """
        self._source = Source(as_input(mesh, faces))
        self._searched: LatestCache[Searched] = LatestCache()

    @warns()
    def unwrap(self, **options: Any) -> Flattening:
        """Return the UVs; options and errors are those of `unwrap`."""
        parsed = read_options(options, UnwrapOptions)
        with timing(parsed.progress), search_time(parsed.search_time):
            searched = self._searched.of(_search_key(parsed), lambda: search_cuts(self._source, parsed))
            return pack_searched(searched, parsed)


#: Options on which the search for cuts does not depend.
PACKING = (
    "packing_cuts", "padding", "resolution", "texel_density", "lightmap", "block_size", "tiles", "up", "progress",
)  # fmt: skip


def _search_key(options: UnwrapOptions) -> bytes:
    """Return bytes that are equal for options for which the same cuts are found."""
    names = set(declarations(UnwrapOptions)) - set(PACKING)
    if options.hide_seams:  # Seams are hidden from above.
        names.add("up")
    return pickle.dumps([(name, getattr(options, name)) for name in sorted(names)])


def unwrap_source(source: Source, options: UnwrapOptions) -> Flattening:
    """Return the UVs of a mesh by parsed options; see `unwrap`."""
    with search_time(options.search_time):
        return pack_searched(search_cuts(source, options), options)


def pack_searched(searched: Searched, options: UnwrapOptions) -> Flattening:
    """Return the UVs with charts that are cut further for packing (`pack_cuts.py`), and packed.

    The ends of seams are moved again to meet the bound.
    """
    options = options.with_lightmap()
    stage_options = _with_expected_resolution(
        options_of_stages(options), options, searched.components, searched.prepared.checked.exponent
    )
    return pack_candidates(searched, cut_to_pack(searched, options, stage_options), options, stage_options)


def pack_candidates(
    searched: Searched, candidates: Mapping[int, Candidate], options: UnwrapOptions, stage_options: Options
) -> Flattening:
    """Return the UVs of candidates, which are cut for packing, packed; the other arguments as of `cut_to_pack`."""
    prepared, components = searched.prepared, searched.components
    with threads_for(components, options), stage("measure"):
        layouts = _measured_layouts(candidates, searched.flat, components, searched.copies)
    # With a density, the charts must be packed as tightly as they were when the resolution was found.
    has_density = options.texel_density is not None
    with search_time(0.0 if is_time_up() else None) if has_density else nullcontext():
        stage_options = _with_least_resolution(stage_options, options, prepared, layouts)
        with component_at_work("", FINISHING):
            result = evaluate(prepared, layouts, replace(stage_options, method=FREE))
    energies = [candidate.energy for candidate in candidates.values()]
    result = with_notes(
        result, options, energies, _count_forbidden(components, layouts), searched.ended_by_now
    )
    return result if searched.shared is None else with_shared_texels(result, searched.shared, prepared)


def _with_expected_resolution(
    stage_options: Options, options: UnwrapOptions, components: Sequence[Component], exponent: int
) -> Options:
    """Return options with about the resolution that a texel density needs; exponent: see `CheckedMesh`."""
    if options.texel_density is None:
        return stage_options
    with np.errstate(over="ignore"):  # a model that is too large for any texture
        areas = np.ldexp(double_component_areas(components) / 2, -2 * exponent)
    expected = expected_resolution(options.texel_density, areas, options.padding, options.tiles)
    return replace(stage_options, resolution=expected)


def _with_least_resolution(
    stage_options: Options, options: UnwrapOptions, prepared: Prepared, layouts: Sequence[Layout]
) -> Options:
    """Return options with the resolution that a texel density needs with given layouts."""
    if options.texel_density is None:
        return stage_options
    with stage("pack"):
        scale_at = packed_scale(prepared, layouts, stage_options)
        start = stage_options.resolution
        resolution = least_resolution(options.texel_density, options.padding, start, scale_at)
    return replace(stage_options, resolution=resolution)


def _measured_layouts(
    candidates: Mapping[int, Candidate],
    flat: Mapping[int, Layout],
    components: Sequence[Component],
    copies: Sequence[Copy | None],
) -> list[Layout]:
    """Return the layouts of all components with the scales and curvatures that they have."""
    layouts = {
        i: candidate.layout if candidate.layout is flat.get(i) else measured(candidate.layout)
        for i, candidate in candidates.items()
    }
    return with_copies(layouts, components, copies)


def _count_forbidden(components: Sequence[Component], layouts: Sequence[Layout]) -> int:
    """Return the number of forbidden edges that are cut."""
    return sum(
        int(component.seams.is_forbidden[seam_edges(layout)].sum())
        for component, layout in zip(components, layouts, strict=True)
        if len(layout.seams)
    )
