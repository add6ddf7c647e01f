"""The job as text: comments kept, steps back and forward, kept beside the job, saved."""

import re
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jobs import DEMO
from kerfpath.errors import InputError
from kerfpath.studio.document import Document, with_values

TEXT = (DEMO / "b_pillar.toml").read_text()


def comments(text):
    return re.findall(r"#.*", text)


@pytest.fixture
def document(tmp_path):
    path = tmp_path / "b_pillar.toml"
    path.write_text(TEXT)
    return Document(path)


KEYS = st.sampled_from(
    [
        ("plan", "weights"),
        ("plan", "eta_velocity"),
        ("plan", "metric"),
        ("contour", 0, "speed_m_min"),
        ("contour", 6, "lead_in", "length_mm"),
        ("robot", "acceleration_deg_s2"),
        ("sequence", "heat_spacing_mm"),
    ]
)
VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-1000, 1000),
    st.floats(-1e6, 1e6, allow_subnormal=False),
    st.text("abc \"'\\\n", max_size=8),
    st.lists(st.floats(0.1, 10), max_size=6),
)


@given(st.lists(st.tuples(KEYS, VALUES), max_size=6))
def test_an_edit_changes_its_key_and_no_comment_and_nothing_else(changes):
    expected = tomllib.loads(TEXT)
    for (*way, last), value in changes:
        node = expected
        for name in way:
            if isinstance(name, str) and name not in node:
                if value is None:
                    break
                node[name] = {}
            node = node[name]
        else:
            if value is not None:
                node[last] = value
                continue
            node.pop(last, None)
            if not node and len(way) > 1:  # no empty table stays inside another one
                del expected[way[0]][way[1]][way[2]]
    made = with_values(TEXT, changes)
    assert _near(tomllib.loads(made), expected)
    assert set(comments(made)) >= {c for c in comments(TEXT) if "assumed" not in c}


def _near(one, other):
    if isinstance(other, dict):
        return one.keys() == other.keys() and all(_near(one[k], other[k]) for k in other)
    if isinstance(other, list):
        return len(one) == len(other) and all(map(_near, one, other))
    if isinstance(other, float) and not isinstance(one, bool):
        # Numbers are written to 12 digits.
        return one == pytest.approx(other, rel=1e-11, abs=1e-300)
    return one == other


def test_a_line_keeps_the_comment_behind_it():
    made = with_values(TEXT, [(("audit", "path_tolerance_mm"), 0.2)])
    (changed,) = set(made.splitlines()) - set(TEXT.splitlines())
    assert re.fullmatch(r"path_tolerance_mm = 0.2 +# between the nodes, .*", changed)
    assert len(made.splitlines()) == len(TEXT.splitlines())


@pytest.mark.parametrize(
    "key",
    [("contour", 9, "x"), ("plan", "metric", "x"), ("plan", 0), ("contour", "x", "y"), (0, "x")],
)
def test_a_key_that_cannot_be_there_is_refused_in_one_line(document, key):
    with pytest.raises(InputError, match="expected a key of a table, got") as refused:
        document.change([(key, 1)])
    assert "\n" not in str(refused.value)
    assert (document.text, document.revision, document.can_undo) == (TEXT, 1, False)


def test_numbers_are_written_as_they_are_meant():
    made = with_values(TEXT, [(("plan", "weights"), [0.1 + 0.2, 1e-7, 3.0, 4])])
    assert "weights = [0.3, 1e-07, 3.0, 4]" in made


def test_a_text_that_is_no_toml_can_be_replaced_and_undone_but_not_edited(document):
    document.replace("[plan\n")
    with pytest.raises(InputError, match="not valid TOML"):
        document.change([(("plan", "metric"), "euclid")])
    document.undo()
    assert document.text == TEXT


def test_every_change_can_be_undone_and_redone(document):
    texts = [document.text]
    for value in (0.9, 0.8, 0.7):
        document.change([(("plan", "eta_velocity"), value)])
        texts.append(document.text)
    revisions = [document.revision]
    for text in reversed(texts[:-1]):
        document.undo()
        assert document.text == text
        revisions.append(document.revision)
    assert not document.can_undo
    document.undo()
    for text in texts[1:]:
        document.redo()
        assert document.text == text
        revisions.append(document.revision)
    assert not document.can_redo
    assert revisions == sorted(set(revisions))


