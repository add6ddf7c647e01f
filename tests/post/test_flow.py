"""Every path through a program: what is refused, and what every language writes passes."""

import re
from collections.abc import Iterator

import numpy as np
import pytest
from tests.post.cases import ASKING, refusal, renumbered
from tests.post.test_handshakes import ASKED, program, settings

from kerfpath import InputError
from kerfpath.post import (
    Await,
    ReadEnd,
    ReadHandshake,
    ReadJump,
    ReadLabel,
    ReadMove,
    ReadOff,
    ReadPause,
    ReadProgram,
    Request,
    Switch,
    post,
    read_program,
    unsafe_paths,
    unsafe_restarts,
)
from kerfpath.post.flow import section_of

ON, OFF = ((Switch(signal="laser", on=on),) for on in (True, False))


class Flow:
    """Builds a routine, one step a line."""

    def __init__(self):
        self.steps = []

    def add(self, step, /, **said):
        self.steps.append(step(file="a", line=len(self.steps) + 1, **said))
        return self

    def move(self, kind="linear", switches=()):
        return self.add(ReadMove, kind=kind, speed=0.1, switches=switches)

    def ask(self, partner, on=True):
        return self.add(ReadHandshake, what=Request(partner=partner, on=on))

    def wait(self, partner, otherwise="", timeout=1.0):
        what = Await(partner=partner, timeout=timeout)
        return self.add(ReadHandshake, what=what, otherwise=otherwise)

    def off(self, *outputs):
        for output in outputs:
            self.add(ReadOff, output=output)
        return self

    def cut(self):
        return self.move(switches=ON).move(switches=OFF)


def issues(*flows, **exits):
    sections = tuple(section_of(f"r{k}", flow.steps) for k, flow in enumerate(flows))
    known = {name: tuple(flow.steps) for name, flow in exits.items()}
    return unsafe_paths(ReadProgram(name="a", sections=sections, exits=known))


def messages(*flows, **exits):
    return [str(issue) for issue in issues(*flows, **exits)]


def asking():
    return Flow().move("joint").ask("shutter").add(ReadLabel, name="again").wait("ready")


def late(flow):
    """Jump over what follows if there is an answer; else everything goes off and it pauses."""
    flow.add(ReadJump, label="go", partner="ready").off("laser", "gas", "shutter")
    return flow.add(ReadPause)


def go_on(flow):
    return (
        flow.add(ReadJump, label="again").add(ReadLabel, name="go").cut().ask("shutter", on=False)
    )


def test_a_request_is_made_again_after_a_pause():
    assert messages(go_on(late(asking()).ask("shutter"))) == []
    assert messages(go_on(late(asking()))) == [
        "a, line 4: the program goes on here without the output of shutter after no answer at a, "
        "line 4"
    ]


def test_everything_is_off_at_a_pause():
    flow = asking().add(ReadJump, label="go", partner="ready").off("laser").add(ReadPause)
    (issue,) = issues(go_on(flow))
    assert issue.place == "a, line 7"
    assert "stops here with the output of shutter on" in issue.message


def test_a_wait_that_is_passed_without_an_answer_is_found():
    (issue,) = issues(Flow().ask("shutter").wait("ready").cut())
    assert issue.place == "a, line 3"
    assert "goes on here without the answer of ready" in issue.message


def test_a_program_that_ends_without_an_answer_switches_off_before():
    body = asking().cut()
    body.steps[3] = Flow().wait("ready", "late").steps[0]
    off = Flow().off("laser", "gas", "shutter").add(ReadEnd, of_program=True)
    assert messages(body, late=off) == []
    (issue,) = issues(body, late=Flow().off("laser").add(ReadEnd, of_program=True))
    assert "stops here with the output of shutter on" in issue.message
    with pytest.raises(InputError, match="the label late is missing"):
        issues(body)


def test_the_laser_is_off_between_routines_and_at_joint_moves():
    on = Flow().move(switches=ON)
    assert messages(on) == ["a, line 1: the program comes here with the laser on"]
    assert len(issues(on, Flow().move("joint"))) == 3  # both ends, and the joint move


