"""The audit's own proof of a certificate: what it claims of steps, cells and whole motions."""

from dataclasses import replace

import numpy as np
import pytest

from certificates import every_cell, flat, grid_values, increments, stage_of
from conftest import pose
from kerfpath import Contour, InputError, plan, robot
from kerfpath.auditor import certificate as certificate_module
from kerfpath.auditor import certified_bound, checks
from kerfpath.auditor import steps as steps_module
from kerfpath.auditor.certificate import EVEN, _rates, _Task, certificate_inputs
from kerfpath.auditor.cover import covered
from kerfpath.auditor.steps import candidates, reduced_costs
from kerfpath.certificate import Certificate
from kerfpath.plans import Proof

ROUNDING = 1e-9
"""Of costs around 10; the slack of (5), 1e-9 rad, times weights of about 10."""


def line(count, length=0.12):
    x = np.linspace(-length / 2, length / 2, count)
    points = np.c_[x, 0.3 * x**2, 0 * x]
    return Contour(points, np.c_[-0.3 * x, 0 * x, -np.ones(count)], name="line")


@pytest.fixture(scope="module")
def made(arm, tool, placement):
    """A short cut in small steps, all postures."""
    return plan(
        line(9), arm, tool=tool, placement=placement, speed=0.1, gamma_step=np.radians(5),
        refine=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def turning():
    """A cobot with two turns of its last joint, none endless."""
    arm = robot("ur_ur10e").with_limits(
        lower=np.radians([-170, -170, -170, -170, -170, -360]),
        upper=np.radians([170, 170, 170, 170, 170, 360]),
        acceleration=np.full(6, 15.0),
    )
    tool = pose([0, 0.05, 0.1], [[1, 0, 0], [0, 0.8, 0.6], [0, -0.6, 0.8]])
    return plan(
        line(5), arm, tool=tool, placement=pose([0.6, 0.2, 0.2]), speed=0.1,
        gamma_step=np.radians(5),
    )  # fmt: skip


def claims(of, certificate, bound):
    proof = Proof(
        optimal=False, statement="", bound=bound, gap=(of.cost - bound) / of.cost,
        certificate=replace(certificate, bound=bound),
    )  # fmt: skip
    return replace(of, proof=proof)


def row(of):
    (found,) = (check for check in checks(of) if check.code == "bound")
    return found


def potential(of, level=0, multipliers=None):
    """A certificate from the value function over the cells' middles."""
    node, posture, index, q, _, reach = every_cell(of, level)
    value = grid_values(of, node, q, reach, certificate_inputs(of)[1].velocity[0])
    stage = stage_of(node, posture, level, index, q, np.c_[value, value], None, multipliers)
    return Certificate(bound=0.0, stages=(stage,))


@pytest.mark.parametrize("which", ["made", "turning"])
def test_least_distances_are_a_bound(which, request):
    of = request.getfixturevalue(which)
    bound = certified_bound(flat(of), of)
    assert -ROUNDING <= bound <= of.cost


@pytest.mark.parametrize("metric", ["manhattan", "euclid", "chebychev"])
@pytest.mark.parametrize("which", ["made", "turning"])
def test_no_step_costs_less_than_is_claimed(which, metric, request):
    # Any pair of cells, any potential, any tilt: sampled steps between them by the closed form.
    of, rng = request.getfixturevalue(which), np.random.default_rng(3)
    settings = replace(of.settings, metric=metric)
    of = replace(of, settings=settings)
    where, rates = certificate_inputs(of)
    K, n = of.q.shape
    rates = replace(
        rates, velocity=rates.velocity * 20, tilt=rng.normal(size=(K - 1, n)) * rates.weights
    )
    level = 3
    node, posture, index, q, *_ = every_cell(of, level)
    near = rng.permutation(np.unique(index))[:40]
    C = len(node)
    value = rng.normal(size=(C, 2))
    dual = (rng.normal(size=(C, 2, n)) * rates.weights * 1.5).astype(np.float32).astype(float)
    stage = stage_of(node, posture, level, index, q, value, dual)
    at = covered(where, stage, None, None)
    at = at.take(np.isin(at.index, near))
    value, dual = value[at.cell], dual[at.cell]
    pairs = list(candidates(rates, at))
    a, b = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
    some = rng.permutation(len(a))[:3000]
    a, b = a[some], b[some]
    claimed = reduced_costs(rates, at, value, dual, a, b)
    width = 2 * np.pi / (72 << level)
    middle = -np.pi + width * (at.index + 0.5)
    seen = 0
    for _ in range(12):
        t = rng.choice([-1, 1, 0.3, -0.6], (2, len(a))) * width / 2
        ends = []
        for which_end, c in enumerate((a, b)):
            turn = np.tile(np.eye(4), (len(c), 1, 1))
            g = middle[c] + t[which_end]
            turn[:, 0, 0] = turn[:, 1, 1] = np.cos(g)
            turn[:, 1, 0], turn[:, 0, 1] = np.sin(g), -np.sin(g)
            T = of.frames[at.node[c]] @ turn @ np.linalg.inv(of.T_flange_tip)
            joints, reach = of.robot.arm.inverse_all(np.ascontiguousarray(T))
            rows = np.arange(len(c))
            off = joints[rows, at.posture[c]] - at.q[c]
            off -= 2 * np.pi * np.round(off / (2 * np.pi))
            ends.append((off, reach[rows, at.posture[c]]))
        (off_a, ok_a), (off_b, ok_b) = ends
        u = at.q[b] + off_b - at.q[a] - off_a
        u = np.where(rates.endless, u - 2 * np.pi * np.round(u / (2 * np.pi)), u)
        ok = ok_a & ok_b & (np.abs(u) <= rates.velocity[0]).all(1)
        sized = rates.weights * np.abs(u)
        rho = {
            "manhattan": sized.sum(1), "euclid": np.sqrt((sized**2).sum(1)),
            "chebychev": sized.max(1),
        }[metric]  # fmt: skip
        after = (value[b] - (dual[b] * off_b[:, None]).sum(-1)).max(1)
        before = (value[a] - (dual[a] * off_a[:, None]).sum(-1)).max(1)
        true = rho + (rates.tilt[at.node[a]] * u).sum(1) + after - before
        assert (claimed[ok] <= true[ok] + ROUNDING).all()
        seen += ok.sum()
    assert seen > 3000


@pytest.mark.parametrize("which", ["made", "turning"])
def test_the_pairs_are_those_that_a_step_may_join(which, request):
    of = request.getfixturevalue(which)
    where, rates = certificate_inputs(of)
    rates = replace(rates, velocity=rates.velocity * 5)
    node, posture, index, q, *_ = every_cell(of)
    at = covered(where, stage_of(node, posture, 0, index, q), None, None)
    at = at.take(at.node < 3)
    found = [pair for pairs in candidates(rates, at) for pair in zip(*pairs, strict=True)]
    wanted = set()
    for k in range(2):
        here, there = np.flatnonzero(at.node == k), np.flatnonzero(at.node == k + 1)
        u = increments(of, at.q[here], at.q[there])
        room = rates.velocity[0] + at.reach[here][:, None] + at.reach[there][None] + 1e-9
        wanted |= {(here[i], there[j]) for i, j in np.argwhere((np.abs(u) <= room).all(-1))}
    assert len(found) == len(set(found))
    assert set(found) == wanted


@pytest.mark.parametrize("metric", ["manhattan", "euclid", "chebychev"])
@pytest.mark.parametrize("which", ["made", "turning"])
def test_a_step_costs_at_least_the_distance_of_its_cells(which, metric, request):
    # Without a potential: of every two boxes of joints, as far apart as they are.
    of = request.getfixturevalue(which)
    of = replace(of, settings=replace(of.settings, metric=metric))
    where, rates = certificate_inputs(of)
    # No joint goes so far that it could come round the other way.
    rates = replace(rates, velocity=np.minimum(rates.velocity * 20, 2.0))
    node, posture, index, q, *_ = every_cell(of)
    at = covered(where, stage_of(node, posture, 0, index, q), None, None)
    at = at.take(at.node < 2)
    at = at.take((at.reach < 0.5).all(1))
    pairs = list(candidates(rates, at))
    a, b = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
    value, dual = np.zeros((len(at), 2)), np.zeros((len(at), 2, q.shape[1]))
    least = reduced_costs(rates, at, value, dual, a, b)
    u = np.abs(at.q[b] - at.q[a])
    u = np.where(rates.endless, np.minimum(u % (2 * np.pi), -u % (2 * np.pi)), u)
    apart = rates.weights * np.maximum(u - at.reach[a] - at.reach[b], 0.0)
    rho = {
        "manhattan": apart.sum(1), "euclid": np.sqrt((apart**2).sum(1)), "chebychev": apart.max(1),
    }[metric]  # fmt: skip
    # The steps between them are taken 1e-9 rad wider, times weights of about 10.
    assert (least - rho).min() >= -1e-7
    assert (rho > 1).sum() > 100


@pytest.mark.parametrize("which", ["made", "turning"])
def test_costs_that_are_not_held_are_worked_out_again(which, request, monkeypatch):
    of = request.getfixturevalue(which)
    certificate = potential(of) if which == "made" else flat(of)
    bound = certified_bound(certificate, of)
    monkeypatch.setattr(certificate_module, "MOST_HELD", 1000)
    monkeypatch.setattr(steps_module, "FOUND_AT_ONCE", 700)
    monkeypatch.setattr(steps_module, "AT_ONCE", 300)
    assert certified_bound(certificate, of) == bound


@pytest.mark.slow
def test_one_step_is_bounded_by_the_nearest_pair_of_poses(arm, tool, placement):
    # Without a potential, ever finer: the least over both gammas, as a dense scan has it.
    of = plan(
        line(2, 0.015), arm, tool=tool, placement=placement, speed=0.1,
        gamma_step=np.radians(5), postures=[0],
    )  # fmt: skip
    grid = np.linspace(-np.pi, np.pi, 1441)[:-1]
    ends = []
    for frame in of.frames:
        turn = np.tile(np.eye(4), (len(grid), 1, 1))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(grid)
        turn[:, 1, 0], turn[:, 0, 1] = np.sin(grid), -np.sin(grid)
        q, reach = arm.arm.inverse_all(frame @ turn @ np.linalg.inv(tool))
        inside = (q[:, 0] >= arm.lower - 1e-9) & (q[:, 0] <= arm.upper + 1e-9) | arm.endless
        ends.append(q[reach[:, 0] & inside.all(1), 0])
    u = increments(of, *ends)
    cost = np.abs(u) @ of.settings.weights
    least = cost[(np.abs(u) <= certificate_inputs(of)[1].velocity[0]).all(-1)].min()
    stages, bounds = [], []
    for level in range(6):
        stages += flat(of, level).stages
        bounds.append(certified_bound(Certificate(bound=0.0, stages=tuple(stages)), of))
    assert (np.diff(bounds) >= 0).all()
    # A scan of a quarter of a degree: steps of 4e-3 rad times weights.
    assert bounds[-1] <= least
    assert bounds[-1] > 0.9 * least


@pytest.mark.parametrize("scale", [0.0, 0.5, 1.0, 1.5])
def test_no_potential_proves_more_than_a_motion_costs(made, scale):
    # What the plan is said to cost is out of the way: the bound is the certificate's alone.
    rng = np.random.default_rng(4)
    said = replace(made, cost=1e6)
    (stage,) = potential(made).stages
    value = scale * stage.value + 0.02 * rng.normal(size=stage.value.shape)
    w = made.settings.weights
    dual = (w * rng.uniform(-0.3, 0.3, stage.dual.shape)).astype(np.float32)
    nu = np.zeros(made.q.shape)
    nu[1:-1] = 0.02 * w * rng.normal(size=nu[1:-1].shape)
    for multipliers in (None, nu):
        changed = replace(stage, value=value, dual=dual, multipliers=multipliers)
        assert certified_bound(Certificate(bound=0.0, stages=(changed,)), said) <= made.cost


def test_multipliers_cost_no_motion_that_keeps_the_acceleration(made):
    rng = np.random.default_rng(5)
    task = _Task(*certificate_inputs(made), made)
    K, n = made.q.shape
    nu = np.zeros((K, n))
    nu[1:-1] = rng.normal(size=(K - 2, n))
    (stage,) = flat(made).stages
    tilted = _rates(replace(stage, multipliers=nu), task.every)
    u, at = made.increments, task.where
    places = covered(at, stage, None, lambda found: np.ones(len(found), bool))
    first = np.searchsorted(places.node, np.arange(K))
    price = task.prices(nu, places.take(first)).sum()
    usable = made.settings.limits(made.robot).acceleration.per_interval(made.dt)
    change = usable * (1 + EVEN) ** 2 + 1e-9
    assert (np.abs(np.diff(u, axis=0)) <= change).all()
    direct = (nu[1:-1] * np.diff(u, axis=0)).sum() - (np.abs(nu[1:-1]) * change).sum()
    assert (tilted.tilt * u).sum() - price == pytest.approx(direct, abs=1e-9)
    assert direct <= 0


def test_the_check_passes_a_bound_that_is_proved_and_no_other(made):
    certificate = flat(made)
    bound = certified_bound(certificate, made)
    assert row(claims(made, certificate, bound)).ok
    assert not row(claims(made, certificate, bound + 1e-3)).ok
    above = claims(made, certificate, bound)
    assert not row(replace(above, proof=replace(above.proof, gap=0.0))).ok
    assert not row(replace(above, proof=replace(above.proof, bound=None))).ok
    assert [check for check in checks(made) if check.code == "bound"] == []


def passed(of):
    """Cells of the certificate without a potential that the plan's own motion passes, as a mask."""
    node, posture, index, q, *_ = every_cell(of)
    u = q - of.q[node]
    u = np.where(of.robot.endless, u - 2 * np.pi * np.round(u / (2 * np.pi)), u)
    mine = np.floor((of.gamma + np.pi) / (2 * np.pi) * 72) % 72
    return (index == mine[node]) & (posture == of.posture[node]) & (np.abs(u) < 1).all(1)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda s, mine: {name: getattr(s, name)[~mine] for name in FIELDS},
        lambda s, mine: {"lift": np.where(mine[:, None], s.lift + 16, s.lift).astype(np.int8)},
        lambda s, mine: {"posture": np.where(mine, s.posture ^ 1, s.posture).astype(np.int8)},
        lambda s, mine: {"index": np.where(mine, (s.index + 1) % 72, s.index).astype(np.int32)},
    ],
    ids=["dropped", "another turn", "another posture", "another interval"],
)
def test_cells_that_leave_motions_out_are_refused(turning, spoil):
    (stage,) = flat(turning).stages
    mine = passed(turning)
    assert mine.sum() == len(turning.q)
    spoilt = Certificate(bound=0.0, stages=(replace(stage, **spoil(stage, mine)),))
    with pytest.raises(InputError, match="leave out motions in posture"):
        certified_bound(spoilt, turning)
    found = row(claims(turning, spoilt, 0.0))
    assert not found.ok
    assert "leave out motions" in found.title


