"""Read and write robot descriptions (URDF): joints from base to tip, limits, bodies and masses.

This package knows no kinematic families; `kerfpath.Robot.from_urdf` recognises those. It lies below
`robots` and imports nothing from it.
"""

from kerfpath.urdf.chain import ExternalJoint as ExternalJoint
from kerfpath.urdf.chain import KinematicChain as KinematicChain
from kerfpath.urdf.chain import turns as turns
from kerfpath.urdf.description import ChainInertia as ChainInertia
from kerfpath.urdf.description import Description as Description
from kerfpath.urdf.description import LinkBody as LinkBody
from kerfpath.urdf.description import joined as joined
from kerfpath.urdf.description import read_srdf as read_srdf
from kerfpath.urdf.description import read_urdf as read_urdf
from kerfpath.urdf.description import require_tensor as require_tensor
from kerfpath.urdf.semantics import EndEffector as EndEffector
from kerfpath.urdf.semantics import Group as Group
from kerfpath.urdf.semantics import Semantics as Semantics
from kerfpath.urdf.semantics import read_semantics as read_semantics
from kerfpath.urdf.tree import Joint as Joint
from kerfpath.urdf.tree import urdf_text as urdf_text