def test_a_routine_that_ends_in_a_cut_is_found():
    flow = Flow().move(switches=ON).add(ReadEnd, of_program=False).move(switches=OFF)
    found = messages(flow, Flow().move("joint").cut())
    assert "a, line 2: the program comes here with the laser on" in found
    assert "a, line 3: the program never comes to this motion" in found


def test_labels_are_there_once_and_routines_end():
    with pytest.raises(InputError, match="line 1: the label x is missing"):
        section_of("a", Flow().add(ReadJump, label="x").steps)
    twice = Flow().add(ReadLabel, name="x").add(ReadLabel, name="x")
    with pytest.raises(InputError, match="line 2: the label x is given twice"):
        section_of("a", twice.steps)
    endless = Flow().add(ReadLabel, name="x").add(ReadJump, label="x")
    with pytest.raises(InputError, match=r"line 1: .* for ever"):
        section_of("a", endless.steps)


def test_no_program_and_an_empty_routine_have_no_paths():
    assert unsafe_paths(ReadProgram(name="a", sections=())) == []
    assert messages(Flow(), Flow()) == []


# -----------------------------------------------------------------------------
# A slow and obvious machine: all paths one by one, with plain dictionaries.


def slow_paths(steps, most=60) -> Iterator[list[tuple[int, dict]]]:
    """Yield every path of at most `most` steps as indices with the state before each step."""
    labels = {step.name: k for k, step in enumerate(steps) if isinstance(step, ReadLabel)}

    def go(at, state, path) -> Iterator[list[tuple[int, dict]]]:
        path = [*path, (at, state)]
        if at == len(steps) or len(path) > most:
            yield path
            return
        step, after = steps[at], dict(state)
        if isinstance(step, ReadEnd):
            yield path
        elif isinstance(step, ReadJump):
            jumps = step.partner is None or state["answer", step.partner]
            yield from go(labels[step.label] if jumps else at + 1, after, path)
        elif isinstance(step, ReadHandshake) and isinstance(step.what, Await):
            yield from go(at + 1, after | {("answer", step.what.partner): True}, path)
            if step.what.timeout < np.inf:
                place = labels[step.otherwise] if step.otherwise else at + 1
                yield from go(place, after | {("answer", step.what.partner): False}, path)
        else:
            if isinstance(step, ReadMove):
                after |= {("out", switch.signal): switch.on for switch in step.switches}
            elif isinstance(step, ReadHandshake):
                after["out", step.what.partner] = step.what.on
            elif isinstance(step, ReadOff):
                after["out", step.output] = False
            dropped = isinstance(step, ReadHandshake) and not step.what.on
            dropped |= isinstance(step, ReadMove) and step.kind == "joint"
            if dropped or (isinstance(step, ReadOff) and step.output != "laser"):
                after |= {key: False for key in after if key[0] == "answer"}
            yield from go(at + 1, after, path)

    names = [("out", "laser"), ("out", "shutter"), ("answer", "ready"), ("answer", "height")]
    yield from go(0, dict.fromkeys(names, False), [])


def slow_verdict(steps) -> bool:
    """Return whether every path is safe, by looking at each step of each path."""
    paths = list(slow_paths(steps))
    planned = dict(paths[0])
    if any(isinstance(s, ReadMove) and k not in planned for k, s in enumerate(steps)):
        return False
    for path in paths:
        for at, state in path:
            step = steps[at] if at < len(steps) else None
            on = [name for (kind, name), value in state.items() if kind == "out" and value]
            rests = isinstance(step, None | ReadHandshake | ReadPause | ReadEnd) or (
                isinstance(step, ReadMove) and step.kind == "joint"
            )
            stops = isinstance(step, ReadPause) or (isinstance(step, ReadEnd) and step.of_program)
            if (rests and "laser" in on) or (stops and on):
                return False
            done = step is None or isinstance(step, ReadMove | ReadHandshake)
            if done and at in planned and planned[at] != state:
                return False
    return True


