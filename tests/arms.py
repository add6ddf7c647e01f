"""Arms with masses: descriptions of library robots with an <inertial> in every link."""

import numpy as np
from tests.urdf.test_urdf import LIMIT, described

from kerfpath import Robot, robot

MASSES = (180.0, 150.0, 70.0, 30.0, 12.0, 3.0)
"""kg: about those of an arm that carries 60 kg."""
EFFORTS = (6000.0, 6000.0, 3000.0, 900.0, 600.0, 300.0)
"""N m: more than it needs to stand stretched out."""


def inertial(mass, centre, tensor, rpy=(0.0, 0.0, 0.0)):
    xx, xy, xz, _, yy, yz, _, _, zz = np.ravel(tensor)
    words = [" ".join(repr(float(v)) for v in row) for row in (centre, rpy)]
    return (
        f'<inertial><origin xyz="{words[0]}" rpy="{words[1]}"/><mass value="{float(mass)!r}"/>'
        f'<inertia ixx="{float(xx)!r}" ixy="{float(xy)!r}" ixz="{float(xz)!r}" '
        f'iyy="{float(yy)!r}" iyz="{float(yz)!r}" izz="{float(zz)!r}"/></inertial>'
    )


def random_inertial(rng, mass):
    """An inertial element of a body of about 0.4 m; its centre 0.2 m off, its axes turned."""
    body = rng.normal(0.0, 0.15, (3, 3))
    tensor = mass * (body @ body.T + 0.01 * np.eye(3))
    return inertial(mass, rng.normal(0.0, 0.15, 3), (tensor + tensor.T) / 2, rng.normal(0, 1, 3))


def described_with_masses(tmp_path, name, seed=0, *, gauge=None, inside=None, tool=True):
    """Write a library robot as a URDF whose links have masses; the fixed tool0 one, too."""
    rng = np.random.default_rng(seed)
    limit = inside or LIMIT
    path = described(tmp_path, robot(name), gauge=gauge, inside=limit)
    text = path.read_text()
    bodies = {f"link_{i + 1}": random_inertial(rng, mass) for i, mass in enumerate(MASSES)}
    if tool:
        bodies["tool0"] = random_inertial(rng, 1.5)
    bodies["base"] = random_inertial(rng, 300.0)
    for link, element in bodies.items():
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{element}</link>')
    if inside is None:
        for i, effort in enumerate(EFFORTS):
            before, after = text.split(f'<joint name="j{i + 1}"')
            after = after.replace('effort="1"', f'effort="{effort}"', 1)
            text = f'{before}<joint name="j{i + 1}"{after}'
    path.write_text(text)
    return path


def arm_with_masses(tmp_path, name="abb_irb4600_60_205", seed=0, **limits):
    """A library robot with masses, and its limits."""
    known = robot(name, acceleration_ratio=limits.pop("ratio", None))
    given = {
        "lower": known.lower, "upper": known.upper, "velocity": known.velocity,
        "acceleration": known.acceleration, "endless": known.endless,
    }  # fmt: skip
    return Robot.from_urdf(described_with_masses(tmp_path, name, seed), **{**given, **limits})


def job_of_arm(folder, text, load="mass_kg = 25\ncentre_mm = [0, 0, 120]", robot_keys="", seed=0):
    """Return a job's text with the demo's robot described, masses and all, and a load."""
    described_with_masses(folder, "abb_irb4600_60_205", seed)
    known = robot("abb_irb4600_60_205")
    lines = [
        'urdf = "arm.urdf"',
        'manufacturer = "ABB"',
        f"lower_deg = {np.degrees(known.lower).round(6).tolist()}",
        f"upper_deg = {np.degrees(known.upper).round(6).tolist()}",
        f"velocity_deg_s = {np.degrees(known.velocity).round(6).tolist()}",
        robot_keys,
    ]
    text = text.replace('model = "abb_irb4600_60_205"', "\n".join(lines))
    return text.replace("[tool]\n", f"[tool]\n{load}\n")
