"""Languages that others add: the worked example of the documentation, and what goes wrong."""

import re
import sys
from dataclasses import replace

import pytest

from conftest import ROOT
from kerfpath import InputError, robot
from kerfpath.post import build_program, languages, post, read_program
from programs import arc, frames, hand_plan, text_of

DOCS = ROOT / "docs" / "programs.md"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return a function that installs a module with an entry point beside kerfpath."""

    def install(code, point="acme_rapid:ACME"):
        (tmp_path / "acme_rapid.py").write_text(code)
        info = tmp_path / "acme_rapid-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme-rapid\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[kerfpath.languages]\nacme = {point}\n")
        monkeypatch.syspath_prepend(tmp_path)
        languages.cache_clear()

    yield install
    languages.cache_clear()
    sys.modules.pop("acme_rapid", None)


@pytest.fixture
def example():
    *_, code, point = re.findall(r"```(?:python|toml)\n(.*?)```", DOCS.read_text(), re.DOTALL)
    assert 'acme = "acme_rapid:ACME"' in point
    return code


@pytest.fixture(scope="module")
def program():
    return build_program([hand_plan(arc(), robot("abb_irb4600_60_205"), *frames())])


@pytest.mark.parametrize("name", sorted(languages()))
def test_every_language_says_what_is_not_proved(name):
    arms = [
        robot(arm, acceleration_ratio="iontec_20_to_70kg")
        for arm in ("abb_irb4600_60_205", "fanuc_m710ic_50", "ur_ur10e")
    ]
    arm = next(arm for arm in arms if not languages()[name].refusal(arm))
    tool, placement = frames()
    placement[0, 3] -= 0.35 * (arm.id == "ur_ur10e")  # which reaches less far
    program = build_program([hand_plan(arc(), arm, tool, placement)], retract=0.01)
    # One word: some languages fold their comments.
    said = post(replace(program, caveats=("unproved-of-capsules",)), name)
    count = sum(text.lower().count("unproved-of-capsules") for text in said.values())
    assert count == (0 if name == "csv" else 1)  # a table has no comments


def test_the_dialect_of_the_documentation_writes_its_macros(installed, example, program):
    installed(example)
    text = text_of(post(program, "acme"))
    assert text.count("AcmeBeamOn;") == text.count("AcmeBeamOff;") == 1
    assert "TriggL" not in text
    plain = text_of(post(program)).replace("TriggL", "MoveL")
    moves = [line for line in text.splitlines() if "MoveL" in line]
    # What is switched stands on a line of its own; the moves before it stop, as they did before.
    assert moves == [
        re.sub(r",tr(On|Off)", "", line) for line in plain.splitlines() if "MoveL" in line
    ]
    with pytest.raises(InputError, match="language 'acme' has no reader"):
        read_program({"x": text}, "acme", program.robot)


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("import nowhere_to_be_found", "cannot be loaded: No module named 'nowhere"),
        ("ACME = 3", "is a int, expected a kerfpath.post.Language"),
        ("from kerfpath.post.rapid import RAPID as ACME", "has the name 'rapid' of another"),
        ("OTHER = 1", "cannot be loaded: module 'acme_rapid' has no attribute 'ACME'"),
    ],
)
def test_what_cannot_be_used_is_left_out_with_a_warning(installed, code, message):
    installed(code)
    with pytest.warns(UserWarning, match=re.escape(f"language 'acme' (acme_rapid:ACME) {message}")):
        assert "acme" not in languages()
