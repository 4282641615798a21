"""Measures of a parameterization, and of how it was found."""
