"""Studies of a job, many tasks each: on the cores of this machine or on a cluster."""

from kerfpath.study._batch import Planned as Planned
from kerfpath.study._batch import batch as batch
from kerfpath.study._job import Loaded as Loaded
from kerfpath.study._job import digest as digest
from kerfpath.study._job import loaded as loaded
