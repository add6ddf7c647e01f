"""The example of fronts: what it writes, and that what is kept agrees with its table."""

import xml.etree.ElementTree as ET
from collections import Counter

import numpy as np
import pytest
from tests.test_examples import rows_of

import techniques as example

KEPT = example.HERE


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("techniques")
    example.main(["--quick", "--out", str(folder)])
    return folder


def test_the_reduced_example_writes_a_table_an_account_and_a_figure(written):
    assert {f.name for f in written.iterdir()} == {"README.md", "table.csv", "figure.svg"}
    assert "{" not in (written / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("place", ["new", "kept"])
def test_every_technique_has_as_many_runs_in_every_case(written, place):
    rows = rows_of(written if place == "new" else KEPT)
    runs = Counter((row["task"], row["share"], row["technique"]) for row in rows)
    assert len(set(runs.values())) == 1
    assert len({case[:2] for case in runs}) * len(example.TECHNIQUES) == len(runs)


@pytest.mark.parametrize("place", ["new", "kept"])
def test_exact_is_asked_what_the_procedure_is_and_does_no_worse(written, place):
    rows = rows_of(written if place == "new" else KEPT)
    least = {("sum", "manhattan"): "displacement", ("max", "chebychev"): "velocity"}
    compared = Counter()
    for sides in example.cases_of(rows).values():
        for paper, exact in zip(sides["paper"], sides["exact"], strict=True):
            assert [exact[key] for key in example.ASKED] == [paper[key] for key in example.ASKED]
            if paper["found"] == "no":
                continue
            assert exact["found"] == "yes"
            what = least.get((paper["objective"], paper["metric"]))
            if what and paper["weights"] == "default":
                # The cost is this criterion; the table rounds it to four places.
                assert float(exact[what]) <= float(paper[what]) + 1e-4
                compared[what] += 1
    assert set(compared) == set(least.values())


@pytest.mark.parametrize("place", ["new", "kept"])
def test_plans_keep_what_was_asked_and_acceptable_ones_the_limits(written, place):
    for row in rows_of(written if place == "new" else KEPT):
        if row["found"] == "yes" and row["technique"] != "known":
            # The table rounds shares and eta to four places.
            assert float(row["velocity"]) <= float(row["eta_v"]) + 1e-4
            assert float(row["acceleration"]) <= float(row["eta_a"]) + 1e-4
        if row["acceptable"] == "yes":
            assert max(float(row["velocity"]), float(row["acceleration"])) <= 1.0


def test_the_short_answer_of_the_account_is_what_the_table_says():
    cases = [example.judged(sides) for sides in example.cases_of(rows_of(KEPT)).values()]
    held = {
        key: sum(example.shows(key, told["known"], told["paper"]) for told in cases)
        for key, _ in example.CLAIMS.values()
    }
    assert held == {
        "acceptable": 5,
        "unrest": 4,
        "turns_back": 0,
        "imbalance": 1,
        "compromise": 5,
        "hypervolume": 5,
    }
    # No path of the procedure on the bracket at 95 %.
    assert [told["paper"]["found"] == 0 for told in cases] == [False] * 4 + [True, False]
    covered = [f"{told['ours']['covers paper']:.0%}" for told in cases]
    assert covered == ["100%", "47%", "100%", "78%", "nan%", "100%"]
    assert f"{max(told['paper']['covers ours'] for told in cases):.0%}" == "12%"


def test_what_is_said_of_search_and_choice_of_runs_is_what_the_table_says():
    cases = [example.judged(sides) for sides in example.cases_of(rows_of(KEPT)).values()]

    def over(technique, key, form):
        values = [told[technique][key] for told in cases]
        return f"{min(values):{form}} to {max(values):{form}}"

    assert all(told["exact"]["found"] == told["exact"]["runs"] for told in cases)
    paper, exact, ours = (
        np.array([told[name]["hypervolume"] for told in cases])
        for name in ("paper", "exact", "ours")
    )
    gains = ours > paper
    assert gains.tolist() == [True, False, True, True, True, True]
    shares = (exact - paper)[gains] / (ours - paper)[gains]
    assert (f"{shares.min():.0%}", f"{shares.max():.0%}") == ("87%", "97%")
    assert f"{exact[1] - paper[1]:.2f}" == "0.00"
    added = ours - exact
    assert f"{added.max():.2f}" == "0.06"
    assert f"{added[1]:.2f}" == "-0.02" == f"{added.min():.2f}"
    assert over("ours", "front", "d") == "9 to 25"
    assert over("exact", "front", "d") == "4 to 20"
    better = [told["ours"]["compromise"] < told["exact"]["compromise"] for told in cases]
    assert better == [True] * 4 + [False, True]
    assert cases[4]["ours"]["compromise"] == cases[4]["exact"]["compromise"]
    assert over("ours", "covers exact", ".0%") == "50% to 100%"
    assert over("exact", "covers ours", ".0%") == "5% to 44%"


def test_the_page_on_pareto_sets_states_the_figures_of_the_table():
    page = (KEPT.parents[1] / "docs" / "pareto.md").read_text(encoding="utf-8")
    cases = {case: example.judged(sides) for case, sides in example.cases_of(rows_of(KEPT)).items()}
    for (task, share), told in cases.items():
        numbers = (f"{told[name]['hypervolume']:.2f}" for name in ("ours", "exact", "paper"))
        assert example.table_line(f"{task}, {float(share) * 100:g} %", *numbers) in page
    kept, runs = (
        sum(told["known"][key] for told in cases.values()) for key in ("acceptable", "runs")
    )
    assert f"{kept} of {runs} runs" in " ".join(page.split())


@pytest.mark.parametrize("what", ["README.md", "figure.svg"])
def test_what_is_kept_is_what_the_kept_table_says(what):
    made = {"README.md": example.readme, "figure.svg": example.picture}[what](rows_of(KEPT))
    assert (KEPT / what).read_text(encoding="utf-8") == made


def test_the_figure_shows_every_case_in_two_diagrams(written):
    root = ET.parse(written / "figure.svg").getroot()
    assert len(root.findall("{*}g")) == 2 * len(example.cases_of(rows_of(written)))
    for circle in root.iter("{http://www.w3.org/2000/svg}circle"):
        assert 0 <= float(circle.get("cx")) <= example.WIDE
        assert 0 <= float(circle.get("cy")) <= example.HIGH


def test_a_front_is_what_no_other_point_dominates():
    points = np.random.default_rng(3).integers(0, 6, (60, 3)).astype(float)
    kept = {tuple(p) for p in example.front(points)}
    plain = {
        tuple(p) for p in points if not ((points <= p).all(axis=1) & (points < p).any(axis=1)).any()
    }
    assert kept == plain
    assert example.coverage(example.front(points), points) == 1.0


@pytest.mark.parametrize("ends", [(0.0, 1.0), (3.7, 3.9), (12.0, 150.0)])
def test_ticks_are_inside_few_and_in_place(ends):
    found = example.ticks(*ends)
    assert 2 <= len(found) <= 6
    for text, at in found:
        assert -1e-9 <= at <= 1 + 1e-9  # rounding
        # The text has as many digits as the step needs.
        assert float(text) == pytest.approx(ends[0] + at * (ends[1] - ends[0]))
