"""Hostile cases for `benchmarks/hostile.py`: made from seeds, run in workers, held against the package's promises."""
