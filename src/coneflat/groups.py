"""Many components: copies and flat disks are computed without a search, small ones together, with progress for each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from .base.progress import component_at_work
from .cones import leaves_flat_disks
from .errors import CurvatureError, MetricError, SeamError
from .layout import is_flat_inside, lay_out_flat_disks
from .source.components import Component
from .source.copies import Copy, copied
from .stages import Layout, RelaxSpec

# Components with at most SMALL_TRIANGLES triangles are relaxed together, as one mesh of about GROUP_TRIANGLES: 13% of
# the time of 60 spheres of 320 triangles.
SMALL_TRIANGLES, GROUP_TRIANGLES = 500, 40_000


@contextmanager
def errors_of(component: Component, names_component: bool) -> Iterator[None]:
    """Run the block, whose errors name the component if the flag is set."""
    try:
        yield
    except (CurvatureError, MetricError, SeamError) as error:
        if not names_component:
            raise
        raise type(error)(f"{component.location}: {error}") from error


class ComponentProgress:
    """Progress of work on components, and the component in the errors of this work.

    Args:
        components: all components to work on.
        portion: fraction of the total work.
        names_components: errors name the component.
    """

    def __init__(self, components: Mapping[int, Component], portion: float, names_components: bool) -> None:
        self._names_components = names_components
        self._count, self._begun = len(components), 0
        triangles = sum(len(component.faces) for component in components.values())
        self._share_per_triangle = portion / max(triangles, 1)

    @contextmanager
    def at(self, component: Component) -> Iterator[None]:
        """Run the work on the next component in the block."""
        self._begun += 1
        place = f"component {self._begun:,} of {self._count:,}" if self._count > 1 else ""
        work = component_at_work(place, self._share_per_triangle * len(component.faces))
        with work, errors_of(component, self._names_components):
            yield


def groups_of_small(components: Mapping[int, Component], relax: RelaxSpec) -> list[list[int]]:
    """Return the indices of components in groups: small ones share a group and are relaxed together."""
    groups, small, capacity = list[list[int]](), list[int](), 0
    for i, component in components.items():
        size = len(component.faces)
        if relax.is_off or size > SMALL_TRIANGLES:
            groups.append([i])
            continue
        if capacity < size:
            groups.append(small := [])
            capacity = GROUP_TRIANGLES
        small.append(i)
        capacity -= size
    return groups


def lay_out_flat_components(
    components: Sequence[Component], max_triangles: float = SMALL_TRIANGLES
) -> dict[int, Layout]:
    """Return the finished layouts of components that are flat disks and do not overlap themselves.

    An isometry is their only flat metric without cones, so nothing is searched, solved or relaxed.

    Args:
        components: all components.
        max_triangles: the number of triangles from which components are not considered.
    """
    candidates = [
        i
        for i, component in enumerate(components)
        if len(component.faces) <= max_triangles
        and _may_be_flat(component)
        and (len(component.faces) <= SMALL_TRIANGLES or is_flat_inside(component.mesh, component.lengths))
    ]
    if not candidates:
        return {}
    layouts = lay_out_flat_disks(
        [components[i].mesh for i in candidates],
        [components[i].lengths for i in candidates],
        [components[i].metric.keeps_length for i in candidates],
    )
    return {i: layout for i, layout in zip(candidates, layouts, strict=True) if layout is not None}


def _may_be_flat(component: Component) -> bool:
    """Return whether a component is laid out without cones and with a free shape if it is a flat disk."""
    has_free_shape = component.metric.boundary in ("free", "lengths")
    return component.is_exact and has_free_shape and leaves_flat_disks(component.cones)


def with_copies(
    layouts: Mapping[int, Layout], components: Sequence[Component], copies: Sequence[Copy | None]
) -> list[Layout]:
    """Return the layouts of all components; a missing layout is that of the component of which it is a copy."""
    return [
        copied(layouts[copy.first], components[i], copy.scale) if copy and i not in layouts else layouts[i]
        for i, copy in enumerate(copies)
    ]
