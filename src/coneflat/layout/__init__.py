"""From a flat metric on a disk to points in the plane."""

from .least_squares import least_squares_layout

__all__ = ["least_squares_layout"]
