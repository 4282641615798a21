"""Angle based flattening, linear and to the end."""
