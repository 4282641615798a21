"""Options of `coneflat.unwrap`: its own, and those of the flattening that apply to it."""

from __future__ import annotations

from dataclasses import dataclass

from ...errors import OptionError
from ...options import AtlasOptions, Number, RunOptions, SeamOptions, option

#: The symmetric Dirichlet energy of an isometry, and the default bound.
ISOMETRIC, MAX_ENERGY = 4.0, 4.1


@dataclass(frozen=True, kw_only=True)
class UnwrapOptions(SeamOptions, AtlasOptions, RunOptions):
    """Texture.

    Attributes:
        max_energy: Largest symmetric Dirichlet energy of each component, averaged by area: the sum of the squares of
            the singular values and of their inverses, 4 if nothing is stretched. A smaller value needs longer seams.
        texel_density: Texels per unit of length of the model, at least, instead of a resolution, which is then the
            smallest multiple of 4 that suffices.
    """

    max_energy: float = option(MAX_ENERGY, Number(is_positive=True))
    texel_density: float | None = option(None, Number(is_positive=True, optional=True))

    def __post_init__(self) -> None:
        if not self.max_energy > ISOMETRIC:
            raise OptionError(
                f"max_energy must be above 4, the energy of an isometry, got {self.max_energy:g}"
            )
        if self.texel_density is not None and self.resolution != AtlasOptions.resolution:
            raise OptionError("resolution and texel_density cannot be combined: leave out one of them")
