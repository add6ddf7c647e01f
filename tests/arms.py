"""Arms with masses: descriptions of library robots with an <inertial> in every link."""

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation
from tests.urdf.test_urdf import LIMIT, described

from kerfpath import Robot, robot
from kerfpath.dynamics import ArmDynamics
from kerfpath.urdf import ChainInertia, KinematicChain

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


def random_arm(rng, n):
    """Return an arm of n joints at random, as dynamics and as pinocchio has it."""
    model, parent = pin.Model(), 0
    origins, axes = np.tile(np.eye(4), (n, 1, 1)), rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    origins[:, :3, :3] = Rotation.random(n, rng=rng).as_matrix()
    origins[:, :3, 3] = rng.normal(0, 0.4, (n, 3))
    mass, centre = rng.uniform(1, 30, n), rng.normal(0, 0.2, (n, 3))
    body = rng.normal(0, 0.3, (n, 3, 3))
    tensor = body @ body.transpose(0, 2, 1)
    gravity = rng.normal(0, 6, 3)
    model.gravity.linear = gravity
    for i in range(n):
        pose = pin.SE3(origins[i, :3, :3], origins[i, :3, 3])
        parent = model.addJoint(parent, pin.JointModelRevoluteUnaligned(axes[i]), pose, f"j{i}")
        inertia = pin.Inertia(mass[i], centre[i], tensor[i])
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    chain = KinematicChain(origins=origins, axes=axes, end=np.eye(4))
    inertia = ChainInertia(mass=mass, centre=centre, tensor=tensor)
    return ArmDynamics(chain=chain, inertia=inertia, gravity=gravity), model


def oracle_of(model, bound, dt):
    """Return what says, by pinocchio, which pairs of increments keep torque bounds (n,) N m."""
    data = model.createData()

    def kept(q, before, after):
        rows = zip(q, (before + after) / (2 * dt), (after - before) / dt**2, strict=True)
        tau = [pin.rnea(model, data, *row) for row in rows]
        return (np.abs(np.reshape(tau, q.shape)) <= bound * (1 + 1e-9)).all(axis=1)

    return kept
