"""Certificates with faults, drawn by a seed: what is harmful is refused, in one line."""

from dataclasses import replace

import numpy as np
import pytest

from kerfpath import Contour, InputError, plan
from kerfpath.auditor import bound_checks, certified_bound
from kerfpath.certificate import BASE
from kerfpath.certifier import bound as proving
from kerfpath.certifier import certify
from kerfpath.plans import Proof

FIELDS = ("node", "posture", "level", "index", "lift", "value", "dual")


def cut(end):
    """Part of a circle on a dome, 9 nodes."""
    t = np.linspace(0, end, 2001)
    points = np.c_[0.15 * np.cos(t), 0.15 * np.sin(t), 0.02 * np.cos(2 * t)]
    axes = np.c_[-0.2 * np.cos(t), -0.2 * np.sin(t), -np.ones_like(t)]
    return Contour(points, axes, name="cut").resample(count=9)


@pytest.fixture(scope="module")
def certified(arm, tool, placement):
    """Give the plan of a cut with its certificate."""

    def of(end):
        made = plan(
            cut(end), arm, tool=tool, placement=placement, speed=0.5,
            gamma_step=np.radians(5), postures=(0, 1),
        )  # fmt: skip
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(proving, "DROPPED", 0.02)  # more stages, so that each rules cells out
            return certify(made, gap=0.002).plan

    return of


@pytest.fixture(scope="module")
def honest(certified):
    made = certified(1.2)
    assert len(made.proof.certificate.stages) >= 4
    return made


