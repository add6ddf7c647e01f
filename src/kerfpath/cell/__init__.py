"""The cell as solids: which bodies may come how near, at a joint vector and along a motion."""

from kerfpath.cell._bodies import Body as Body
from kerfpath.cell._build import cell_of as cell_of
from kerfpath.cell._caveats import UNPROVED as UNPROVED
from kerfpath.cell._caveats import caveats as caveats
from kerfpath.cell._caveats import odd_sizes as odd_sizes
from kerfpath.cell._cell import Cell as Cell
from kerfpath.cell._checker import CollisionChecker as CollisionChecker
from kerfpath.cell._head import CuttingHead as CuttingHead
from kerfpath.cell._head import MeshHead as MeshHead
from kerfpath.cell._links import link_bodies as link_bodies
from kerfpath.cell._links import link_capsules as link_capsules
from kerfpath.cell._map import Clearances as Clearances
from kerfpath.cell._map import clearances as clearances
from kerfpath.cell._mesh import Mesh as Mesh
from kerfpath.cell._mesh import weld as weld
from kerfpath.cell._pairs import MEANT as MEANT
from kerfpath.cell._shapes import Capsule as Capsule
from kerfpath.cell._shapes import Hull as Hull
from kerfpath.cell._shapes import Shape as Shape
from kerfpath.cell._shapes import box as box
from kerfpath.cell._shapes import box_between as box_between
from kerfpath.cell._shapes import frustum as frustum
from kerfpath.cell._shapes import surface as surface
from kerfpath.cell._sheet import edges_of as edges_of
from kerfpath.cell._sheet import thicken as thicken
from kerfpath.cell._stl import read_stl as read_stl
