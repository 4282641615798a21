"""Batches: many meshes are flattened in local processes or on a Dask cluster, and summarised in a table."""

from .jobs import Job, find_jobs
from .run import BatchSummary, run_batch

__all__ = ["BatchSummary", "Job", "find_jobs", "run_batch"]
