"""The bound of a plan.json by the command line: proved again, only claimed, or refused."""

import base64
import json
import zlib

import numpy as np
import pytest

from commands import assert_refused, run
from jobs import DEMO, HEAD

JOB = f"""{HEAD.replace("b_pillar.step", str(DEMO / "b_pillar.step"))}
[[contour]]
pick = "skin/hole13"
name = "hole"
speed_m_min = 3
spacing_mm = 2
[plan]
gamma_step_deg = 10
posture = "front/up"
certificate = true
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The text of a plan.json with its certificate, and its job."""
    folder = tmp_path_factory.mktemp("bound")
    job = folder / "job.toml"
    job.write_text(JOB)
    result = run("plan", job, "--out", folder / "cut")
    assert result.returncode == 0, result.stderr
    return (folder / "cut" / "plan.json").read_text(), job


@pytest.fixture
def audited(made, tmp_path):
    """Audit the plan.json after a change of its contour."""

    def by(change, *options):
        data = json.loads(made[0])
        change(data["contours"][0])
        file = tmp_path / "plan.json"
        file.write_text(json.dumps(data))
        return run("audit", file, *options)

    return by


def edited(data, name, how):
    """Change an array of the certificate's first stage."""
    packed = data["certificate"]["stages"][0][name]
    raw = zlib.decompress(base64.b64decode(packed["zlib_base64"]))
    part = how(np.frombuffer(raw, packed["type"]).reshape(packed["shape"]).copy())
    packed["zlib_base64"] = base64.b64encode(zlib.compress(part.tobytes())).decode()


def raised(data):
    data["bound"] += 0.9 * (data["cost"] - data["bound"])
    data["gap"] = (data["cost"] - data["bound"]) / data["cost"]


def line_of(result):
    """The line that says what was found of the bound."""
    (line,) = (line for line in result.stdout.splitlines() if line.endswith("[bound]"))
    return line


@pytest.mark.slow
def test_a_certificate_that_holds_is_said_to(audited, made):
    for options in ((), ("--job", made[1])):
        result = audited(lambda data: None, *options)
        assert result.returncode == 0, result.stdout
        assert "Proved again: the bound of hole." in result.stdout
        assert "not verified" not in result.stdout


def test_a_bound_without_its_certificate_is_only_claimed(audited):
    result = audited(lambda data: data.pop("certificate"))
    assert result.returncode == 0, result.stdout
    assert "Claimed, not verified: the bound of hole." in result.stdout
    assert "certificate = true" in result.stdout
    assert "Proved again" not in result.stdout


def test_a_plan_without_a_bound_claims_none(audited):
    result = audited(lambda data: (data.pop("certificate"), data.update(bound=None, gap=None)))
    assert result.returncode == 0, result.stdout
    assert "verified" not in result.stdout
    assert "Proved again" not in result.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (raised, "bound above what its certificate proves: "),
        (lambda data: data.update(gap=0.0), "gap that does not match cost and bound"),
        (lambda data: data.update(bound=None), "the plan states no bound"),
        (lambda data: data["certificate"].update(stages=[]), "it has no stage"),
        (lambda data: edited(data, "node", lambda a: a + 1), "node: expected numbers from 0 to"),
        (lambda data: edited(data, "value", lambda a: a * np.nan), "value: expected numbers up to"),
        (lambda data: edited(data, "posture", lambda a: 1 - a), "its cells leave out motions in"),
        (lambda data: edited(data, "index", lambda a: a * 0), "its cells leave out motions in"),
    ],
)
def test_a_bound_that_does_not_follow_is_an_error_in_one_line(audited, change, words):
    result = audited(change)
    assert result.returncode == 1
    assert result.stdout.splitlines()[-1] == "audit FAILED"
    line = line_of(result)
    assert line.startswith("hole: error: ")
    assert words in line
    assert "Proved again" not in result.stdout


def test_a_certificate_of_another_version_is_bad_input(audited):
    assert_refused(
        audited(lambda data: data["certificate"].update(version=2)),
        "the key contours.0.certificate.version is not known",
    )
    assert_refused(
        audited(lambda data: data["certificate"]["stages"][0]["dual"].update(type="<f8")),
        "certificate, stage 0: dual: expected numbers of type <f4",
    )
