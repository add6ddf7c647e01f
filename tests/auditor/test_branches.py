"""Branches of a certificate: made ones are proved, and none prove more than a motion costs."""

import json
from dataclasses import replace

import numpy as np
import pytest

from certificates import every_cell, stage_of
from kerfpath import Contour, audit, plan
from kerfpath.auditor import certified_bound, checks
from kerfpath.auditor.certificate import _by_duals, _Task, certificate_inputs
from kerfpath.auditor.cover import covered, one_interval
from kerfpath.certificate import Branch
from kerfpath.certifier import certify, kept_tubes
from kerfpath.errors import CertificateRefused
from kerfpath.job.plan_file import certificate_entry, read_certificate

METRICS = ("manhattan", "euclid", "chebychev")


@pytest.fixture(scope="module")
def made(arm, tool, placement):
    """Five nodes at the limits of acceleration, certified with branches.

    Joint 6 has little room, so that few tubes are enough.
    """
    t = np.linspace(0, 0.28, 401)
    points = np.c_[0.15 * np.cos(t), 0.15 * np.sin(t), 0.02 * np.cos(2 * t)]
    axes = np.c_[-0.2 * np.cos(t), -0.2 * np.sin(t), -np.ones_like(t)]
    arc = Contour(points, axes, closed=False, name="arc").resample(count=5)
    asked = {"tool": tool, "placement": placement, "speed": 0.96, "certify": None}
    free = plan(arc, arm, **asked)
    middle, limits = free.q[:, 5].mean(), arm.joint_limits()
    lower, upper = limits.lower.copy(), limits.upper.copy()
    lower[5], upper[5] = middle - 0.1, middle + 0.1
    held = arm.with_limits(lower=lower, upper=upper, endless=[0, 0, 0, 1, 0, 0])
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("MOST_BRANCHES", 15), ("FINE", 4)):
            patch.setattr(kept_tubes, name, value)
        made = plan(arc, held, postures=(int(free.posture[0]),), **asked)
        return certify(made, gap=0.0).plan


def task_of(of):
    return _Task(*certificate_inputs(of), of)


def left_of(of):
    """All places near a plan and in its posture."""
    level = 3
    node, posture, index, q, *_ = every_cell(of, level)
    stage = stage_of(node, posture, level, index, q)
    left = covered(task_of(of).where, stage, None, lambda at: np.ones(len(at), bool))
    off = np.abs(np.angle(np.exp(1j * (left.middle - of.gamma[left.node]))))
    return left.take((off < 0.12) & (left.posture == of.posture[left.node]))


@pytest.mark.slow
def test_the_audit_proves_what_branches_claim(made):
    certificate = made.proof.certificate
    assert certificate.branches
    assert any(branch.y is not None for branch in certificate.branches)
    (row,) = (check for check in checks(made) if check.code == "bound")
    assert row.value == made.proof.bound
    assert row.value <= row.limit <= made.cost
    # Stages alone prove less: (6) binds.
    assert certified_bound(replace(certificate, branches=()), made) < made.proof.bound


def test_the_certificate_comes_back_from_its_data(made):
    certificate = made.proof.certificate
    entry = json.loads(json.dumps(certificate_entry(certificate)))
    again = read_certificate(entry)
    assert certificate_entry(again) == entry
    assert len(again.branches) == len(certificate.branches)


@pytest.mark.parametrize("metric", METRICS)
def test_no_duals_prove_more_than_a_motion_in_the_tube_costs(made, metric):
    """The plan keeps (5) and (6), so that its cost is a ceiling, and the tube is never empty."""
    of = replace(made, settings=replace(made.settings, metric=metric))
    of = replace(of, cost=_cost(of))
    task, rng = task_of(of), np.random.default_rng(7)
    at, moved = one_interval(task.where, left_of(made))
    K, n = of.q.shape
    found = []
    for _ in range(500):
        size = 10 ** rng.uniform(-2, 2)
        y = size * rng.normal(size=(K - 1, n)) * of.settings.weights
        nu = size * rng.normal(size=(K, n)) * of.settings.weights
        nu[[0, -1]] = 0.0
        rates = replace(task.every, tilt=nu[:-1] - nu[1:])
        found.append(_by_duals(rates, at, moved, y, task.prices(nu, at)))
    assert np.isfinite(found).all()
    assert max(found) <= of.cost


def _cost(of):
    each = of.settings.weights * np.abs(of.increments)
    norm = {"manhattan": 1, "euclid": 2, "chebychev": np.inf}[of.settings.metric]
    return float(np.linalg.norm(each, ord=norm, axis=1).sum())


def test_one_interval_holds_the_joints_of_all_places(made):
    left = left_of(made)
    at, _ = one_interval(task_of(made).where, left)
    arm, rng = made.robot, np.random.default_rng(5)
    for k in range(len(made.q)):
        own = left.take(left.node == k)
        assert len(own)
        gamma = (own.middle + rng.uniform(-1, 1, len(own)) * own.half)[:, None, None]
        spin = np.tile(np.eye(4), (len(own), 1, 1))
        c, s = np.cos(gamma[:, 0, 0]), np.sin(gamma[:, 0, 0])
        spin[:, 0, 0], spin[:, 0, 1], spin[:, 1, 0], spin[:, 1, 1] = c, -s, s, c
        T = made.frames[k] @ spin @ np.linalg.inv(made.T_flange_tip)
        q = arm.arm.follow(T, np.tile(at.q[k], (len(own), 1)), own.posture)
        assert (np.abs(q - at.q[k]) <= at.reach[k]).all()


def test_places_in_two_postures_have_no_interval(made):
    left = left_of(made)
    left.posture[0] = 1 - left.posture[0]
    assert one_interval(task_of(made).where, left) is None


SPOILT = {
    "missing": lambda b: b[:-1],
    "additional": lambda b: (*b, Branch(stages=())),
    "divided nowhere": lambda b: (replace(b[0], node=99), *b[1:]),
    "a shape": lambda b: tuple(
        each if each.y is None else replace(each, y=each.y[1:]) for each in b
    ),
    "too many": lambda b: b * 100,
}


@pytest.mark.parametrize("how", SPOILT)
def test_branches_that_do_not_fit_are_refused(made, how):
    certificate = made.proof.certificate
    spoilt = replace(certificate, branches=SPOILT[how](certificate.branches))
    with pytest.raises(CertificateRefused, match=r"branches|y: expected"):
        certified_bound(spoilt, made)
    wrong = audit(replace(made, proof=replace(made.proof, certificate=spoilt)))
    assert "bound" in {issue.code for issue in wrong}


def test_spoilt_duals_and_cuts_prove_no_more_than_a_cheaper_motion_costs(made):
    """A plan that seems to cost more: what is proved of it must not exceed what it does cost."""
    dear, rng = replace(made, cost=1.5 * made.cost), np.random.default_rng(11)
    certificate = made.proof.certificate
    for _ in range(3):
        branches = tuple(
            replace(
                each,
                y=None if each.y is None else each.y * rng.uniform(0.5, 2),
                gamma=each.gamma + rng.uniform(-0.2, 0.2),
            )
            for each in certificate.branches
        )
        try:
            proved = certified_bound(replace(certificate, branches=branches), dear)
        except CertificateRefused:
            continue
        assert proved <= made.cost
