"""Options of `coneflat.unwrap`: its own, and those of the flattening that apply to it."""

from __future__ import annotations

from dataclasses import dataclass

from ...options import AtlasOptions, Number, RunOptions, SeamOptions, option

#: Default bound of the energy; 4 is isometric.
MAX_ENERGY = 4.1


@dataclass(frozen=True, kw_only=True)
class UnwrapOptions(SeamOptions, AtlasOptions, RunOptions):
    """Texture.

    Attributes:
        max_energy: Largest symmetric Dirichlet energy of each component, averaged by area: the sum of the squares of
            the singular values and of their inverses, 4 if nothing is stretched. A smaller value needs longer seams.
    """

    max_energy: float = option(MAX_ENERGY, Number(is_positive=True))
