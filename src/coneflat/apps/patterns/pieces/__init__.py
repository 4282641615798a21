"""Pieces of a surface in the plane: cuts, borders, strain."""
