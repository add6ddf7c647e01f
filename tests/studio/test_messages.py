"""What server and page say to each other: nothing in it that its page does not say."""

import json
from typing import get_args

import numpy as np
import pytest
from pydantic import ValidationError

from conftest import ROOT
from kerfpath.studio import messages
from kerfpath.studio.messages import flat, flat_or_none
from reference import studio_messages

SAMPLE = json.loads((ROOT / "tests" / "studio" / "sample.json").read_text())
SAID = {kind.model_fields["type"].default: kind for kind in get_args(messages.Said)}
TYPES = ROOT / "src" / "kerfpath" / "studio" / "client" / "messages.d.ts"


def test_the_types_of_the_page_are_those_of_the_messages():
    assert TYPES.read_text() == studio_messages.types()


def test_every_message_and_every_key_of_it_is_in_the_documentation():
    page = studio_messages.page()
    for kind in (*SAID.values(), *get_args(messages.Request)):
        for key in kind.model_fields.keys() - {"type"}:
            assert f"| `{key}` |" in page
    assert page.count("### ") >= len(SAID) + len(get_args(messages.Request))


@pytest.mark.parametrize("message", SAMPLE, ids=lambda m: m["type"])
def test_the_recorded_messages_are_those_that_the_server_says(message):
    kind = SAID[message["type"]]
    assert json.loads(kind.model_validate(message).model_dump_json()) == message


@pytest.mark.parametrize(
    "text",
    [
        "",
        "nonsense",
        "[]",
        "{}",
        '{"type": "nonsense"}',
        '{"type": "undo", "more": 1}',
        '{"type": "edit", "path": [], "value": 1}',
        '{"type": "edit", "path": ["a", "b", "c", "d", "e", "f", "g"], "value": 1}',
        '{"type": "edit", "path": [-1], "value": 1}',
        '{"type": "edit", "path": [1.5], "value": 1}',
        '{"type": "edit", "path": "plan", "value": 1}',
        '{"type": "edit", "path": ["plan"]}',
        '{"type": "map", "contour": 3}',
        '{"type": "focus", "contour": "' + "x" * 300 + '"}',
        '{"type": "reason", "contour": "a", "node": -1, "gamma": 0, "posture": 0}',
        '{"type": "reason", "contour": "a", "node": 0, "gamma": NaN, "posture": 0}',
        '{"type": "reason", "contour": "a", "node": 0, "gamma": 0, "posture": true}',
        '{"type": "edit", "path": ["a"], "value": ' + "[" * 5000 + "]" * 5000 + "}",
    ],
)
def test_what_a_page_may_not_say_is_refused(text):
    with pytest.raises(ValidationError):
        messages.parse(text)


def test_numbers_are_flat_and_null_where_they_are_not_finite():
    assert flat(np.arange(6).reshape(2, 3)) == [0, 1, 2, 3, 4, 5]
    assert flat_or_none([0.1 + 0.2, np.inf, np.nan]) == [0.3, None, None]
    assert flat([1e-12, 1.00000000049]) == [0.0, 1.0]