FIELDS = ("node", "posture", "level", "index", "lift", "value", "dual")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: {"node": s.node + 1}, "node: expected numbers from 0 to 8"),
        (lambda s: {"node": s.node[::-1]}, "in the order of nodes"),
        (lambda s: {"posture": s.posture + np.int8(8)}, "posture: expected numbers from 0 to 7"),
        (lambda s: {"level": s.level - np.int8(1)}, "level: expected numbers from 0"),
        (lambda s: {"index": s.index + 1}, "not on the circle"),
        (lambda s: {"lift": s.lift[:, :5]}, "lift: expected shape"),
        (lambda s: {"value": s.value[:-1]}, "value: expected shape"),
        (lambda s: {"value": s.value * np.nan}, "value: expected numbers up to"),
        (lambda s: {"dual": s.dual + np.float32(np.inf)}, "dual: expected numbers up to"),
        (lambda s: {"node": s.node.astype(float)}, "node: expected integers"),
        (lambda s: {"multipliers": np.zeros((8, 6))}, "multipliers: expected shape"),
        (lambda s: {"multipliers": np.ones((9, 6))}, "zeros at the first node"),
        (lambda s: {"multipliers": np.full((9, 6), np.nan)}, "multipliers: expected numbers"),
        (lambda s: {name: getattr(s, name)[:0] for name in FIELDS}, "leave out motions"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(made, change, words):
    (stage,) = flat(made).stages
    spoilt = Certificate(bound=0.0, stages=(replace(stage, **change(stage)),))
    with pytest.raises(InputError, match=words):
        certified_bound(spoilt, made)


def test_plans_of_which_nothing_is_proved_are_refused(made):
    certificate = flat(made)
    largest = replace(made, settings=replace(made.settings, objective="max"))
    uneven = replace(made, time=made.time * np.linspace(1, 1.1, len(made.time)))
    for of, words in ((largest, "objective 'max'"), (uneven, "a feed that is not constant")):
        with pytest.raises(InputError, match=words):
            certified_bound(certificate, of)
    with pytest.raises(InputError, match="no stage"):
        certified_bound(replace(certificate, stages=()), made)


def test_the_certificate_of_another_plan_is_refused_or_proves_what_is_true(made, placement):
    other = placement.copy()
    other[:3, 3] += [0.1, -0.3, 0.05]
    shifted = replace(made, T_base_part=other)
    try:
        bound = certified_bound(potential(made), replace(shifted, cost=1e6))
    except InputError as error:
        assert "leave out motions" in str(error)  # noqa: PT017  # either is right
    else:
        again = plan(
            shifted.contour, made.robot, tool=made.T_flange_tip, placement=other, speed=0.1,
            gamma_step=np.radians(5),
        )  # fmt: skip
        assert bound <= again.cost