def random_flow(rng):
    """Return a routine of random steps; half of them are grown from one that is safe."""
    kinds = {
        "cut": lambda f: f.cut(),
        "move": lambda f: f.move(["linear", "joint"][rng.integers(2)]),
        "shutter": lambda f: f.ask("shutter"),
        "shut": lambda f: f.ask("shutter", on=False),
        "on": lambda f: f.move(switches=ON),
        "off": lambda f: f.off(["laser", "shutter"][rng.integers(2)]),
        "wait": lambda f: f.wait(
            ["ready", "height"][rng.integers(2)], ["", "a", "b"][rng.integers(3)],
            [1.0, np.inf][rng.integers(2)],
        ),
        "jump": lambda f: f.add(
            ReadJump, label="ab"[rng.integers(2)], partner=["ready", "height"][rng.integers(2)]
        ),
        "back": lambda f: f.add(ReadJump, label="ab"[rng.integers(2)]),
        "pause": lambda f: f.add(ReadPause),
        "end": lambda f: f.add(ReadEnd, of_program=bool(rng.integers(2))),
    }  # fmt: skip
    flow = Flow()
    if rng.integers(2):
        go_on(late(asking()).ask("shutter"))
        names = ["shutter", "a", "wait", "jump", "off", "off", "pause", "shutter", "back", "b"]
        names += ["cut", "shut"]
        for _ in range(rng.integers(3)):
            names[rng.integers(len(names))] = rng.choice(list(kinds))
    else:
        names = list(rng.choice(list(kinds), rng.integers(1, 9)))
    for name in {"a", "b"} - set(names):
        names.insert(rng.integers(len(names) + 1), name)
    seen = set()
    for name in names:
        if name in ("a", "b"):
            if name not in seen:
                flow.add(ReadLabel, name=name)
            seen.add(name)
        else:
            kinds[name](flow)
    return flow.steps


def test_the_verdict_is_that_of_all_paths_one_by_one():
    rng, verdicts = np.random.default_rng(5), []
    while len(verdicts) < 600:
        steps = random_flow(rng)
        try:
            section = section_of("a", steps)
        except InputError:  # it comes back to a line for ever
            continue
        found = unsafe_paths(ReadProgram(name="a", sections=(section,)))
        verdicts.append(not found)
        assert verdicts[-1] == slow_verdict(steps), steps
    assert 30 < sum(verdicts) < 570  # both happen


# -----------------------------------------------------------------------------
# Begun at another line, or continued after everything went off.


def laser_lacks(steps, begin):
    """Return what the laser lacks where it first comes on, begun at a step with everything off.

    Slow and obvious: the planned path is walked twice, once from its beginning.
    """
    planned = [step for step in steps if not isinstance(step, ReadLabel | ReadOff | ReadPause)]

    def outputs_at_the_laser(of):
        outputs = set()
        for at, step in of:
            if isinstance(step, ReadHandshake):
                name = ("answer" if isinstance(step.what, Await) else "output", step.what.partner)
                if isinstance(step.what, Await) or step.what.on:
                    outputs.add(name)
                else:
                    outputs = {n for n in outputs if n[0] != "answer"} - {name}
            elif step.kind == "joint":
                outputs = {n for n in outputs if n[0] != "answer"}
            for switch in getattr(step, "switches", ()):
                (outputs.add if switch.on else outputs.discard)(("signal", switch.signal))
                if switch.signal == "laser" and switch.on and at >= begin:
                    return outputs
        return set()

    numbered = list(enumerate(planned))
    return outputs_at_the_laser(numbered) - outputs_at_the_laser(numbered[begin:])


def random_contour(rng):
    flow = Flow().move("joint")
    gas, pulse = (Switch(signal="gas", on=on) for on in (True, False)), rng.integers(3)
    gas_on, gas_off = gas
    for partner in ("shutter", "height")[: rng.integers(3)]:
        flow.ask(partner)
    for partner in ("ready", "interlock")[: rng.integers(3)]:
        flow.wait(partner, "late")
    early = rng.integers(2)
    if early:
        flow.move(switches=(gas_on,))
    flow.move(switches=ON if early else (gas_on, *ON))
    for _ in range(pulse):  # micro joints
        flow.move().move(switches=OFF).move(switches=ON)
    flow.move().move(switches=(*OFF, gas_off)).move()
    for partner in ("height", "shutter"):
        if any(getattr(s, "what", None) == Request(partner=partner, on=True) for s in flow.steps):
            flow.ask(partner, on=False)
    return flow


