"""Options of `coneflat.unwrap`: its own, and those of the flattening that apply to it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

from ..base import short_repr
from ..errors import OptionError
from ..options import (
    AtlasOptions,
    Choice,
    Edges,
    Kind,
    Number,
    Options,
    RunOptions,
    SeamOptions,
    as_integer,
    declarations,
    option,
    strength,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: The symmetric Dirichlet energy of an isometry, and the default bound.
ISOMETRIC, MAX_ENERGY = 4.0, 4.1
#: The energy above that of an isometry, relative to the squared area distortion, of layouts with the least energy:
#: 17 to 27 on seven models.
ENERGY_PER_AREA = 20.0
#: The default strength of cuts for packing, which are then at most a quarter of the other seams. On 25 models it adds
#: two fifths of the seams that the strength 1 adds, for three fifths of its gain.
PACKING_CUTS = 0.2
#: Texels between the charts of a lightmap. The four texels that bilinear filtering reads are at most two apart in both
#: directions, so that two charts never share any if they are 2 sqrt(2) texels apart: twice as many at half the
#: resolution, the smallest mip level that is expected to be used. They then share no block of 4 by 4 texels either.
LIGHTMAP_PADDING = 6.0
#: Texels along a side of a block of a compressed lightmap.
LIGHTMAP_BLOCK = 4
#: Largest number of texels along a side, of textures, and of charts.
MAX_RESOLUTION, MAX_TEXTURES, MAX_CHARTS = 2**16, 1000, 10_000
#: Bounds of the area distortion allowed. Below, the energy would be that of an isometry up to rounding; above, areas
#: differ by factors that no number holds.
MIN_AREA, MAX_AREA = 1e-6, 100.0


@dataclass(frozen=True)
class ChartNumber(Kind):
    """A word, or a number of charts; a text may be a number, too."""

    words: tuple[str, ...] = ("atlas", "one")
    metavar: ClassVar[str] = "atlas|one|NUMBER"
    limit: int = MAX_CHARTS

    def parse(self, name: str, value: Any) -> str | int:
        text = value if isinstance(value, str) else ""
        if text in self.words:
            return text
        typed = int(text) if text.isdecimal() and len(text) < 19 else 0
        number = typed if text else as_integer(name, value)
        if not 1 <= number <= self.limit:
            expected = ", ".join(self.words)
            raise OptionError(
                f"{name} must be {expected} or an integer from 1 to {self.limit:,}, got {short_repr(value)}"
            )
        return number


@dataclass(frozen=True, kw_only=True)
class TextureOptions:
    """Texture.

    Attributes:
        max_energy: Largest symmetric Dirichlet energy of each component, averaged by area: the sum of the squares of
            the singular values and of their inverses, 4 if nothing is stretched. A smaller value needs longer seams.
        area: Largest area distortion of each component instead of an energy: the standard deviation of the log
            conformal factor, weighted by area; from 1e-6 to 100.
        packing_cuts: Strength of cuts that only serve a tighter packing: their largest share of the seams of each
            component. With a smaller one, a cut must also gain more. 0: no such cuts; 1: components that need no seams
            are cut as well.
        texel_density: Texels per unit of length of the model, at least, instead of a resolution, which is then a
            multiple of 4 that suffices, while 4 texels less do not.
        stack: mirrored: the two halves of a model that is mirrored vertex by vertex share their texels. It is cut along
            the mirror plane, which no face may cross. copies: components that are copies of each other, moved, rotated
            or mirrored, share their texels, as do the two sides of cloth.
        lightmap: Texels along a side of a lightmap, instead of a resolution. Charts are 6 texels apart, enough
            for half the resolution, and begin at corners of blocks of 4 texels, unless padding or block_size are
            given with other values than their defaults. No texels are shared, and a .glb has the UVs as its second
            set.
        search_time: Seconds after which the search for seams ends: the best layout by then is returned, with a note.
            One layout of each component is computed in any case.
    """

    max_energy: float = option(MAX_ENERGY, Number(is_positive=True))
    area: float | None = option(None, Number(MIN_AREA, MAX_AREA, optional=True))
    packing_cuts: float = option(PACKING_CUTS, strength(1.0))
    texel_density: float | None = option(None, Number(is_positive=True, optional=True))
    stack: str = option("none", Choice(("none", "mirrored", "copies")))
    lightmap: int | None = option(None, Number(1, MAX_RESOLUTION, is_integer=True, optional=True))
    search_time: float | None = option(None, Number(0.0, optional=True))


@dataclass(frozen=True, kw_only=True)
class UnwrapOptions(TextureOptions, SeamOptions, AtlasOptions, RunOptions):
    """Texture.

    Attributes:
        seams: Edges that must be cut, as pairs of vertices; input, for the seams of the UVs in the file; or none, for
            no seams but those that open each component to a disk, which may have holes, whatever the energy. In Python,
            ("input", pairs) and ("none", pairs) combine a word with edges.
        charts: atlas: move seams and add cuts until no triangles overlap. one: a single chart per component, which may
            overlap itself. Or a number of charts: they are cut where they are narrow until there are as many.
    """

    seams: ArrayLike | str | tuple[str, ArrayLike] | None = option(
        None, Edges(("input", "none")), one_mesh=True
    )
    charts: str | int = option("atlas", ChartNumber())  # type: ignore[assignment]

    def __post_init__(self) -> None:
        if not self.max_energy > ISOMETRIC:
            raise OptionError(
                f"max_energy must be above 4, the energy of an isometry, got {self.max_energy:g}"
            )
        for first_option, second_option, are_both in (
            ("resolution", "texel_density", self._differs("texel_density") and self._differs("resolution")),
            ("area", "max_energy", self._differs("area") and self._differs("max_energy")),
            ("seams none", "max_energy", not math.isfinite(self.bound) and self._differs("max_energy")),
            ("seams none", "area", not math.isfinite(self.bound) and self._differs("area")),
            (f"stack {self.stack}", "lengths", self._differs("stack") and self.lengths is not None),
            *(("lightmap", name, self.lightmap is not None) for name in self._unfit_for_lightmaps()),
        ):
            if are_both:
                raise OptionError(
                    f"{first_option} and {second_option} cannot be combined: leave out one of them"
                )

        if self.lightmap is not None and 4 * self._lightmap_padding >= self.lightmap:
            raise OptionError(
                f"the padding of a lightmap must be below a quarter of its {self.lightmap:,} texels, got "
                f"{self._lightmap_padding:g}: give a smaller padding, or a larger lightmap"
            )

    @property
    def _lightmap_padding(self) -> float:
        """The texels between the charts of a lightmap."""
        return self.padding if self._differs("padding") else LIGHTMAP_PADDING

    def _unfit_for_lightmaps(self) -> Iterator[str]:
        """Yield the options that a lightmap excludes: its charts are in one square, and no texels are shared."""
        if self.resolution != self.lightmap and self._differs("resolution"):
            yield "resolution"
        yield from (name for name in ("texel_density", "tiles") if self._differs(name))
        if self._differs("stack"):
            yield f"stack {self.stack}"
        if self.charts == "one":
            yield "charts one"

    def with_lightmap(self) -> UnwrapOptions:
        """Return the options with the resolution, the padding and the blocks of a lightmap, if there is one."""
        if self.lightmap is None:
            return self
        return replace(
            self,
            resolution=self.lightmap,
            padding=self._lightmap_padding,
            block_size=self.block_size if self._differs("block_size") else LIGHTMAP_BLOCK,
        )

    def _differs(self, name: str) -> bool:
        """Return whether an option is not its default."""
        return bool(getattr(self, name) != declarations(UnwrapOptions)[name].default)

    @property
    def marked(self) -> Any:
        """The option `seams` for the flattening, which does not know the word none."""
        if isinstance(self.seams, tuple) and self.seams[0] == "none":
            return self.seams[1]
        return None if isinstance(self.seams, str) and self.seams == "none" else self.seams

    @property
    def has_no_bound(self) -> bool:
        """Whether the option `seams` contains the word none."""
        return self.marked is not self.seams

    @property
    def bound(self) -> float:
        """The largest energy, or the energy that belongs to the largest area distortion; infinite without a bound."""
        if self.has_no_bound:
            return math.inf
        return self.max_energy if self.area is None else ISOMETRIC + ENERGY_PER_AREA * self.area**2


#: Options that the flattening does not have, or with other values.
OWN_NAMES = (*declarations(TextureOptions), "charts", "seams")


def options_of_stages(options: UnwrapOptions) -> Options:
    """Return the options of the flattening that the stages get."""
    common = {name: getattr(options, name) for name in declarations(UnwrapOptions) if name not in OWN_NAMES}
    if options.texel_density is not None:  # the padding is limited by the largest resolution
        common["resolution"] = MAX_RESOLUTION
    return Options(**common, seams=options.marked, charts="one" if options.charts == "one" else "atlas")
