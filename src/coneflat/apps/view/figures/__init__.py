"""Figures of meshes and flattenings, by matplotlib."""
