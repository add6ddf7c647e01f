"""The README keeps its promises."""

import re

import pytest

from conftest import ROOT

README = (ROOT / "README.md").read_text()


@pytest.mark.slow
@pytest.mark.usefixtures("certified_by_default")
def test_the_python_example_runs_and_its_audit_is_clean(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert capsys.readouterr().out.strip().endswith("audit passed")


def test_every_link_leads_somewhere():
    for target in re.findall(r"\]\(([^)]+)\)", README):
        page, _, heading = target.partition("#")
        text = (ROOT / page).read_text(encoding="utf-8") if heading else ""
        titles = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
        assert (ROOT / page).exists(), target
        assert not heading or heading in {
            re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles
        }, target


def test_every_command_it_shows_exists():
    from kerfpath.cli import programs, studies
    from kerfpath.cli.app import app

    assert programs, studies  # their commands

    known = {command.callback.__name__ for command in app.registered_commands}
    shown = set(re.findall(r"^    kerfpath (\w+)", README, re.MULTILINE))
    assert shown
    assert shown <= known
    targets = set(re.findall(r"^    make (\w+)", README, re.MULTILINE))
    makefile = (ROOT / "Makefile").read_text()
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)
