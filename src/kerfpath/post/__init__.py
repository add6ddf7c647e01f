"""Robot programs: one neutral program, one preflight that refuses, one formatter per language."""

from kerfpath.post._abb import axes_from_joints as axes_from_joints
from kerfpath.post._abb import confdata as confdata
from kerfpath.post._abb import joints_from_axes as joints_from_axes
from kerfpath.post._languages import LANGUAGES as LANGUAGES
from kerfpath.post._languages import Language as Language
from kerfpath.post._languages import language as language
from kerfpath.post._preflight import ProgramIssue as ProgramIssue
from kerfpath.post._preflight import preflight as preflight
from kerfpath.post._program import Comment as Comment
from kerfpath.post._program import JointMove as JointMove
from kerfpath.post._program import LaserOff as LaserOff
from kerfpath.post._program import LaserOn as LaserOn
from kerfpath.post._program import LinearMove as LinearMove
from kerfpath.post._program import Program as Program
from kerfpath.post._program import Section as Section
from kerfpath.post._program import Step as Step
from kerfpath.post._program import Wait as Wait
from kerfpath.post._program import build_program as build_program
from kerfpath.post._rapid import rapid as rapid
from kerfpath.post._rapid_reader import ReadProgram as ReadProgram
from kerfpath.post._rapid_reader import read_rapid as read_rapid
from kerfpath.post._writer import post as post
from kerfpath.post._writer import write_program as write_program
