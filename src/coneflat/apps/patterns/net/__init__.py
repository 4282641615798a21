"""Nets: exact unfoldings of polyhedra, with glue tabs."""
