"""Reasons for lost candidates: words for people, an enumeration for code."""

import copy
import json
import pickle

import pytest

from kerfpath import NoFeasiblePath, robot
from kerfpath.losses import Loss, Reason


@pytest.mark.parametrize(
    ("loss", "which", "words"),
    [
        (Loss.LOW, "joint 3", "joint 3 low"),
        (Loss.WINDOW, 2, "window of joint 2"),
        (Loss.COLLISION, "", "collision"),
        (Loss.COLLISION, "at the node", "collision at the node"),
        (Loss.ACCELERATION, 6, "acceleration, joint 6"),
    ],
)
def test_a_reason_is_its_words_and_knows_its_loss(loss, which, words):
    why = Reason(loss, which)
    assert why == words
    assert {words: 3} == {why: 3}
    assert json.dumps({why: 3}) == json.dumps({words: 3})
    for again in (pickle.loads(pickle.dumps(why)), copy.deepcopy(why)):
        assert (again, again.loss, again.which) == (why, loss, which)


def test_the_reasons_of_a_robot_stand_where_the_kernels_count_them():
    arm = robot("abb_irb2400_155")
    words = arm.reasons()
    assert words[Loss.ADMITTED].loss is Loss.ADMITTED
    assert words[Loss.UNREACHABLE].loss is Loss.UNREACHABLE
    for i in range(6 + len(arm.couplings)):
        assert words[Loss.LOW + 2 * i].loss is Loss.LOW
        assert words[Loss.HIGH + 2 * i].loss is Loss.HIGH
    assert [why.loss for why in words].index(Loss.UNWANTED) == len(words) - 1


def test_what_is_lost_by_a_loss_is_found_without_reading_words():
    window = Reason(Loss.WINDOW, 1)
    broken = NoFeasiblePath("", proved=True, node=0, counts={window: 2, "audit: window": 1})
    assert broken.lost_by(Loss.WINDOW) == [window]
    assert not broken.lost_by(Loss.COLLISION)
