"""The audit's own dynamics, against pinocchio and against the planner's; what it finds."""

import numpy as np
import pinocchio as pin
import pytest
from tests.arms import described_with_masses
from tests.test_dynamics import LOAD, model_of, motions

from kerfpath.auditor.dynamics import LagrangeArm


@pytest.mark.parametrize("load", [None, LOAD])
def test_lagrange_agrees_with_pinocchio(tmp_path, load):
    from kerfpath import Robot
    from kerfpath.dynamics import Load

    path = described_with_masses(tmp_path, "ur_ur10e", 3, gauge=np.random.default_rng(3))
    gravity = (1.0, -2.0, -9.0)
    arm = Robot.from_urdf(path, acceleration=np.ones(6)).with_load(
        load or Load(mass=0.0), gravity=gravity
    )
    q, v, a = motions(2, 60)
    model = model_of(path, load, gravity)
    data = model.createData()
    want = np.array([pin.rnea(model, data, *row) for row in zip(q, v, a, strict=True)])
    # Differences of M over 1e-5 rad: 1e-10 of it, a thousand kg m^2, times v^2 of ten.
    found = LagrangeArm.of(arm).torque(q, v, a)
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-8 * np.abs(want).max())
    M, g = LagrangeArm.of(arm).inertia(q)
    np.testing.assert_allclose(M, [mass_matrix(model, data, row) for row in q], atol=1e-9)
    still = [pin.computeGeneralizedGravity(model, data, row).copy() for row in q]
    np.testing.assert_allclose(g, still, atol=1e-9)


def mass_matrix(model, data, q):
    M = np.triu(pin.crba(model, data, q))
    return M + np.triu(M, 1).T
