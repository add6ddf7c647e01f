"""How joints follow what is commanded: against closed forms of filters, levers and friction."""

from dataclasses import replace

import numpy as np
import pytest

import kerfpath
from kerfpath import InputError, Response
from kerfpath.execution import ASSUMED, IDEAL, read_response, response, sources_of

STEP = 0.002
STANDING = np.array([0.1, 0.2, 0.3, 0.4, 0.9, 0.2])
"""rad: joints away from singularities."""


@pytest.fixture(scope="module")
def robot():
    return kerfpath.robot("abb_irb6640_180_255")


def moving(joint, angle):
    """Joints (m, 6) of which one moves by the angles (m,) rad."""
    q = np.tile(STANDING, (len(angle), 1))
    q[:, joint] += angle
    return q


def test_the_low_pass_of_a_sine_is_that_of_a_gauss_function(robot):
    sigma = np.array([0.030, 0.028, 0.021, 0.017, 0.020, 0.026])
    t = np.arange(0, 4, STEP)
    for joint, each in enumerate(sigma):
        for rate in (5.0, 20.0, 40.0):
            q = moving(joint, 0.01 * np.sin(rate * t))
            found = Response(sigma=sigma).executed(q, STEP, robot)[:, joint] - STANDING[joint]
            inner = (t > 1) & (t < 3)
            share = np.exp(-((each * rate) ** 2) / 2)
            # The kernel is cut off at four deviations, which leaves 6e-5 of it out.
            expected = share * 0.01 * np.sin(rate * t)
            np.testing.assert_allclose(found[inner], expected[inner], rtol=0, atol=1e-4 * 0.01)


def test_joints_at_constant_rates_are_where_they_are_commanded(robot):
    t = np.arange(0, 2, STEP)
    q = STANDING + t[:, None] * np.linspace(-0.2, 0.2, 6)
    inner = (t > 0.5) & (t < 1.5)
    for how in (Response(sigma=[0.03]), ASSUMED):
        found = how.executed(q, STEP, robot)
        np.testing.assert_allclose(found[inner], q[inner], rtol=0, atol=1e-12)


def test_ideal_joints_do_not_lag(robot):
    q = moving(2, 0.1 * np.sin(np.arange(0, 1, STEP)))
    np.testing.assert_array_equal(IDEAL.executed(q, STEP, robot), q)
    assert IDEAL.model == "ideal"


def test_a_mass_bends_joint_1_by_the_square_of_its_lever(robot):
    t = np.arange(0, 4, STEP)
    swing, rate = 0.01, 6.0
    q = moving(0, swing * np.sin(rate * t))
    mass, inertia = 120e-6, 80e-6
    found = Response(mass=[mass, 0, 0], inertia=[inertia, 0, 0]).executed(q, STEP, robot)
    wrist = np.eye(4)
    wrist[2, 3] = -robot.arm.geometry["c4"]
    x, y = (robot.forward(STANDING) @ wrist)[:2, 3]
    acceleration = -swing * rate**2 * np.sin(rate * t)
    bent = (mass * (x * x + y * y) + inertia) * acceleration
    inner = slice(10, -10)
    # Second differences of samples 2 ms apart differ from derivatives by (rate step)^2 / 3.
    np.testing.assert_allclose(
        (found - q)[inner, 0], bent[inner], rtol=0, atol=2e-4 * np.abs(bent).max()
    )
    np.testing.assert_allclose(found[:, 3:], q[:, 3:], rtol=0, atol=1e-15)


