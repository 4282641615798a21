"""From the input to connected parts, each with what is asked of it."""

from .input_mesh import InputMesh
from .parts import Part, Prepared, Source

__all__ = ["InputMesh", "Part", "Prepared", "Source"]
