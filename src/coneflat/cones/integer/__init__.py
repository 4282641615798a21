"""Cones whose curvatures are whole multiples of a quantum."""