def test_unsafe_restarts_are_the_lines_from_which_the_laser_lacks_something():
    rng, told = np.random.default_rng(38), 0
    off = Flow().off("laser", "gas", "shutter", "height").add(ReadEnd, of_program=True)
    for _ in range(200):
        steps = random_contour(rng).steps
        program_read = ReadProgram(
            name="a", sections=(section_of("a", steps),), exits={"late": tuple(off.steps)}
        )
        assert unsafe_paths(program_read) == []
        unsafe = set()
        for issue in unsafe_restarts(program_read):
            first, last = (int(n) for n in (*re.findall(r"line (\d+)", str(issue)), 0)[:2])
            unsafe |= set(range(first, max(first, last) + 1))
        assert unsafe == {k + 1 for k in range(len(steps)) if laser_lacks(steps, k)}
        told += bool(unsafe)
    assert 100 < told < 200


def test_a_laser_that_needs_what_was_asked_for_stays_off_without_it():
    needing = (Switch(signal="laser", on=True, needs=("shutter",)),)
    safe, unsafe = (
        asking().move(switches=on).move(switches=OFF).ask("shutter", on=False).steps
        for on in (needing, ON)
    )
    told = [
        unsafe_restarts(ReadProgram(name="a", sections=(section_of("a", steps),)))
        for steps in (safe, unsafe)
    ]
    assert not told[0]
    assert "without the answer of ready and the output of shutter" in str(told[1][0])
    never = Flow().move("joint").move(switches=needing).move().steps
    assert unsafe_paths(ReadProgram(name="a", sections=(section_of("a", never),))) == []


def test_a_contour_that_asks_for_nothing_is_refused_at_its_first_line():
    """The second contour would be safe only after the first."""
    asked = Flow().move("joint").ask("shutter").cut()
    (issue,) = issues(asked, Flow().move("joint").cut().ask("shutter", on=False))
    assert "begun here" in issue.message
    assert "without the output of shutter" in issue.message
    assert messages(asked.ask("shutter", on=False), Flow().move("joint").cut()) == []


def test_answers_hold_for_one_contour():
    flow = Flow().move("joint").wait("ready", "late").cut()
    off = Flow().off("laser", "gas").add(ReadEnd, of_program=True)
    assert messages(flow, flow, late=off) == []


@pytest.mark.parametrize("name", ASKING)
@pytest.mark.parametrize("asked", [ASKED[:1], ASKED[2:], (ASKED[0], ASKED[2]), ASKED], ids=str)
@pytest.mark.parametrize("contours", [("one",), ("one", "two")], ids=len)
def test_all_handshakes_of_all_languages_end_safe_and_ask_again(name, asked, contours):
    """Time-outs, pauses and ends are followed by `unsafe_paths`; all other lines are begun at."""
    made, options = program(name, contours, handshakes=asked), settings(name)
    read = read_program(post(made, name, options), name, made.robot, options)
    assert unsafe_paths(read) == []
    stretches = unsafe_restarts(read)
    needs = name != "inform" and any(isinstance(each, Request) for each in asked)
    assert len(stretches) == (0 if needs else len(contours))
    for issue in stretches:
        lines = re.findall(r"(\S+), line (\d+)", str(issue))
        assert lines == sorted(lines, key=lambda line: (line[0] != lines[0][0], int(line[1])))
    for section in read.sections:  # no contour is unsafe at its first line
        if section.moves[0].kind == "joint":
            first = section.moves[0].place
            assert all(not str(issue).startswith(f"{first}:") for issue in stretches)


# -----------------------------------------------------------------------------
# Texts.


