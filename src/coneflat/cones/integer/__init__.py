"""Cones whose curvatures are integer multiples of a quantum."""
