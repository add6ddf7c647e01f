"""A plan from arrays, its audit and the fastest speed: what the package does without any extra.

Run by a test with the extras out of the way, and by `make package` where none is installed.
"""

import numpy as np

import kerfpath

t = np.linspace(0, 1, 9)
line = kerfpath.Contour(np.c_[0.1 * t, 0 * t, 0 * t], np.tile([0, 0, -1], (9, 1)))
robot = kerfpath.robot("abb_irb4600_60_205", acceleration_ratio="iontec_20_to_70kg")
tool, placement = np.eye(4), np.eye(4)
tool[:3, :3] = [[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]]
tool[:3, 3], placement[:3, 3] = [0.15, 0.0, 0.30], [1.2, 0.0, 0.5]
options = {"tool": tool, "placement": placement, "gamma_step": np.radians(20)}
made = kerfpath.plan(line, robot, speed=0.02, **options)
print([issue.code for issue in kerfpath.audit(made) if issue.level == "error"])
print(kerfpath.fastest_speed(line, robot, **options).speed > 0.02)
