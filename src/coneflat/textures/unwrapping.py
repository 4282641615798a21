"""Unwrapping of meshes for textures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base import TYPED_TOLERANCE, FloatArray, Stopwatch, Unmet, limit_threads, plural, timing, warns
from ..errors import ConvergenceError
from ..evaluate import evaluate, packed_scale
from ..flattening import Steps
from ..geometry import dihedral_angles, double_areas
from ..groups import lay_out_flat_components, with_copies
from ..io import as_input
from ..measures.distortion import Distortion
from ..metric import find_metric
from ..optimise import joined as joined_meshes
from ..options import Options, declarations, read_options, takes
from ..result import Flattening
from ..source import Component, Source, find_copies
from ..stages import ConeSolution, FlatMetric, MetricSpec, Surface
from .density import MAX_RESOLUTION, expected_resolution, least_resolution
from .free_seams import measured, seam_edges
from .minor import MinorComponents
from .mirror import both_halves, half_of
from .options import ENERGY_PER_AREA, ISOMETRIC, TextureOptions, UnwrapOptions
from .pack_cuts import cut_for_packing, cut_into
from .search import MANY_TRIANGLES, Candidate, CutSearch
from .stacked import with_copies_stacked, without_copies

# Parts with less than this share of the area are cut together. With 0.05 instead, 26 models in one file take 40% less
# time, and their seams are 10% longer.
MINOR_SHARE = 0.03
# Dihedral angle of sharp edges in radians; and the preference for seams along them if only they bend the surface: twice
# their length costs as much as that of other edges.
SHARP, CREASES = np.radians(40), 0.3
# Options that the flattening does not have, or with other values.
OWN = (*declarations(TextureOptions), "charts", "seams")
# Triangles of a component from which several threads are faster than one.
PARALLEL = 20_000
# Newton steps of the exact metric: most meshes take 10, bad ones 100 and more.
MAX_NEWTON_STEPS = 25
#: The `method` in the settings of a result.
FREE = "free seams"


@takes(UnwrapOptions)
@warns()
def unwrap(mesh: Any, faces: ArrayLike | None = None, **options: Any) -> Flattening:
    """Return UVs for a texture: the shortest seams for which the layout is nearly isometric.

    Unlike in `flatten`, the two sides of a seam may differ, which lowers the distortion. Cones are only the ends of
    seams. Branches of charts are cut off where the texture gains more than the seams cost, unless `charts` is "one" or
    `up` is given.

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
    parsed = read_options(options, UnwrapOptions)
    with timing(parsed.progress) as watch:
        return _unwrapped(Source(as_input(mesh, faces)), parsed, watch)


def _unwrapped(source: Source, o: UnwrapOptions, watch: Stopwatch) -> Flattening:
    common = {name: getattr(o, name) for name in declarations(UnwrapOptions) if name not in OWN}
    if o.texel_density is not None:  # the padding is limited by the largest resolution
        common["resolution"] = MAX_RESOLUTION
    shared = Options(
        **common,
        seams=o.marked,
        charts="one" if o.charts == "one" else "atlas",
    )
    with watch("check"):
        prepared, mirror = source.prepared(shared), None
        if o.stack == "mirrored":
            mirror, prepared = half_of(prepared, source, shared)
        stacked, prepared = without_copies(prepared) if o.stack == "copies" else (None, prepared)
    steps = Steps(find_metric=quick_metric, separates=shared.charts == "atlas", untangles=False)
    components, found = along_sharp_edges(prepared.components), dict[int, Candidate]()
    areas, sizes = np.array(
        [(double_areas(component.lengths).sum(), len(component.faces)) for component in components]
    ).T
    is_minor = areas < MINOR_SHARE * areas.sum()
    if o.texel_density is not None:
        with np.errstate(over="ignore"):  # a model that is too large for any texture
            model_areas = np.ldexp(areas / 2, -2 * prepared.checked.exponent)
        shared = replace(
            shared, resolution=expected_resolution(o.texel_density, model_areas, o.padding, o.tiles)
        )
    with limit_threads(o.threads if sizes.max() > PARALLEL else 1):
        with watch("layout"):
            flat = lay_out_flat_components(components)
        found.update((i, Candidate(layout, ISOMETRIC, 0.0, 0.0, True)) for i, layout in flat.items())
        # Copies cannot have different numbers of charts.
        with watch("check"):
            copies = [None] * len(components) if isinstance(o.charts, int) else find_copies(components, flat)
        originals = [i for i, copy in enumerate(copies) if copy is None]
        searches = {
            i: CutSearch(components[i], o.bound, steps, by_area=o.area is not None) for i in originals
        }
        minor = [i for i, search in searches.items() if is_minor[i] and i not in flat and search.may_join]
        for group in _groups(minor, sizes):
            watch.share = float(0.8 * sizes[group].sum() / sizes.sum())
            with watch("search", 1.0):
                together = MinorComponents([searches[i] for i in group]).candidates()
                found.update((i, one) for i, one in zip(group, together, strict=True) if one is not None)
            watch.end_component()
        joined = set(found)
        alone = [i for i in searches if i not in joined]
        for number, i in enumerate(alone):
            watch.component = f"component {number + 1:,} of {len(alone):,}" if len(alone) > 1 else ""
            watch.share = float(0.8 * sizes[i] / sizes.sum())
            with watch("search", 1.0):
                found[i] = searches[i].best()
            watch.end_component()
        layouts = [found[i].layout for i in searches]
        with watch("pack"):
            in_order = list(searches.values())

            def costs(i: int) -> FloatArray:
                return in_order[i].costs

            if isinstance(o.charts, int):
                layouts = cut_into(layouts, costs, o.charts)
            elif steps.separates and o.up is None and np.isfinite(o.bound):
                layouts = cut_for_packing(layouts, costs, o.padding / shared.resolution)
            for (i, search), layout in zip(searches.items(), layouts, strict=True):
                # Joined components would each need a relaxation of their own.
                one = replace(found[i], layout=layout) if i in joined else search.shortened(found[i], layout)
                found[i] = search.small_joined(one) if o.charts == "atlas" and one.layout.chart.any() else one
        with watch("measure"):
            known = {
                i: one.layout if one.layout is flat.get(i) else measured(one.layout)
                for i, one in found.items()
            }
            layouts = with_copies(known, components, copies)
            cut = [
                component.seams.is_forbidden[seam_edges(one)].sum()
                for component, one in zip(components, layouts, strict=True)
                if len(one.seams)
            ]
    shared = replace(shared, method=FREE)
    if o.texel_density is not None:
        with watch("pack"):
            scale_at = packed_scale(prepared, layouts, shared)
            resolution = least_resolution(o.texel_density, o.padding, shared.resolution, scale_at)
        shared = replace(shared, resolution=resolution)
    result = evaluate(prepared, layouts, shared)
    notes = (
        *result.notes,
        *map(Unmet, _notes(o, [one.energy for one in found.values()], int(sum(cut)), result.distortion)),
    )
    own = {name: getattr(o, name) for name in OWN if name != "seams"}
    if o.marked is not o.seams:
        own["seams"] = "none" if o.marked is None else ["none", result.settings["seams"]]
    result = replace(result, settings={**result.settings, **own}, notes=notes)
    if stacked is not None:
        return with_copies_stacked(result, stacked, prepared)
    return result if mirror is None else both_halves(result, mirror, prepared)