HANDSHAKE = {
    "rapid": r" +(SetDO x[34],1;|WaitDI)",
    "krl": r"\$OUT\[\d\]=|\$TIMER|WAIT FOR|WHILE|HALT|ENDWHILE",
    "fanuc": r" *\d+:  (DO\[\d\]=|WAIT DI|END|LBL|ABORT)",
    "val3": r"  (d[io]\w+=|while|disablePower|wait\(|endWhile)",
    "inform": r"DOUT|WAIT|\*WAIT|\*GO|JUMP|PAUSE",
    "urscript": r" +(set_standard_digital_out\([34], True|await_input\(\d)",
    "linuxcnc": r"  (M64 P[34]|o<await_input> call|o<laser_with> call)",
}


@pytest.mark.parametrize("name", ASKING)
def test_no_line_of_a_handshake_can_be_left_out_or_doubled(name):
    made, options = program(name, handshakes=ASKED), settings(name)
    files = post(made, name, options)
    assert not refusal(files, name, made, options)
    tried = 0
    for file, text in files.items():
        lines = text.split("\n")
        for k, line in enumerate(lines):
            if re.match(HANDSHAKE[name], line):
                tried += 1
                for others in ([], [line, line]):
                    edited = "\n".join([*lines[:k], *others, *lines[k + 1 :]])
                    if name == "fanuc":
                        edited = renumbered(edited)
                    assert refusal(files | {file: edited}, name, made, options), (file, k, line)
    assert tried >= 4


@pytest.mark.parametrize("moved", [True, False])
def test_the_end_of_a_listing_cannot_be_moved_into_its_cut(moved):
    """The routine would end there with the laser on, and the main program would call the next."""
    made, options = program("fanuc", ("one", "two"), handshakes=ASKED), settings("fanuc")
    files = post(made, "fanuc", options)
    lines = files["ONE.ls"].split("\r\n")
    begin = next(k for k, line in enumerate(lines) if line.endswith(":  END ;"))
    end = next(k for k, line in enumerate(lines) if line.endswith(":  ABORT ;")) + 1
    first = lines.index("/MN") + 1
    block, rest = lines[begin:end], lines[:begin] + lines[end:]
    for at in range(first, begin):
        edited = [*rest[:at], *block, *rest[at:]] if moved else [*lines[:at], *block, *lines[at:]]
        text = renumbered("\r\n".join(edited))
        assert refusal(files | {"ONE.ls": text}, "fanuc", made, options), lines[at]


@pytest.mark.parametrize("name", ["krl", "inform", "val3"])
def test_after_a_pause_everything_is_asked_for_again_in_order(name):
    text = "\n".join(post(program(name, handshakes=ASKED), name, settings(name)).values())
    stop = {"krl": "HALT", "inform": "PAUSE", "val3": "wait(isPowered())"}[name]
    first, second = (part.splitlines()[1:8] for part in text.split(stop)[1:3])
    asked = {
        "krl": ["$OUT[3]=TRUE", "$OUT[4]=TRUE", "WAIT FOR $IN[5]"],
        "inform": ["DOUT OT#(3) ON", "DOUT OT#(4) ON", "WAIT IN#(5)=ON"],
        "val3": ["doShutter=true", "doHeight=true", "wait(diReady==true)"],
    }[name]
    assert [line.strip() for line in first[:2]] == asked[:2]
    assert [line.strip() for line in second[:3]] == asked


@pytest.mark.parametrize("name", ["krl", "inform", "val3"])
def test_handshakes_in_two_places_are_asked_for_again_from_the_first(name):
    made = program(name, handshakes=ASKED)
    steps = list(made.steps)
    last = next(k for k in reversed(range(len(steps))) if not isinstance(steps[k], Request))
    twice = [*steps[: last + 1], Await(partner="ready", timeout=2.0), *steps[last + 1 :]]
    both = type(made)(
        name=made.name, robot=made.robot, T_flange_tip=made.T_flange_tip,
        T_base_part=made.T_base_part,
        sections=(type(made.sections[0])(name="one", steps=tuple(twice)),),
    )  # fmt: skip
    files = post(both, name, settings(name))
    assert not refusal(files, name, both, settings(name))
