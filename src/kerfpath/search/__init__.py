"""The best path through a layered graph: each search takes a `SearchProblem`."""

from kerfpath.search._clear import CheckedEdges as CheckedEdges
from kerfpath.search._clear import FoundPath as FoundPath
from kerfpath.search._clear import find_clear as find_clear
from kerfpath.search._continuous import ContinuousPath as ContinuousPath
from kerfpath.search._continuous import ContinuousSearch as ContinuousSearch
from kerfpath.search._continuous import Effort as Effort
from kerfpath.search._continuous import GammaSamples as GammaSamples
from kerfpath.search._fastest import LeastInterval as LeastInterval
from kerfpath.search._fastest import find_least_interval as find_least_interval
from kerfpath.search._interrupted import InterruptedPath as InterruptedPath
from kerfpath.search._interrupted import Piece as Piece
from kerfpath.search._interrupted import find_interrupted as find_interrupted
from kerfpath.search._problem import METRIC_CODES as METRIC_CODES
from kerfpath.search._problem import Closure as Closure
from kerfpath.search._problem import Method as Method
from kerfpath.search._problem import Metric as Metric
from kerfpath.search._problem import ObjectiveKind as ObjectiveKind
from kerfpath.search._problem import SearchProblem as SearchProblem
from kerfpath.search._problem import rotation_limits as rotation_limits
from kerfpath.search._relax import Relaxations as Relaxations
from kerfpath.search._relax import find_relaxations as find_relaxations
from kerfpath.search._shortest import LayeredPath as LayeredPath
from kerfpath.search._shortest import find_shortest as find_shortest
from kerfpath.search._shortest import shortest_path as shortest_path
from kerfpath.search._slowed import SlowedPath as SlowedPath
from kerfpath.search._slowed import find_slowed as find_slowed
