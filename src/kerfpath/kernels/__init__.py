"""The paper in numba (Dolgui and Pashkevich 2008), one module per subject.

The package uses the notation of the paper:

====================  ===============================================================
K, k                  number of nodes (n + 1 in the paper), and one of them
p_k, n_k, a_k         tool tip, tool axis (from nozzle into part), direction of travel
H_k, L_k(gamma)       task frame (a, n x a, n, p), and H_k R_z(gamma)
gamma, mu             free rotation about the tool axis, posture
q, dq                 joints and their increment from node to node, rad
eta_v, eta_a          share of the velocity and acceleration limits that may be used
rho_a                 distance in the weighted joint space, a = E, M or C
(k, j), d*_{k,j}      vertex j of layer k, and the cost of the best path to it
M_dist, M_ind         out_dist and out_before: cost and best predecessor
====================  ===============================================================
"""

from kerfpath.kernels.alone import config  # before numba is imported elsewhere
from kerfpath.kernels.cache import CACHE, is_kept

assert config

__all__ = ["CACHE", "EQUATIONS", "is_kept"]

EQUATIONS = {
    1: "kerfpath.contour.contour:Contour.resample",
    2: "kerfpath.kernels.frames:location",
    3: "kerfpath.kernels.kinematics:forward",
    4: "kerfpath.kernels.kinematics:inverse",
    5: "kerfpath.kernels.limits:velocity_excess",
    6: "kerfpath.kernels.limits:acceleration_excess",
    7: "kerfpath.kernels.metric:total_displacement",
    8: "kerfpath.kernels.metric:largest_increment",
    9: "kerfpath.kernels.metric:coordinate_range",
    10: "kerfpath.graph:build",
    11: "kerfpath.graph:LayeredGraph",
    12: "kerfpath.kernels.search:windows",
    13: "kerfpath.kernels.metric:increment",
    14: "kerfpath.kernels.metric:total_distance",
    15: "kerfpath.kernels.metric:maximum_distance",
    16: "kerfpath.kernels.search:path_planning",
}
"""Where each numbered equation of the paper is implemented; a test checks the list."""
