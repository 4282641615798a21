"""Figures of meshes and flattenings, drawn with matplotlib."""
