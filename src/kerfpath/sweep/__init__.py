"""Sweeps: many tasks, each done exactly once and stored, on local processes or a Dask cluster."""

from kerfpath.progress import Progress
from kerfpath.sweep.store import Result, Sweep, run
from kerfpath.sweep.task import Failure, UnfitWorker

__all__ = ["Failure", "Progress", "Result", "Sweep", "UnfitWorker", "run"]
