"""How the tool turns between targets: a setting, and a word of the text where there is one."""

import pytest
from tests.post.cases import CASES

from kerfpath import InputError

WORDS = {
    "rapid": ("    SingArea\\Wrist;\n", 1),
    "krl": ("$ORI_TYPE=#JOINT", 1),
    "fanuc": (" Wjnt", None),
}
"""What a text says where the wrist goes by its joints, and how often; None: on each path motion."""
DEFAULTS = {
    "rapid": "slerp", "krl": "two-angle", "fanuc": "two-angle", "val3": "slerp",
    "inform": "slerp", "urscript": "slerp",
}  # fmt: skip

WITH_PATH = [case for case in CASES.values() if case.name in DEFAULTS]


@pytest.mark.parametrize("case", WITH_PATH, ids=str)
def test_the_controller_turns_as_the_settings_say(case):
    kinds = {case.language.controller(case.settings).orientation}
    kinds |= {
        case.language.controller(changed(case, kind)).orientation
        for kind in ("slerp", "two-angle", "wrist")
    }
    assert kinds == {"slerp", "two-angle", "wrist"}
    assert case.settings.orientation == DEFAULTS[case.name]


def changed(case, kind):
    return case.settings.model_copy(update={"orientation": kind})


def said(case, kind):
    """All that a program says, and how many path motions it has."""
    texts = case.post(case.program, changed(case, kind)).values()
    return "".join(texts).replace("\r\n", "\n")


@pytest.mark.parametrize("case", WITH_PATH, ids=str)
def test_a_wrist_that_goes_by_its_joints_is_said_where_there_is_a_word(case):
    plain, wrist = said(case, "slerp"), said(case, "wrist")
    word, count = WORDS.get(case.name, ("", 0))
    if not word:
        assert plain == wrist
        return
    assert word not in plain
    motions = sum(line[5:].startswith(("L P", "C P")) for line in wrist.splitlines())
    assert wrist.count(word) == (motions if count is None else count)
    case.reads_back(case.program, changed(case, "wrist"))


@pytest.mark.parametrize("case", [c for c in WITH_PATH if c.name in WORDS], ids=str)
@pytest.mark.parametrize("kind", ["slerp", "wrist"])
def test_a_text_that_says_otherwise_is_refused(case, kind):
    files = case.post(case.program, changed(case, kind))
    other = changed(case, "wrist" if kind == "slerp" else "slerp")
    with pytest.raises(InputError, match=r"expected|missing"):
        case.read(files, settings=other)
