"""Robots: their kinematics in closed form, their limits, and the library of known models."""

from kerfpath.robots._axis_three import level as level
from kerfpath.robots._axis_three import with_axis_3 as with_axis_3
from kerfpath.robots._backing_off import can_back_off as can_back_off
from kerfpath.robots._carried import CarriedChain as CarriedChain
from kerfpath.robots._chain import chain_of as chain_of
from kerfpath.robots._chain import model_chain as model_chain
from kerfpath.robots._chain import require_axes as require_axes
from kerfpath.robots._coupling import AXIS_3 as AXIS_3
from kerfpath.robots._coupling import Coupling as Coupling
from kerfpath.robots._enclosure import Enclosure as Enclosure
from kerfpath.robots._external import MOST_EXTERNAL as MOST_EXTERNAL
from kerfpath.robots._external import ExternalAxis as ExternalAxis
from kerfpath.robots._external import Travel as Travel
from kerfpath.robots._external import base_in_part as base_in_part
from kerfpath.robots._external import carried as carried
from kerfpath.robots._families import FAMILIES as FAMILIES
from kerfpath.robots._families import Family as Family
from kerfpath.robots._families import posture_name as posture_name
from kerfpath.robots._families import postures_named as postures_named
from kerfpath.robots._library import acceleration_ratios as acceleration_ratios
from kerfpath.robots._library import robot_ids as robot_ids
from kerfpath.robots._lowest import lowest_joint as lowest_joint
from kerfpath.robots._robot import Robot as Robot
from kerfpath.robots._robot import robot as robot
from kerfpath.robots._solutions import Solutions as Solutions