def test_a_change_after_undo_forgets_what_was_undone(document):
    document.change([(("plan", "eta_velocity"), 0.9)])
    document.undo()
    document.change([(("plan", "metric"), "euclid")])
    assert not document.can_redo
    document.undo()
    assert document.text == TEXT


def test_edits_of_one_key_by_one_gesture_are_one_step(document):
    for value in (0.9, 0.8, 0.7):
        document.change([(("plan", "eta_velocity"), value)], gesture="slider 1")
    document.change([(("plan", "eta_velocity"), 0.6)], gesture="slider 2")
    document.undo()
    assert "eta_velocity = 0.7" in document.text
    document.undo()
    assert document.text == TEXT


def test_a_gesture_after_undo_is_a_step_of_its_own(document):
    document.change([(("plan", "eta_velocity"), 0.9)], gesture="slider")
    document.undo()
    document.change([(("plan", "eta_velocity"), 0.8)], gesture="slider")
    document.undo()
    assert document.text == TEXT


def test_steps_that_can_be_undone_are_bounded(document, monkeypatch):
    monkeypatch.setattr("kerfpath.studio.document.MOST_STEPS", 5)
    for i in range(9):
        document.change([(("contour", 0, "speed_m_min"), i + 10)])
    for _ in range(20):
        document.undo()
    assert "speed_m_min = 13" in document.text


def test_changes_are_kept_beside_the_job_and_found_again(document):
    document.change([(("plan", "metric"), "euclid")])
    assert document.path.read_text() == TEXT
    assert document.beside.name == "b_pillar.studio.toml"
    again = Document(document.path)
    assert again.text == document.text
    assert not again.saved
    again.undo()
    assert again.text == TEXT
    assert again.saved
    assert not again.beside.exists()


def test_saving_writes_the_job_and_leaves_nothing_beside_it(document):
    document.change([(("plan", "metric"), "euclid")])
    document.save()
    assert document.path.read_text() == document.text
    assert document.saved
    assert sorted(p.name for p in document.path.parent.iterdir()) == ["b_pillar.toml"]
    document.undo()
    assert not document.saved
    assert document.file == document.beside


def test_a_job_that_something_else_has_changed_is_saved_over_only_when_asked(document):
    document.change([(("plan", "metric"), "euclid")])
    document.path.write_text("# by hand\n" + TEXT)
    with pytest.raises(InputError, match="changed since it was read"):
        document.save()
    assert document.path.read_text().startswith("# by hand")
    document.save(over=True)
    assert document.path.read_text() == document.text


def test_a_job_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        Document(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes("# Säge".encode("latin-1"))
    with pytest.raises(InputError, match="expected UTF-8"):
        Document(tmp_path / "latin.toml")


def test_a_folder_that_cannot_be_written_to_is_said(document, monkeypatch):
    def refuse(files):
        raise OSError(30, "Read-only file system", str(document.beside))

    monkeypatch.setattr("kerfpath.studio.document.write_whole", refuse)
    with pytest.raises(InputError, match=r"cannot be written .Read-only"):
        document.change([(("plan", "metric"), "euclid")])


def test_tables_are_made_inside_a_contour_and_taken_out_again():
    text = '[[contour]]\npick = "a"   # the first\n\n[[contour]]\npick = "b"\n\n[plan]\n'
    lead = [(("contour", 0, "lead_in", "length_mm"), 4), (("sequence",), {})]
    made = with_values(text, lead)
    assert tomllib.loads(made) == {
        "contour": [{"pick": "a", "lead_in": {"length_mm": 4}}, {"pick": "b"}],
        "plan": {},
        "sequence": {},
    }
    assert "# the first" in made
    back = with_values(made, [(("contour", 0, "lead_in"), None), (("sequence",), None)])
    assert tomllib.loads(back) == tomllib.loads(text)


def test_what_can_be_undone_is_bounded_in_bytes(tmp_path):
    """Of large jobs there are fewer steps; the newest are kept, and all of small jobs."""
    path = tmp_path / "job.toml"
    path.write_text("a = 0\n")
    document, large = Document(path), 6_000_000
    for k in range(20):
        document.replace(f"a = {k + 1}\n#{'x' * large}\n")
    steps = 0
    while document.can_undo:
        document.undo()
        steps += 1
        assert document.text.startswith(f"a = {20 - steps}\n")
    assert steps == 50_000_000 // large
    while document.can_redo:
        document.redo()
    assert document.text.startswith("a = 20\n")
