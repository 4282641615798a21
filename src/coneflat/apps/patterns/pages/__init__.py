"""Pieces on pages, and the assembly guide."""
