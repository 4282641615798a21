"""From a flat metric on a disk to points in the plane."""

from .arrange import arrange
from .least_squares import least_squares_layout

__all__ = ["arrange", "least_squares_layout"]
