"""Less distortion of a layout whose seams stay rigid copies: a general solver."""

from .constraints import Lines, PointConstraints
from .energies import Derivatives, Energy, StretchEnergy
from .relax import Relaxed, relax

__all__ = ["PointConstraints", "Derivatives", "StretchEnergy", "Energy", "Lines", "Relaxed", "relax"]
