"""A solver that reduces the distortion of a layout while the sides of seams stay rigid copies of each other."""

from .constraints import Lines, PointConstraints
from .energies import StretchEnergy
from .relax import Relaxed, relax

__all__ = ["Lines", "PointConstraints", "Relaxed", "StretchEnergy", "relax"]
