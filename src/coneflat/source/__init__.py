"""From the input to connected parts, each with what is asked of it."""

from .parts import Part, Source

__all__ = ["Part", "Source"]
