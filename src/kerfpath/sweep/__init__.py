"""Many tasks at once: each done exactly once and kept, on local processes or a Dask cluster."""

from kerfpath.sweep._run import Result, run
from kerfpath.sweep._task import Failure

__all__ = ["Failure", "Result", "run"]