def test_a_joint_that_reverses_lags_and_recovers(robot):
    t = np.arange(0, 6, STEP)
    turn = 3.0
    q = moving(1, 0.1 * np.abs(t - turn))
    how = Response(friction=130e-6)
    found = how.executed(q, STEP, robot)[:, 1] - q[:, 1]
    rise, recovery, since = 0.05, 0.4, t - turn
    share = recovery / (recovery - rise) * (np.exp(-since / recovery) - np.exp(-since / rise))
    lag = np.where(since > 0, -2 * 130e-6 * share, 0.0)
    after = since > 0.01
    # Steps of 2 ms against a rise of 50 ms: 4 % of the lag while it rises.
    np.testing.assert_allclose(found[after], lag[after], rtol=0, atol=0.04 * 260e-6)
    assert found.min() == pytest.approx(lag.min(), rel=0.02)
    assert abs(found[-1]) < 1e-6
    np.testing.assert_array_equal(how.without_friction().executed(q, STEP, robot), q)


def test_ends_scale_every_joint():
    low, high = ASSUMED.ends()
    assert (low.sigma[0], high.sigma[0]) == (0.015, 0.035)
    assert Response(sigma=[0.02]).ends() == ()
    six = Response(sigma=[0.01, 0.02], sigma_range=[0.01, 0.04]).ends()[1]
    np.testing.assert_allclose(six.sigma, [0.02, 0.04])


def test_the_library_says_what_its_responses_stand_on():
    for robot_id in kerfpath.robots.robot_ids():
        for source in sources_of(robot_id):
            found = response(robot_id, source)
            found.require_for(kerfpath.robot(robot_id))
            assert found.reference
            assert (found.standing == "fitted") == (found.runs > 0)
    assert response("abb_irb6640_180_255").name == "real"
    assert response("abb_irb6640_180_255", "robotstudio").model == "filter"
    assert response("abb_irb4600_60_205") is response(None) is ASSUMED
    assert "assumed" in ASSUMED.words
    real = response("abb_irb6640_180_255").words
    assert real == "lag, deflection and friction of the joints fitted to 7 runs, sigma 18.7 ms"
    mine = Response(sigma=[0.02, 0.03], standing="measured", runs=1).words
    assert mine == "lag of the joints measured in 1 run, sigma 20 to 30 ms"


def test_what_a_response_is_not():
    for about, said in (
        ({"sigma": [-0.01]}, "not below 0"),
        ({"sigma": [np.nan]}, "sigma"),
        ({"sigma": [0.02], "sigma_range": [0.03, 0.04]}, "sigma_range"),
        ({"sigma": [0.02], "sigma_range": [0.01]}, "sigma_range"),
        ({"mass": [1e-6]}, "3 numbers"),
        ({"friction": -1.0}, "friction"),
        ({"friction_rise": 0.0}, "friction_rise"),
        ({"standing": "guessed"}, "standing"),
    ):
        with pytest.raises(InputError, match=said):
            Response(**about)
    with pytest.raises(InputError, match="robotstudio, real, assumed, ideal"):
        response("abb_irb6640_180_255", "measured")
    with pytest.raises(InputError, match="assumed, ideal"):
        response("abb_irb4600_60_205", "real")


def test_a_response_that_does_not_fit_the_arm_is_refused(robot):
    with pytest.raises(InputError, match="6 joints"):
        Response(sigma=[0.01, 0.02]).executed(STANDING[None], STEP, robot)
    other = kerfpath.robot("ur10e")
    with pytest.raises(InputError, match="give only sigma"):
        replace(ASSUMED, friction=1e-4).require_for(other)
    ASSUMED.require_for(other)


def test_a_file_gives_the_response_that_it_holds(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('standing = "measured"\nruns = 3\nsigma_ms = [30, 29, 21, 17, 20, 26]\n')
    found = read_response(file)
    assert (found.standing, found.runs, found.name) == ("measured", 3, "mine.toml")
    np.testing.assert_allclose(found.sigma, np.array([30, 29, 21, 17, 20, 26]) / 1e3)
    for text, said in (
        ("sigma = 3", "got the key 'sigma'"),
        ("sigma_ms = [", "TOML"),
        ('sigma_ms = "slow"', "sigma"),
        ("reference = 3", "reference: expected one line of text"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=said) as caught:
            read_response(file)
        assert str(caught.value).startswith(f"{file}: ")
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="none"):
        read_response(tmp_path / "none.toml")
