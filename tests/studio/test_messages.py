"""What server and page say to each other: nothing in it that its page does not say."""

import json
import re

import numpy as np
import pytest
from pydantic import ValidationError

from conftest import ROOT
from kerfpath.studio import hub, messages
from kerfpath.studio.messages import Message, flat

PAGE = (ROOT / "src" / "kerfpath" / "studio" / "README.md").read_text()
SAMPLE = json.loads((ROOT / "tests" / "studio" / "sample.json").read_text())
SAID = {
    kind.model_fields["type"].default: kind
    for kind in vars(messages).values()
    if isinstance(kind, type) and issubclass(kind, Message) and "type" in kind.model_fields
}


@pytest.mark.parametrize("kind", sorted(SAID))
def test_every_key_of_a_message_is_on_the_page(kind):
    entry = re.search(rf"\*\*`{kind}`\*\*(.*?)(?=\n\n\*\*`|\n## )", PAGE, re.DOTALL)
    words = set(re.findall(r"[A-Za-z_]+", " ".join(re.findall(r"`([^`]*)`", entry[1]))))
    keys, tables = set(), [SAID[kind]]
    while tables:
        for name, field in tables.pop().model_fields.items():
            keys.add(name)
            tables += _messages_in(field.annotation)
    assert keys - {"type"} <= words


def _messages_in(annotation):
    if isinstance(annotation, type) and issubclass(annotation, Message):
        return [annotation]
    inner = getattr(annotation, "__args__", ())
    return [found for part in inner for found in _messages_in(part)]


def test_what_a_page_may_say_is_on_the_page():
    asked = set()
    for kind in vars(hub).values():
        if isinstance(kind, type) and issubclass(kind, hub._Strict) and "type" in kind.model_fields:
            asked |= set(kind.model_fields["type"].annotation.__args__)
            keys = set(kind.model_fields) - {"type"}
            for word in kind.model_fields["type"].annotation.__args__:
                line = next(x for x in PAGE.splitlines() if x.startswith("| ") and f"`{word}`" in x)
                assert all(f"`{key}`" in line for key in keys), word
    table = PAGE.partition("## From the server")[0]
    first = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert asked == set(re.findall(r"`(\w+)`", " ".join(first)))


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
        hub.parse(text)


def test_numbers_are_flat_and_null_where_they_are_not_finite():
    assert flat(np.arange(6).reshape(2, 3)) == [0, 1, 2, 3, 4, 5]
    assert flat([0.1 + 0.2, np.inf, np.nan]) == [0.3, None, None]
    assert flat([1e-12, 1.00000000049]) == [0.0, 1.0]
