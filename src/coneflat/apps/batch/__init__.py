"""Many meshes: in local processes or on a Dask cluster, with a summary, and over what fails."""

from .jobs import Job, find_jobs
from .run import BatchSummary, run_batch

__all__ = ["BatchSummary", "Job", "find_jobs", "run_batch"]
