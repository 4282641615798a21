"""Preparation of the input: connected parts, each with the specification of its cones, metric and seams."""

from .parts import Part, Source

__all__ = ["Part", "Source"]