def quick_metric(surface: Surface, solution: ConeSolution, spec: MetricSpec) -> FlatMetric:
    """Return the exact metric if few steps find it, else the linear one: a layout with free seams starts from it."""
    try:
        return find_metric(surface, solution, spec, MAX_NEWTON_STEPS)
    except ConvergenceError:
        return find_metric(surface, solution, replace(spec, method="linear"))


def _groups(chosen: Sequence[int], sizes: FloatArray) -> Iterator[list[int]]:
    """Yield groups of at least two components with not many triangles."""
    components = np.array(chosen, dtype=np.int64)
    total = np.cumsum(sizes[components]) // MANY_TRIANGLES
    for group in np.split(components, np.flatnonzero(np.diff(total)) + 1):
        if len(group) > 1:
            yield group.tolist()


def along_sharp_edges(components: Sequence[Component]) -> list[Component]:
    """Return components that prefer seams along sharp edges, as far as these are what bends their surfaces."""
    starts = np.cumsum([0, *(len(component.vertices) for component in components)])
    mesh, count = joined_meshes([component.mesh for component in components], starts), len(components)
    angles, lengths = (
        np.abs(dihedral_angles(mesh)),
        np.concatenate([component.lengths.ravel() for component in components]),
    )
    bending = angles * lengths[mesh.edge_halfedges[:, 0]]
    of = np.arange(count).repeat(np.diff(starts))[mesh.edges[:, 0]]
    sharp = np.bincount(of, np.where(angles > SHARP, bending, 0.0), count)
    shares = sharp / np.maximum(np.bincount(of, bending, count), 1e-300)
    creases = [
        max(CREASES * share, component.seams.creases)
        for share, component in zip(shares.tolist(), components, strict=True)
    ]
    return [
        component
        if strength == component.seams.creases
        else replace(component, seams=replace(component.seams, creases=strength))
        for strength, component in zip(creases, components, strict=True)
    ]


def _notes(o: UnwrapOptions, energies: Sequence[float], cut: int, measured: Distortion) -> Iterator[str]:
    """Yield notes on energies above the bound, the number of forbidden edges that are cut, and that of charts."""
    if cut:
        yield f"{plural(cut, 'forbidden edge')} had to be cut to separate overlaps."
    above, charts = [energy for energy in energies if energy > o.bound], measured.charts
    if above:
        name, most, reached = "energy", o.bound, max(above)
        if o.area is not None:
            name, most, reached = "area distortion", o.area, ((reached - ISOMETRIC) / ENERGY_PER_AREA) ** 0.5
        yield (
            f"The {name} of {plural(len(above), 'component')} is up to {reached:.6g}, above the {most:.6g} allowed: "
            "refine the mesh, or allow more."
        )
    elif o.area is None and measured.energy > (1 + TYPED_TOLERANCE) * o.bound:
        yield (
            f"The energy is {measured.energy:.6g}, above the {o.bound:.6g} allowed, because of triangles that have "
            "nearly no area: remesh there."
        )
    if isinstance(o.charts, int) and charts != o.charts:
        why = (
            "no further cut divides one" if charts < o.charts else "components, seams and overlaps need them"
        )
        yield f"The texture has {plural(charts, 'chart')} instead of {o.charts:,}: {why}."
