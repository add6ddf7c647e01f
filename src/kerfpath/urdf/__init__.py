"""Read and write robot descriptions (URDF): joints from base to tip, limits, bodies and masses.

This package knows no kinematic families; `kerfpath.Robot.from_urdf` recognises those. It lies below
`robots` and imports nothing from it.
"""

from kerfpath.urdf._bodies import LinkBody as LinkBody
from kerfpath.urdf._carriers import ExternalJoint as ExternalJoint
from kerfpath.urdf._chain import KinematicChain as KinematicChain
from kerfpath.urdf._chain import turns as turns
from kerfpath.urdf._description import Description as Description
from kerfpath.urdf._description import read_urdf as read_urdf
from kerfpath.urdf._inertia import ChainInertia as ChainInertia
from kerfpath.urdf._inertia import joined as joined
from kerfpath.urdf._inertia import require_tensor as require_tensor
from kerfpath.urdf._srdf import read_srdf as read_srdf
from kerfpath.urdf._write import urdf_text as urdf_text
from kerfpath.urdf._xml import Joint as Joint
