"""Refinement off the grid: gamma and external axes are continuous, postures and turns fixed."""

from kerfpath.refiner.goals import Goal as Goal
from kerfpath.refiner.goals import GoalKind as GoalKind
from kerfpath.refiner.joint_curves import JointCurves as JointCurves
from kerfpath.refiner.rates import KeptShares as KeptShares
from kerfpath.refiner.refinement import MOST_INTERVALS as MOST_INTERVALS
from kerfpath.refiner.refinement import Binding as Binding
from kerfpath.refiner.refinement import Refinement as Refinement
from kerfpath.refiner.refinement import promise as promise
from kerfpath.refiner.refinement import quicken as quicken
from kerfpath.refiner.refinement import reduce_excess as reduce_excess
from kerfpath.refiner.refinement import refine as refine
