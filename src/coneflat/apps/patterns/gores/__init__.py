"""Gores: strips between half-planes through an axis."""
