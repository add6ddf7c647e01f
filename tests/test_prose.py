"""The prose: words that are not used are found in every kind of text, and spelling is checked."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import terms
from conftest import ROOT

TYPOS = shutil.which("typos", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
WORDS = terms.words()
IDS = [term.words for term in WORDS]


def where(term):
    """A page that a term holds for."""
    return term.where[0].replace("*.md", "docs/page.md").replace("*", "docs/page.md", 1)


@pytest.mark.slow
def test_no_text_has_a_word_that_is_not_used(capsys):
    assert terms.main() == 0, capsys.readouterr().out


@pytest.mark.parametrize("term", WORDS, ids=IDS)
def test_a_word_is_found_in_its_wrong_sentence_and_not_in_its_right_one(term):
    (finding,) = terms.findings(f"A title\n\n{term.wrong}", where(term))
    assert (finding.line, finding.term) == (3, term)
    assert not list(terms.findings(term.right, where(term)))


def test_the_glossary_lists_the_words_that_are_not_used():
    glossary = (ROOT / "docs/glossary.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (.*) \| (.*) \|$", glossary.partition(terms.LISTED)[2], re.MULTILINE)
    assert rows[2:] == [(term.words, term.instead) for term in WORDS]


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("a.md", "# Title\n\nThe job is\nunrolled.\n", 4),
        ("a.md", "A phrase goes on: moves\nthrough the air take time.", 1),
        ("a.py", '"""Plan a job.\n\nIt is unrolled."""\n', 3),
        ("a.py", 'def plan():\n    """Plan unrolled turns."""\n', 2),
        ("a.py", 'x = 1\nraise ValueError(\n    f"the job {x} "\n    f"is unrolled"\n)\n', 4),
        ("a.py", 'help = "Plan unrolled turns."\n', 1),
        ("a.js", '// a comment\nconst text = "Plan unrolled turns.";\n', 2),
        ("a.html", "<p>\nPlan unrolled turns.</p>\n", 2),
        ("a.toml", "# the job\n# is unrolled\n[plan]\n", 2),
    ],
)
def test_a_word_is_found_in_its_line(name, text, line):
    assert line in [finding.line for finding in terms.findings(text, name)]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.md", "The key `unrolled`, in\n\n    unrolled = 1\n\n```\nunrolled\n```\n"),
        ("a.md", "See [the page](unrolled.md)."),
        ("a.md", f"Text.\n\n{terms.LISTED}\n\n| unrolled | again |\n"),
        ("a.py", "unrolled = told\n# unrolled, a comment\nkey = 'unrolled'\n"),
        ("a.py", 'def _plan():\n    """Plan unrolled turns, where no user reads."""\n'),
        ("a.js", "// unrolled\nconst unrolled = told['unrolled'];\n"),
        ("a.toml", 'unrolled = "unrolled"\n'),
    ],
)
def test_names_in_code_are_left_alone(name, text):
    assert not list(terms.findings(text, name))


def test_a_finding_says_where_it_is_and_what_to_write_and_why():
    (finding,) = terms.findings("The turns are unrolled.", "docs/page.md")
    assert (
        str(finding)
        == 'docs/page.md:1: "unrolled": write not wrapped, because the glossary defines wrapped'
    )


def test_the_checker_fails_where_something_is_found(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(terms, "ROOT", tmp_path)
    monkeypatch.setattr(terms, "LIST", tmp_path / "docs/terms.toml")
    (tmp_path / "README.md").write_text("The job is planned again.\n")
    assert terms.main() == 0
    (tmp_path / "README.md").write_text("The turns\nare unrolled.\n")
    capsys.readouterr()
    assert terms.main() == 1
    assert capsys.readouterr().out.startswith('README.md:2: "unrolled": write not wrapped')


@pytest.mark.skipif(TYPOS is None, reason="typos is not installed")
@pytest.mark.parametrize(
    ("word", "code"), [("colour", 0), ("color", 2), ("wxether".replace("x", ""), 2)]
)
def test_the_spelling_of_pages_is_checked(tmp_path, word, code):
    (tmp_path / "page.md").write_text(f"The {word} of a curve.\n")
    command = [TYPOS, "--config", ROOT / "pyproject.toml", tmp_path / "page.md"]
    assert subprocess.run(command, check=False, capture_output=True).returncode == code
