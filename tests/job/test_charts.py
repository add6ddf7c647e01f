"""Cut charts: files, the choice of a row, what a job takes from it, and where values come from."""

import re
from pathlib import Path

import pytest

import chart_files as made
from commands import assert_refused, run
from jobs import DEMO, SMALL
from kerfpath.errors import InputError
from kerfpath.job import (
    origins_of,
    prepare,
    python_script,
    read_chart,
    read_foreign,
    read_job,
    with_loops,
)
from kerfpath.job.format import doubts_of, sheet_of
from kerfpath.study.placing import placed_text
from spoilt import complaint, spoilt

CHART = """\
source = "cut trials"
machine = "2 kW fibre"

[[row]]
material = "steel"
thickness_mm = 2
gas = "N2"
speed_m_min = 6
kerf_mm = 0.15
lead_in_mm = 3
gas_lead_s = 0.25
stand_off_mm = 0.7
power_w = 1800
pressure_bar = 12
nozzle_mm = 1.5
pierce = [
    { time_s = 0.1, power_w = 900, height_mm = 4 },
    { time_s = 0.2, power_w = 1800, height_mm = 1 },
]

[[row]]
material = "steel"
thickness_mm = 4
gas = "N2"
speed_m_min = 3
kerf_mm = 0.25
lead_in_mm = 5
gas_lead_s = 0.25
stand_off_mm = 0.7
power_w = 2000
pressure_bar = 16
nozzle_mm = 1.5
pierce = [
    { time_s = 0.2, power_w = 900, height_mm = 4 },
    { time_s = 0.3, power_w = 2000, height_mm = 1 },
]

[[row]]
material = "steel"
thickness_mm = 2
gas = "N2"
technique = "small-hole"
speed_m_min = 2
kerf_mm = 0.15
stand_off_mm = 0.7
power_w = 1200
pierce = [{ time_s = 0.3 }]

[[row]]
material = "steel"
thickness_mm = 2
gas = "O2"
quality = "fine"
speed_m_min = 4

[[row]]
material = "brass"
thickness_mm = 1
quality = "fine"
speed_m_min = 5

[[row]]
material = "brass"
thickness_mm = 1
quality = "fast"
speed_m_min = 9
"""
PROCESS = '[process]\nmaterial = "steel"\nthickness_mm = 2\ngas = "N2"\n'


