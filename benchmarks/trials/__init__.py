"""Hostile cases for `benchmarks/hostile.py`: generated from seeds, run in workers, checked against the guarantees."""