def some_of(certificate):
    """The first stage, one in the middle and the last, with their numbers."""
    stages = list(enumerate(certificate.stages))
    return stages[0], stages[len(stages) // 2], stages[-1]


def passed(made, stage):
    """Which cells (C,) of a stage the plan's own motion passes."""
    width = 2 * np.pi / (BASE * np.exp2(stage.level.astype(float)))
    place = np.floor((made.gamma[stage.node] + np.pi) / width).astype(int)
    off = made.q[stage.node] - stage.lift * np.pi / 8
    off = np.where(made.robot.endless, 0.0, off)
    same = (stage.index == place) & (stage.posture == made.posture[stage.node])
    return same & (np.abs(off) < 1).all(axis=1)


def cells(stage, which):
    """The stage with some of its cells, in the order given."""
    return replace(stage, **{name: getattr(stage, name)[which] for name in FIELDS})


def changed(stage, name, which, how):
    part = getattr(stage, name).copy()
    part[which] = how(part[which])
    return replace(stage, **{name: part})


def multiplied(stage, K, rng):
    """Multipliers below and above zero, where a stage may have them."""
    nu = np.zeros((K, stage.lift.shape[1]))
    nu[1:-1] = rng.normal(size=nu[1:-1].shape) * np.abs(stage.dual).mean()
    return replace(stage, multipliers=nu)


def elsewhere(stage, which):
    """Some of the cells at the first node instead."""
    node = np.where(which, 0, stage.node).astype(np.int32)
    return cells(replace(stage, node=node), np.argsort(node, kind="stable"))


HARMFUL = {
    "cells of the plan dropped": lambda s, mine, _: cells(s, ~mine),
    "in another posture": lambda s, mine, _: changed(s, "posture", mine, lambda p: p ^ 1),
    "on another turn": lambda s, mine, _: changed(s, "lift", (mine, 0), lambda p: p + 16),
    "in another place": lambda s, mine, _: changed(
        s, "index", mine, lambda i: (i + BASE // 2) % BASE
    ),
    "of another size": lambda s, mine, _: changed(s, "level", mine, lambda p: p + 1),
    "at another node": lambda s, mine, _: elsewhere(s, mine),
    "levels that are no numbers": lambda s, _, __: replace(s, value=s.value * np.nan),
    "levels without end": lambda s, _, __: replace(s, value=s.value + np.inf),
    "slopes without end": lambda s, _, __: replace(s, dual=s.dual + np.float32(np.inf)),
    "no cells": lambda s, mine, _: cells(s, mine & ~mine),
    "the last node left out": lambda s, _, __: cells(s, s.node < s.node[-1]),
    "multipliers at the first node": lambda s, _, __: replace(
        s, multipliers=np.ones((9, s.lift.shape[1]))
    ),
}
"""Whatever else is true of the stage, motions are left out, or numbers are none."""

DRAWN = {
    "levels up": lambda s, some, rng: changed(s, "value", some, lambda v: v + rng.uniform(0, 2)),
    "all levels up": lambda s, _, rng: replace(s, value=s.value + rng.uniform(0, 2)),
    "levels down": lambda s, some, rng: changed(s, "value", some, lambda v: v - rng.uniform(0, 2)),
    "one cut up": lambda s, some, rng: changed(s, "value", (some, 0), lambda v: v + 1.0),
    "slopes scaled": lambda s, _, rng: replace(s, dual=s.dual * np.float32(rng.uniform(-2, 3))),
    "some slopes turned round": lambda s, some, _: changed(s, "dual", some, lambda d: -d),
    "slopes of others": lambda s, some, rng: replace(s, dual=rng.permutation(s.dual)),
    "one cell dropped": lambda s, some, _: cells(s, np.arange(len(s.node)) != some[0]),
    "cells dropped": lambda s, some, _: cells(s, np.setdiff1d(np.arange(len(s.node)), some)),
    "cells moved": lambda s, some, _: changed(s, "index", some, lambda i: (i + 1) % BASE),
    "cells on another turn": lambda s, some, rng: changed(
        s, "lift", some, lambda p: p + rng.choice([-16, 16], p.shape).astype(np.int8)
    ),
    "cells in another posture": lambda s, some, _: changed(s, "posture", some, lambda p: p ^ 1),
    "one cell twice": lambda s, some, _: cells(s, np.sort(np.append(np.arange(len(s.node)), some))),
    "multipliers": lambda s, _, rng: multiplied(s, 9, rng),
}
"""Some leave motions out, some only make the bound that follows another one."""


def claims(made, certificate, bound):
    proof = Proof(
        optimal=False, statement="", bound=bound, gap=(made.cost - bound) / made.cost,
        certificate=replace(certificate, bound=bound),
    )  # fmt: skip
    return replace(made, proof=proof)


def judged(made, certificate, bound):
    """What the audit proves; None where it refuses. It says so in one row of one line."""
    (row,) = bound_checks(claims(made, certificate, bound))
    assert "\n" not in row.title
    assert row.level == "error"
    if row.title.startswith("certificate that does not hold: "):
        assert not row.ok
        return None
    # Of the rows that it could be this one is the worst, unless the bound is above the cost.
    assert row.limit <= made.cost * (1 + 1e-9)
    assert row.ok == (bound <= row.limit)
    return row.limit


def with_stage(certificate, number, stage):
    stages = [*certificate.stages]
    stages[number] = stage
    return replace(certificate, stages=tuple(stages))


@pytest.mark.slow
def test_the_honest_certificate_proves_its_bound(honest):
    proved = judged(honest, honest.proof.certificate, honest.proof.bound)
    assert honest.proof.bound <= proved <= honest.cost


@pytest.mark.slow
@pytest.mark.parametrize("kind", HARMFUL)
def test_what_leaves_motions_out_is_refused_in_every_stage(honest, kind):
    certificate, rng = honest.proof.certificate, np.random.default_rng(1)
    for number, stage in some_of(certificate):
        mine = passed(honest, stage)
        assert set(stage.node[mine]) == set(stage.node)
        spoilt = with_stage(certificate, number, HARMFUL[kind](stage, mine, rng))
        assert judged(honest, spoilt, honest.proof.bound) is None


@pytest.mark.slow
@pytest.mark.parametrize("kind", DRAWN)
def test_no_fault_proves_more_than_a_motion_costs(honest, kind):
    # The plan is said to cost more than it does: what is proved is then the certificate's alone.
    certificate, rng = honest.proof.certificate, np.random.default_rng(sum(map(ord, kind)))
    said = replace(honest, cost=1.01 * honest.cost)
    for number, stage in some_of(certificate):
        some = rng.choice(len(stage.node), max(1, len(stage.node) // 20), replace=False)
        spoilt = with_stage(certificate, number, DRAWN[kind](stage, np.sort(some), rng))
        proved = judged(said, spoilt, honest.proof.bound)
        assert proved is None or proved <= honest.cost


@pytest.mark.slow
def test_stages_that_are_missing_or_in_another_order(honest):
    certificate, bound = honest.proof.certificate, honest.proof.bound
    stages = certificate.stages
    for kept in (stages[::-1], ()):
        assert judged(honest, replace(certificate, stages=kept), bound) is None
    # Without the first, the second may still hold every motion.
    later = judged(honest, replace(certificate, stages=stages[1:]), bound)
    assert later is None or later <= honest.cost
    # Without the last, the one before it may prove as much.
    fewer = judged(honest, replace(certificate, stages=stages[:-1]), bound)
    assert fewer is None or fewer <= honest.cost
    assert judged(honest, replace(certificate, stages=stages[:1]), bound) < bound
    twice = judged(honest, replace(certificate, stages=(*stages, stages[-1])), bound)
    assert bound <= twice <= honest.cost


@pytest.mark.slow
def test_a_bound_or_a_gap_that_is_not_what_is_proved(honest):
    certificate = honest.proof.certificate
    proved = certified_bound(certificate, honest)
    # A rounding of the cost above what is proved is too much already.
    for bound in (proved * (1 + 1e-9), honest.cost, np.inf, np.nan):
        assert not bound_checks(claims(honest, certificate, bound))[0].ok
    said = claims(honest, certificate, honest.proof.bound)
    for change in ({"gap": 0.0}, {"gap": None}, {"bound": None}, {"gap": np.nan}):
        spoilt = replace(said, proof=replace(said.proof, **change))
        assert not bound_checks(spoilt)[0].ok
    above = replace(certificate, bound=honest.cost)
    assert not bound_checks(replace(said, proof=replace(said.proof, certificate=above)))[0].ok


def test_the_certificate_of_another_task(honest, certified):
    # Of a shorter cut, at another speed: what is proved is true, and no more than that is passed.
    other = certified(1.0)
    assert other.cost < honest.cost
    certificate = honest.proof.certificate
    for of in (other, replace(honest, time=honest.time / 2), replace(honest, time=honest.time * 2)):
        said = replace(of, cost=1.01 * of.cost)
        proved = judged(said, certificate, honest.proof.bound)
        assert proved is None or proved <= of.cost
    with pytest.raises(InputError, match="node: expected numbers from 0 to 4"):
        certified_bound(certificate, shorter(honest))


def shorter(made):
    """The first five nodes of a plan."""
    nodes = slice(5)
    contour = Contour(made.contour.points[nodes], made.contour.axes[nodes], name="half")
    parts = {
        name: getattr(made, name)[nodes]
        for name in ("q", "gamma", "tilt", "posture", "turn", "time")
    }
    return replace(made, contour=contour, **parts)
