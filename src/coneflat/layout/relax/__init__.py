"""Less distortion of a layout whose seams stay rigid copies: a general solver."""

from .constraints import Lines, PointConstraints
from .energies import StretchEnergy
from .relax import Relaxed, relax

__all__ = ["Lines", "PointConstraints", "Relaxed", "StretchEnergy", "relax"]