@pytest.fixture
def job(tmp_path, monkeypatch):
    """A function that writes a job with a [process] beside a chart, and reads it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "settings"))
    (tmp_path / "charts").mkdir()
    (tmp_path / "charts" / "own.toml").write_text(CHART)
    (tmp_path / "b_pillar.step").symlink_to(DEMO / "b_pillar.step")
    bare = re.sub(r"^speed_m_min.*\n", "", SMALL, flags=re.MULTILINE)

    def write(process=PROCESS, *, edit=lambda text: text):
        text = edit(bare.replace("[[contour]]", f"{process}\n[[contour]]", 1))
        (tmp_path / "job.toml").write_text(text)
        return read_job(tmp_path / "job.toml")

    return write


def refused(call, *words):
    with pytest.raises(InputError) as caught:
        call()
    line = str(caught.value)
    assert line.isprintable()
    for word in words:
        assert word in line, line


# -----------------------------------------------------------------------------
# What a job takes from a chart.


def test_a_job_has_the_values_of_its_row(job):
    read = job(PROCESS, edit=lambda text: text + '[program.rapid]\ngas_output = "doGas"\n')
    for spec in read.contours:
        assert spec.speed == pytest.approx(6 / 60)
        assert spec.table.kerf_mm == 0.15
        assert spec.table.lead_in.length_mm == 3
        assert spec.table.lead_out is None
    assert read.program.pierce_time == pytest.approx(0.3)
    assert read.program.gas_lead == 0.25
    assert not any("gas ahead" in line for line in read.program.remarks)


def test_it_is_the_same_job_as_one_that_says_the_values_itself(job):
    by_chart = job()

    def said(text):
        keys = "speed_m_min = 6\nkerf_mm = 0.15\n"
        leads = "[contour.lead_in]\nlength_mm = 3\n"
        text = re.sub(r"(\[\[contour\]\]\n(?:\w.*\n)+)", rf"\g<1>{keys}{leads}", text)
        return text.replace("[program]\n", "[program]\npierce_time_s = 0.3\n")

    by_hand = job("", edit=said)
    assert [c.table for c in by_chart.contours] == [c.table for c in by_hand.contours]
    assert by_chart.program.pierce_time == by_hand.program.pierce_time
    assert by_hand.program.remarks == ()


def test_a_key_of_the_job_wins(job):
    def edit(text):
        keys = "speed_m_min = 1\nkerf_mm = 0\n[contour.lead_in]\nlength_mm = 0\n"
        text = re.sub(r"(\[\[contour\]\]\n(?:\w.*\n)+)", rf"\g<1>{keys}", text, count=1)
        return text.replace("[program]\n", "[program]\npierce_time_s = 0.5\n")

    read = job(edit=edit)
    first, second = (spec.table for spec in read.contours)
    assert (first.speed_m_min, first.kerf_mm, first.lead_in) == (1, 0, None)
    assert (second.speed_m_min, second.kerf_mm, second.lead_in.length_mm) == (6, 0.15, 3)
    assert read.program.pierce_time == 0.5
    found = {(o.of, o.key): o.origin for o in origins_of(read.text, read.source)}
    assert found["hole 10", "speed_m_min"] == found["program", "pierce_time_s"] == "job"
    assert found["slot", "speed_m_min"] == "charts/own.toml row 1"
    assert found["slot", "lead_out.length_mm"] == "default"


def test_a_contour_may_have_a_technique_of_its_own(job):
    def edit(text):
        return text.replace('name = "hole 10"', 'name = "hole 10"\ntechnique = "small-hole"')

    read = job(edit=edit)
    assert [round(spec.speed * 60, 9) for spec in read.contours] == [2, 6]
    lines = read.program.remarks
    assert "- ROWS DIFFER: stop in between" in lines
    assert {"- for hole 10", "- for slot", "- power 1200 W", "- power 1800 W"} <= set(lines)


def test_contours_have_the_pierce_of_their_row_unless_the_job_says_one(job):
    def edit(text):
        return text.replace('name = "slot"', 'name = "slot"\ntechnique = "small-hole"')

    chart = CHART.replace("pierce = [{ time_s = 0.3 }]", "pierce = [{ time_s = 0.1 }]")
    job()  # writes the chart
    path = Path(read_job_folder(job)) / "charts" / "own.toml"
    path.write_text(chart)
    made = job(edit=edit)
    assert made.program.of("hole 10").pierce_time == pytest.approx(0.3)
    assert made.program.of("slot").pierce_time == 0.1
    found = {(o.of, o.key): (o.shown, o.origin) for o in origins_of(made.text, made.source)}
    assert found["slot", "pierce_time_s"] == ("0.1", "charts/own.toml row 3")
    assert ("program", "pierce_time_s") not in found
    both = job(
        edit=lambda text: edit(text).replace("[program]\n", "[program]\npierce_time_s = 0.2\n")
    )
    assert both.program.of("slot").pierce_time == both.program.pierce_time == 0.2


def read_job_folder(job):
    return job().path.parent


def test_every_value_of_a_row_is_used_or_on_the_sheet(job):
    read = job()
    row = read.source["process"]["row"][0]
    sheet = " ".join(line[2:] for line in read.program.remarks)
    used = {"speed_m_min", "kerf_mm", "lead_in_mm", "pierce"}
    told = {"chart", "number", "source"}  # where it comes from
    for key, value in row.items():
        if key not in used | told:
            assert (f"{value:g}" if isinstance(value, int | float) else value) in sheet, key
    for stage in row["pierce"]:
        assert all(f"{value:g}" in sheet for value in stage.values())


def test_micro_joints_of_a_chart_have_its_width_where_the_job_asks_for_them(job):
    chart = CHART.replace("kerf_mm = 0.15\nlead", "kerf_mm = 0.15\nmicro_joint_mm = 0.4\nlead")
    folder = read_job_folder(job)
    (folder / "charts" / "own.toml").write_text(chart)
    assert "- micro joints 0.4 mm" in job().program.remarks
    text = "[contour.micro_joints]\ncount = 2\n"
    read = job(
        edit=lambda t: re.sub(r"(\[\[contour\]\]\n(?:\w.*\n)+)", rf"\g<1>{text}", t, count=1)
    )
    assert read.contours[0].table.micro_joints.width_mm == 0.4
    assert read.contours[1].table.micro_joints is None


def test_the_stand_off_is_that_of_the_cell_too(job):
    read = job(edit=lambda text: text + "[cell]\nnear_miss_mm = 5\n")
    assert read.cell.stand_off_mm == 0.7
    read = job(edit=lambda text: text + "[cell]\nnear_miss_mm = 5\nstand_off_mm = 1.2\n")
    assert read.cell.stand_off_mm == 1.2
    assert "- stand-off 1.2 mm" in read.program.remarks


def test_a_job_that_is_written_elsewhere_has_its_rows(job, tmp_path):
    read = job(PROCESS + "# a remark\n")
    away = tmp_path / "away"
    away.mkdir()
    text = placed_text(read, {}, away, "a copy")
    assert "# a remark" in text
    (away / "job.toml").write_text(text)
    again = read_job(away / "job.toml")
    assert [c.table for c in again.contours] == [c.table for c in read.contours]
    assert again.program.remarks == read.program.remarks
    assert again.program.pierce_time == read.program.pierce_time


def test_loops_are_added_to_the_text_as_it_is_written(job):
    read = job()
    text = with_loops(read, read.read_part(), ["skin/hole1"])
    assert "speed_m_min" not in text
    assert text.count("[[contour]]") == 3


def test_a_script_has_the_sheet(job):
    assert "- PROCESS SHEET, set by hand:" in python_script(prepare(job()))


# -----------------------------------------------------------------------------
# The choice of the row.


@pytest.mark.parametrize(
    ("process", "words"),
    [
        ('material = "titanium"\nthickness_mm = 2', ["process.material", "titanium", "steel"]),
        ('material = "steel"\nthickness_mm = 2', ["2: ", "charts/own.toml row 1 (N2)", "gas"]),
        ('material = "steel"\nthickness_mm = 2\ngas = "Ar"', ["process.gas", "a gas", "Ar", "N2"]),
        ('material = "brass"\nthickness_mm = 1', ["got 2", "name the quality"]),
        (
            'material = "steel"\nthickness_mm = 3\ngas = "N2"',
            [
                "process.thickness_mm",
                "got 3 mm",
                "2 mm (charts/own.toml row 1)",
                "4 mm (charts/own.toml row 2)",
                "linear",
            ],
        ),
        (
            'material = "steel"\nthickness_mm = 9\ngas = "N2"\nbetween = "linear"',
            ["got 9 mm", "4 mm (charts/own.toml row 2)", "add a row"],
        ),
        (
            'material = "steel"\nthickness_mm = 2\ntechnique = "engraving"',
            ["technique", "engraving", "small-hole"],
        ),
        ('material = "steel"\nthickness_mm = 2\nchart = "none.toml"', ["a chart", "none.toml"]),
        ('material = "steel"\nthickness_mm = 2\ncolour = "red"', ["process.colour", "[process]"]),
        ('material = "steel"', ["thickness_mm", "add, for example, thickness_mm = 3"]),
    ],
)
def test_a_job_without_one_row_is_refused_in_one_line(job, process, words):
    refused(lambda: job(f"[process]\n{process}\n"), "job.toml:", *words)


@pytest.mark.parametrize("thickness", [1.981, 2.019])
def test_one_per_cent_of_the_thickness_is_the_same_sheet(job, thickness):
    read = job(PROCESS.replace("= 2", f"= {thickness}"))
    assert read.contours[0].table.speed_m_min == 6


@pytest.mark.parametrize("thickness", [1.97, 2.03])
def test_more_is_another(job, thickness):
    refused(lambda: job(PROCESS.replace("= 2", f"= {thickness}")), "thickness")


def test_between_two_rows_numbers_are_in_proportion(job):
    read = job(PROCESS.replace("= 2", "= 3") + 'between = "linear"\n')
    table = read.contours[0].table
    assert (table.speed_m_min, table.kerf_mm, table.lead_in.length_mm) == (4.5, 0.2, 4)
    assert read.program.pierce_time == pytest.approx(0.4)
    sheet = "\n".join(read.program.remarks)
    assert "power 1900 W" in sheet
    assert "interpolated" in sheet


def test_nothing_lies_between_two_nozzles(job):
    folder = read_job_folder(job)
    head, sep, tail = CHART.rpartition("nozzle_mm = 1.5")
    (folder / "charts" / "own.toml").write_text(f"{head}nozzle_mm = 2{tail}")
    assert sep
    process = PROCESS.replace("= 2", "= 3") + 'between = "linear"\n'
    refused(lambda: job(process), "nozzle_mm alike", "1.5 and 2")


def test_examples_are_used_only_by_name(job):
    folder = read_job_folder(job)
    (folder / "charts" / "own.toml").unlink()
    process = PROCESS.replace('"steel"', '"mild steel"')
    refused(lambda: job(process), "got none", "name one")
    read = job(process + 'chart = "fibre-3kw"\n')
    assert "- EXAMPLE VALUES, NOT MEASURED" in read.program.remarks


def test_charts_of_the_user_come_after_those_beside_the_job(job):
    folder = read_job_folder(job)
    own = folder / "settings" / "kerfpath" / "charts"
    own.mkdir(parents=True)
    (own / "mine.toml").write_text(CHART.replace("speed_m_min = 6", "speed_m_min = 7"))
    assert job().contours[0].table.speed_m_min == 6
    (folder / "charts" / "own.toml").unlink()
    read = job()
    assert read.contours[0].table.speed_m_min == 7
    assert read.source["process"]["row"][0]["chart"] == "user:mine.toml"


def test_rows_in_the_job_come_first(job):
    row = "[[process.row]]\nmaterial = 'steel'\nthickness_mm = 2\ngas = 'N2'\nspeed_m_min = 1\n"
    read = job(PROCESS + row)
    assert read.contours[0].table.speed_m_min == 1
    assert {o.origin for o in origins_of(read.text, read.source)} == {"[[process.row]]", "default"}


def test_a_technique_needs_a_process(job):
    def edit(text):
        text = text.replace("spacing_mm", "speed_m_min = 3\nspacing_mm")
        return text.replace('name = "slot"', 'name = "slot"\ntechnique = "small-hole"')

    refused(lambda: job("", edit=edit), "contour.technique", "[process]")


# -----------------------------------------------------------------------------
# Files of charts.


def test_shipped_charts_are_marked_examples_with_usual_values(tmp_path):
    for whole in made.charts(tmp_path):
        chart = read_chart(whole.main)
        assert chart.table.example
        assert "not measured" in chart.table.source
        assert doubts_of(chart) == []


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("speed_m_min = 6", "speed_m_min = -6", 8, ["row.speed_m_min", "above 0", "-6"]),
        ("speed_m_min = 6", 'speed_m_min = "6"', 8, ["row.speed_m_min", '"6"']),
        ("speed_m_min = 6\n", "", 4, ["row.speed_m_min", "got nothing"]),
        ("kerf_mm = 0.15\nlead", "kerf = 0.15\nlead", 9, ["kerf", "nearest: kerf_mm"]),
        ("power_w = 900, h", "watt = 900, h", 17, ["watt", "row.pierce"]),
        ('source = "cut trials"\n', "", 1, ["source", "where the values come from"]),
        ('technique = "small-hole"', 'technique = "normal"', 39, ["row 1 again", "technique"]),
        ("[[row]]", "[row]", None, ["TOML"]),
        ("kerf_mm = 0.15\nlead", "kerf_mm = 90\nlead", 9, ["from 0 to 20", "90"]),
    ],
)
def test_a_fault_of_a_chart_is_one_line_with_its_place(tmp_path, old, new, line, words):
    path = tmp_path / "chart.toml"
    path.write_text(CHART.replace(old, new, 1))
    place = f"{path}:" if line is None else f"{path}:{line}: "
    refused(lambda: read_chart(path), place, *words)


def test_a_name_that_no_file_can_have_is_refused(job):
    refused(lambda: job(PROCESS + f'chart = "{"x" * 5000}"\n'), "process.chart", "a chart")
    assert_refused(run("charts", "show", "x" * 5000), "a chart")
    assert_refused(run("charts", "check", "x" * 5000), "cannot be read")


def test_a_broken_chart_is_listed_with_its_fault(job, tmp_path):
    job()
    (tmp_path / "charts" / "broken.toml").write_text("row = 1\n")
    listed = run("charts", "list", cwd=tmp_path)
    assert listed.returncode == 0
    assert "charts/broken.toml" in listed.stdout
    assert "expected" in listed.stdout


def test_unusual_values_are_doubted(tmp_path):
    path = tmp_path / "chart.toml"
    path.write_text(CHART.replace("speed_m_min = 6", "speed_m_min = 400"))
    (said,) = doubts_of(read_chart(path))
    assert said == "row 1: speed_m_min = 400, usual is 0.1 to 100"


SPOILT = {
    "charts": (made.charts, read_chart),
    "foreign": (made.foreign_charts, made.read_foreign_chart),
}


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("charts", 100),
        ("foreign", 100),
        pytest.param("charts", 1000, marks=pytest.mark.slow),
        pytest.param("foreign", 300, marks=pytest.mark.slow),
    ],
)
def test_spoilt_charts_are_read_or_refused_in_one_line(tmp_path, name, count):
    wholes, read = SPOILT[name]
    files = wholes(tmp_path)
    sound = {whole.spoilt: whole.spoilt.read_bytes() for whole in files}
    for seed in range(count):
        whole, content = spoilt(files, sound, seed)
        whole.spoilt.write_bytes(content)
        assert complaint(read, whole) == "", f"seed {seed}"
        whole.spoilt.write_bytes(sound[whole.spoilt])


# -----------------------------------------------------------------------------
# Charts of other programs.


def converted(tmp_path, name, text=None, **how):
    (tmp_path / name).write_text(text or made.FOREIGN[name], encoding="utf-8")
    said, notes = read_foreign(tmp_path / name, **how)
    (tmp_path / "out.toml").write_text(said, encoding="utf-8")
    return read_chart(tmp_path / "out.toml").table.row, notes


def test_materials_of_qtplasmac_are_rows(tmp_path):
    (one, two), notes = converted(tmp_path, "mill_material.cfg", unit="mm")
    assert (one.material, one.thickness_mm, one.quality) == ("Mild Steel", 5, "40 A")
    assert (one.speed_m_min, one.kerf_mm, one.stand_off_mm) == (3, 0.5, 0.75)
    assert (one.current_a, one.voltage_v, one.pause_at_end_s) == (40, 110, 0.1)
    assert (one.pierce[0].time_s, one.pierce[0].height_mm) == (0.1, 3.1)
    assert "gas pressure 5" in one.note
    assert "puddle jump height 100 %" in two.note
    assert any("taken from its name" in note for note in notes)


def test_inches_of_qtplasmac_are_scaled(tmp_path):
    text = made.QTPLASMAC.replace("= 1.0", "= 0.04").replace("= 0.5", "= 0.02")
    (one, _), _ = converted(tmp_path, "mill_material.cfg", text, unit="inch")
    assert one.speed_m_min == pytest.approx(3000 * 0.0254)
    assert one.kerf_mm == pytest.approx(0.508)
    assert one.thickness_mm == 5  # its name says mm


@pytest.mark.parametrize(
    ("old", "new", "how", "words"),
    [
        ("", "", {}, ["--unit mm or --unit inch", "look like mm"]),
        ("CUT_SPEED          = 3000\n", "", {"unit": "mm"}, ["MATERIAL_NUMBER_1", "CUT_SPEED"]),
        ("= 3000", "= fast", {"unit": "mm"}, [":9: CUT_SPEED", "'fast'"]),
        ("THC ", "TCH ", {"unit": "mm"}, [":5: ", "'TCH'"]),
        ("5mm Mild", "Mild", {"unit": "mm"}, ["thickness_mm", "--thickness-mm"]),
        ("[MATERIAL_NUMBER_4]", "[MATERIAL_NUMBER_1]", {"unit": "mm"}, [":16: ", "once"]),
        ("", "", {"unit": "mm", "columns": ["a=b"]}, ["a table with --map", ".cfg"]),
    ],
)
def test_faults_of_qtplasmac_are_refused(tmp_path, old, new, how, words):
    text = made.QTPLASMAC.replace(old, new, 1) if old else None
    refused(lambda: converted(tmp_path, "mill_material.cfg", text, **how), *words)


def test_columns_say_their_units(tmp_path):
    (one, two), notes = converted(tmp_path, "table.csv")
    assert one.speed_m_min == pytest.approx(4.2005)
    assert (one.power_w, one.pierce[0].time_s) == (3000, 0.3)
    assert one.pressure_bar == pytest.approx(13.78952)
    assert two.gas == "O2"
    assert "column 'colour' is left out: it is no key of a chart" in notes
    assert "line 3: left out, as it has no speed" in notes


def test_columns_are_mapped(tmp_path):
    text = "what,t,v\nsteel,3,70\n"
    columns = ["what=material", "t=thickness_mm", "v=speed mm/s"]
    (row,), _ = converted(tmp_path, "t.csv", text, columns=columns)
    assert (row.material, row.thickness_mm, row.speed_m_min) == ("steel", 3, 4.2)


@pytest.mark.parametrize(
    ("text", "how", "words"),
    [
        ("material,thickness mm,speed\nsteel,3,4\n", {}, ["'speed'", "unit", "--map"]),
        ("material,thickness mm,speed knots\nsteel,3,4\n", {}, ["knots", "m/min"]),
        ("material,thickness mm,speed m/min\nsteel,3,x\n", {}, [":2: ", "'x'"]),
        ("material,thickness mm,speed m/min\nsteel,3\n", {}, [":2: ", "3 cells", "got 2"]),
        ("material,speed m/min\nsteel,3\n", {}, ["line 2", "thickness_mm", "--thickness-mm"]),
        ("material,thickness mm\nsteel,3\n", {}, ["rows to convert", "no speed"]),
        ("a,b\n1,2\n", {"columns": ["c=speed"]}, ["--map", "'a', 'b'"]),
        ("a,b\n1,2\n", {"columns": ["a=colour"]}, ["--map", "'colour'"]),
        ("speed m/min,feed mm/s\n1,2\n", {}, ["one column of speed_m_min"]),
        ("a,b\n1,2\n", {"unit": "mm"}, ["no --unit"]),
    ],
)
def test_faults_of_tables_are_refused(tmp_path, text, how, words):
    refused(lambda: converted(tmp_path, "t.csv", text, **how), "t.csv", *words)


def test_entries_of_lightburn_are_rows(tmp_path):
    (cut, mark), notes = converted(tmp_path, "shop.clb")
    assert (cut.material, cut.thickness_mm, cut.technique) == ("plywood", 3, "normal")
    assert cut.speed_m_min == pytest.approx(0.72)
    assert "maxPower 80 %" in cut.note
    assert "2 passes" in cut.note
    assert mark.technique == "engraving"
    assert "'plywood' 'paper': left out, as it has no thickness" in notes


CELLS = [
    ["Material", "Thickness [mm]", "Speed (mm/min)", "kerf mm", "when"],
    ["steel", 3.0, 4200.5, 0.2, "2026-11-30"],
    [None, None, None, None, None],
    ["steel", 6, "2600,5", "-", None],
]


def test_a_spreadsheet_is_a_table(tmp_path):
    made.write_spreadsheet(tmp_path / "t.xlsx", steel=CELLS)
    text, notes = read_foreign(tmp_path / "t.xlsx")
    (tmp_path / "t.toml").write_text(text)
    one, two = read_chart(tmp_path / "t.toml").table.row
    assert (one.material, one.thickness_mm, one.kerf_mm) == ("steel", 3, 0.2)
    assert one.speed_m_min == pytest.approx(4.2005)
    assert two.speed_m_min == pytest.approx(2.6005)
    assert two.kerf_mm is None
    assert "column 'when' is left out: it is no key of a chart" in notes


def test_one_of_several_sheets_is_named(tmp_path):
    path = tmp_path / "t.xlsx"
    made.write_spreadsheet(path, steel=CELLS, empty=[], brass=CELLS[:2])
    refused(lambda: read_foreign(path), "t.xlsx", "--sheet", "'steel', 'empty', 'brass'")
    refused(lambda: read_foreign(path, sheet="tin"), "--sheet", "'brass'", "'tin'")
    refused(lambda: read_foreign(path, sheet="empty"), "names and rows")
    text, _ = read_foreign(path, sheet="brass")
    assert text.count("[[row]]") == 1


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (["steel", 3, "fast", 0.2, None], [":2: ", "'Speed (mm/min)'", "'fast'"]),
        (["steel", 3, "4\u202e2", 0.2, None], [":2: ", "U+202E"]),
        (["steel", 3], ["rows to convert"]),
    ],
)
def test_faults_of_spreadsheets_are_refused(tmp_path, row, words):
    made.write_spreadsheet(tmp_path / "t.xlsx", steel=[CELLS[0], row])
    refused(lambda: read_foreign(tmp_path / "t.xlsx"), "t.xlsx", *words)


def test_other_files_are_not_converted(tmp_path):
    (tmp_path / "chart.xlsx").write_bytes(b"PK")
    refused(lambda: read_foreign(tmp_path / "chart.xlsx"), "not a spreadsheet", "as CSV")
    (tmp_path / "chart.pdf").write_bytes(b"%PDF")
    refused(lambda: read_foreign(tmp_path / "chart.pdf"), "expected a chart", ".pdf")
    (tmp_path / "t.csv").write_text("a\n")
    refused(lambda: read_foreign(tmp_path / "t.csv", sheet="a"), "--sheet")


# -----------------------------------------------------------------------------
# The command.


def test_the_command_lists_shows_checks_and_converts(job, tmp_path):
    job()
    listed = run("charts", "list", cwd=tmp_path)
    assert listed.returncode == 0
    assert "charts/own.toml" in listed.stdout
    shown = run("charts", "show", "charts/own.toml", cwd=tmp_path)
    assert "cut trials" in shown.stdout
    traced = run("charts", "show", "--job", "job.toml", cwd=tmp_path)
    assert "charts/own.toml row 1" in traced.stdout
    checked = run("charts", "check", "charts/own.toml", cwd=tmp_path)
    assert "6 rows, 0 to look at" in checked.stdout
    (tmp_path / "t.csv").write_text(made.TABLE)
    assert run("charts", "convert", "t.csv", "-o", "t.toml", cwd=tmp_path).returncode == 0
    assert run("charts", "check", "t.toml", cwd=tmp_path).returncode == 0
    assert_refused(run("charts", "convert", "t.csv", "-o", "t.toml", cwd=tmp_path), "exists")
    assert_refused(run("charts", "convert", cwd=tmp_path), "one file")
    assert_refused(run("charts", "check", "none.toml", cwd=tmp_path), "no such file")
    assert_refused(run("charts", "show", cwd=tmp_path), "name")


def test_the_sheet_of_a_job_without_process_is_empty(job):
    read = job("", edit=lambda text: text.replace("spacing_mm", "speed_m_min = 3\nspacing_mm"))
    assert sheet_of(read.source) == ()
    assert origins_of(read.text, read.source) == ()


POWERED = """\
source = "cut trials"
[[row]]
material = "steel"
thickness_mm = 2
speed_m_min = 6
power_w = 3000
power_by_speed = [[0.0, 0.3], [1.0, 1.0]]
pierce = [{ time_s = 0.2, power_w = 1200, height_mm = 4 }, { time_s = 0.1, power_w = 2400 }]
"""


def powered(tmp_path, program):
    """The job of a chart with powers, with these lines at its end."""
    (tmp_path / "powered.toml").write_text(POWERED)
    (tmp_path / "b_pillar.step").symlink_to(DEMO / "b_pillar.step")
    process = '[process]\nmaterial = "steel"\nthickness_mm = 2\nchart = "powered.toml"\n'
    text = re.sub(r"^speed_m_min.*\n", "", SMALL, flags=re.MULTILINE)
    text = text.replace("[[contour]]", f"{process}\n[[contour]]", 1)
    path = tmp_path / "job.toml"
    path.write_text(text + program)
    return read_job(path)


def test_power_and_stages_of_a_chart_are_set_where_an_output_is_named(tmp_path):
    job = powered(tmp_path, '[program.rapid]\npower_output = "aoPower"\npower_full = 10.0\n')
    assert job.program.power_by_speed == ((0.0, 0.3), (1.0, 1.0))
    assert job.program.pierce_stages == ((0.4, 0.2), (0.8, 0.1))
    assert job.program.pierce_time == pytest.approx(0.3)
    sheet = " ".join(job.program.remarks)
    assert "power 3000 W" in sheet
    assert "pierce 1: 4 mm high" in sheet
    assert "pierce 2" not in sheet
    assert "by speed" not in sheet
    origins = {each.key: each.origin for each in origins_of(job.text, job.source)}
    assert origins["pierce_stages"] == origins["power_by_speed"] == "powered.toml row 1"


def test_power_and_stages_of_a_chart_are_for_the_operator_without_an_output(tmp_path):
    job = powered(tmp_path, "")
    assert job.program.power is None
    assert job.program.pierce_time == pytest.approx(0.3)
    sheet = " ".join(job.program.remarks)
    assert "power by speed" in sheet
    assert "pierce 2: 0.1 s 2400 W" in sheet
