"""The best path through a layered graph given as bare arrays."""

from kerfpath.search._clear import Known as Known
from kerfpath.search._clear import clear_path as clear_path
from kerfpath.search._fastest import LeastInterval as LeastInterval
from kerfpath.search._fastest import least_interval as least_interval
from kerfpath.search._interrupted import InterruptedPath as InterruptedPath
from kerfpath.search._interrupted import Piece as Piece
from kerfpath.search._interrupted import interrupted_path as interrupted_path
from kerfpath.search._problem import METRIC_CODES as METRIC_CODES
from kerfpath.search._problem import Metric as Metric
from kerfpath.search._problem import ObjectiveKind as ObjectiveKind
from kerfpath.search._problem import rotation_limits as rotation_limits
from kerfpath.search._relax import Relaxations as Relaxations
from kerfpath.search._relax import least_relaxations as least_relaxations
from kerfpath.search._shortest import Closure as Closure
from kerfpath.search._shortest import LayeredPath as LayeredPath
from kerfpath.search._shortest import Method as Method
from kerfpath.search._shortest import shortest_path as shortest_path
from kerfpath.search._slowed import SlowedPath as SlowedPath
from kerfpath.search._slowed import slowed_path as slowed_path
