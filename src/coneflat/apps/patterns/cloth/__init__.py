"""Cloth: the shortest seams within a bound of the strain."""
