"""What contours take and cost: worked examples, sums, and jobs that leave a value open."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.program_edits import _draw
from tests.job.test_techniques import job_text

from kerfpath.cli.plan_output import cut_entry, times_entry
from kerfpath.errors import InputError
from kerfpath.job import prepare, read_job, run_prepared, spent_entry, spent_on, spent_on_all
from kerfpath.job.output.writing import report_text

COST = """
[cost]
currency = "EUR"
gas_per_m3 = { N2 = 0.4, O2 = 0.5 }
power_per_kwh = 0.3
source_efficiency = 0.25
machine_per_h = 90
"""


def written(folder, *, powered=True, cost=COST, edit=lambda text: text):
    _draw(folder / "points.csv")
    text = job_text("rapid")
    for gas, flow, speed in (("N2", 600, 4), ("O2", 30, 3)):
        row = f'gas = "{gas}"\ngas_flow_l_min = {flow}\n'
        text = text.replace(
            f"speed_m_min = {speed}\ngas_lead_s", f"{row}speed_m_min = {speed}\ngas_lead_s"
        )
    if not powered:
        text = text.replace('power_output = "aoPower"\npower_full = 10.0\n', "", 1)
    (folder / "job.toml").write_text(edit(text + cost))
    return read_job(folder / "job.toml")


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    return run_prepared(prepare(written(tmp_path_factory.mktemp("spent"))))


def by_hand(job):
    """The same job, in which the operator sets the power."""
    program = job.program
    own = {
        name: {"gas_lead": each["gas_lead"], "pierce_time": program.of(name).pierce_time}
        for name, each in program.contours.items()
    }
    source = {**job.source, "program": {k: v for k, v in job.source["program"].items()}}
    source["program"]["rapid"] = {"gas_output": "doGas"}
    return replace(job, program=replace(program, contours=own), source=source)


def test_gas_is_flow_times_the_time_that_it_is_switched_on(result):
    """600 l/min are 10 l/s, 30 l/min are 0.5 l/s."""
    for cut, flow, lead, pierce in zip(
        result.cuts, (0.5, 10), (0.2, 0.3), (0.15, 0.3), strict=True
    ):
        spent = spent_on(result.job, cut)
        took = cut.plan.time[-1] - cut.plan.time[0]
        assert spent.gas_time == pytest.approx(lead + pierce + took)
        assert spent.gas == pytest.approx(flow * (lead + pierce + took))
        assert spent.cutting == pytest.approx(took)
        assert spent.piercing == pytest.approx(pierce)


def test_a_constant_power_times_its_time_is_the_energy(result):
    """The hole has 1500 W, except along its micro joint, and is pierced by 600 W for 0.15 s."""
    hole, slit = result.cuts
    spent = spent_on(by_hand(result.job), hole)
    joint = [kind == "micro joint" for kind in hole.plan.contour.kinds[:-1]]
    beam = np.diff(hole.plan.time)[~np.array(joint)].sum()
    assert spent.energy == pytest.approx(1500 * beam + 600 * 0.15)
    assert beam < spent.cutting
    took = slit.plan.time[-1] - slit.plan.time[0]
    energy = 3000 * took + 1200 * 0.2 + 2400 * 0.1
    assert spent_on(by_hand(result.job), slit).energy == pytest.approx(energy)


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_a_power_that_the_program_sets_is_that_of_the_energy(result, share):
    """Of one share at every speed; along the micro joint of the hole there is none."""
    program = result.job.program
    own = {name: {**each, "power_by_speed": ((0.0, share), (1.0, share))}
           for name, each in program.contours.items()}  # fmt: skip
    job = replace(result.job, program=replace(program, contours=own))
    hole, slit = (spent_on(job, cut) for cut in result.cuts)
    assert slit.energy == pytest.approx(3000 * share * slit.cutting + 1200 * 0.2 + 2400 * 0.1)
    joint = [kind == "micro joint" for kind in result.cuts[0].plan.contour.kinds[:-1]]
    lit = np.diff(result.cuts[0].plan.time)[~np.array(joint)].sum()
    assert hole.energy == pytest.approx(3000 * share * lit + 600 * 0.15, rel=0.02)
    assert hole.energy < 3000 * share * hole.cutting + 600 * 0.15


def test_prices_make_the_cost_and_without_them_there_is_none(result):
    """0.4 EUR for 1000 l of N2; 0.3 EUR for a kWh, a quarter of it beam; 90 EUR an hour."""
    hole, slit = (spent_on(result.job, cut) for cut in result.cuts)
    assert hole.cost.gas == pytest.approx(0.5 * hole.gas / 1000)
    assert slit.cost.gas == pytest.approx(0.4 * slit.gas / 1000)
    assert slit.cost.power == pytest.approx(0.3 * slit.energy / 0.25 / 3.6e6)
    assert slit.cost.machine == pytest.approx(90 * (slit.cutting + slit.piercing) / 3600)
    assert slit.cost.total == pytest.approx(slit.cost.gas + slit.cost.power + slit.cost.machine)
    free = spent_on(replace(result.job, cost=None), result.cuts[1])
    assert free.cost is None
    assert free.gas == slit.gas
    assert free.energy == slit.energy


def test_all_together_are_the_sum(result):
    each = [spent_on(result.job, cut) for cut in result.cuts]
    whole = spent_on_all(result, each)
    for name in ("cutting", "piercing", "gas_time", "gas", "energy"):
        assert getattr(whole, name) == pytest.approx(sum(getattr(one, name) for one in each))
    assert whole.cost.total == pytest.approx(sum(one.cost.total for one in each))
    assert whole.air is None, "no moves are planned"


def test_report_table_and_json_have_each_number_with_its_unit(result):
    page = report_text(result, ())
    section = page.partition("<h2>Process</h2>")[2].partition("</section>")[0]
    for words in ("Gas cost", "EUR", "kJ", "What each contour takes"):
        assert words in section
    slit = spent_on(result.job, result.cuts[1])
    assert f"{slit.gas:.1f}" in section
    assert f"{slit.cost.total:.4f}" in section
    free = report_text(replace(result, job=replace(result.job, cost=None)), ())
    assert "EUR" not in free.partition("<h2>Process</h2>")[2].partition("</section>")[0]


def test_the_json_of_a_contour_has_what_it_takes_beside_the_cost_of_its_plan(result):
    cut = result.cuts[1]
    spent, entry = spent_on(result.job, cut), cut_entry(cut)
    times = times_entry(result.job, cut, spent)
    assert not set(entry) & set(times), "one would hide the other"
    assert entry["cost"] == cut.plan.cost
    assert (times["piercing_s"], times["gas_s"]) == (spent.piercing, spent.gas_time)
    said = times["spent"]
    assert (said["cutting_s"], said["gas_l"]) == (spent.cutting, spent.gas)
    assert said["beam_kj"] == spent.energy / 1e3
    assert said["cost"]["currency"] == "EUR"
    assert said["cost"]["total"] == spent.cost.total
    without = spent_entry(spent_on(replace(result.job, cost=None), cut))
    assert without["cost"] is None
    assert without["moves_s"] is None


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('currency = "EUR"\n', "", ["cost.currency", "a currency"]),
        ("machine_per_h = 90", "machine_per_h = -1", ["cost.machine_per_h", "not below 0"]),
        ("source_efficiency = 0.25\n", "", ["source_efficiency", "power_per_kwh"]),
        ("source_efficiency = 0.25", "source_efficiency = 25", ["source_efficiency", "at most 1"]),
        ("N2 = 0.4, ", "", ["cost.gas_per_m3", "it has N2", "[[process.row]]"]),
        ("gas_flow_l_min = 600\n", "", ["cost.gas_per_m3", "gas_flow_l_min in"]),
        ("gas_flow_l_min = 600\n", "gas_flow_l_min = -600\n", ["gas_flow_l_min", "0 to 10000"]),
        ("machine_per_h", "machine", ["cost.machine", "machine_per_h"]),
    ],
)
def test_prices_that_cannot_be_used_are_refused_in_one_line(tmp_path, old, new, words):
    def edit(text):
        assert old in text
        return text.replace(old, new, 1)

    with pytest.raises(InputError) as caught:
        written(tmp_path, edit=edit)
    assert str(caught.value).isprintable()
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_prices_of_gas_and_power_need_the_process_and_there_is_some_price(tmp_path):
    def without(text):
        rows = text.partition("[process]\n")[2].partition("[[contour]]")[0]
        return text.replace(f"[process]\n{rows}", "").replace('technique = "small-hole"\n', "")

    with pytest.raises(InputError, match="process"):
        written(tmp_path, edit=without)
    some = "\n[cost]\ncurrency = 'EUR'\n"
    assert written(tmp_path, cost=f"{some}machine_per_h = 60\n", edit=without).cost is not None
    with pytest.raises(InputError, match="or machine_per_h"):
        written(tmp_path, cost=some)


def test_a_row_for_any_gas_has_the_price_of_the_gas_of_the_job(tmp_path):
    def edit(text):
        text = text.replace('gas = "N2"\n', "").replace('gas = "O2"\n', "")
        return text.replace("[process]\n", '[process]\ngas = "O2"\n', 1)

    assert written(tmp_path, edit=edit).cost.gas_per_m3["O2"] == 0.5
    with pytest.raises(InputError, match="expected gas in"):
        written(tmp_path, edit=lambda text: edit(text).replace('gas = "O2"\n', "", 1))
