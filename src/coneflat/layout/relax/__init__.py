"""Less distortion of a layout whose seams stay rigid copies: a general solver."""

from .constraints import Constraints, Lines
from .energies import Derivatives, Distortion, Energy
from .relax import Relaxed, relax

__all__ = ["Constraints", "Derivatives", "Distortion", "Energy", "Lines", "Relaxed", "relax"]
