"""Checks that a program must pass before it is written, for all languages."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from kerfpath.arrays import Array
from kerfpath.errors import InputError
from kerfpath.losses import Loss, Reason
from kerfpath.post.arcs import distances
from kerfpath.post.languages import (
    REMEDY_SHORT,
    STRETCHED,
    Language,
    LanguageSettings,
    Rules,
    find_long_contours,
    handshakes,
)
from kerfpath.post.languages import language as find_language
from kerfpath.post.program import (
    SIGNALS,
    Await,
    CircularMove,
    JointMove,
    LinearMove,
    Move,
    Program,
    ProgramIssue,
    Request,
    Section,
    SetPower,
    Step,
    Wait,
    switches_of,
)

SHORTEST = 1e-9
"""Shortest time (s) of a move whose stretch is computed."""
LARGEST_JOINT_STEP = np.pi
"""Joint step (rad) from which the short way round is no longer unique."""
LARGEST_ORIENTATION_STEP = np.pi / 2
"""Turn of the tool (rad) between linear targets below which all controllers interpolate alike."""
LOWEST_SHARE = 0.01
"""Smallest share of the full speed of a joint move: controllers count it in percent."""
LONGEST_WAIT = 60.0
"""Longest wait (s); a longer one is a mistake in its unit."""
LONGEST_TIMEOUT = 600.0
"""Longest timeout (s) of an input."""
ROUNDING = 1e-9
"""Share by which half a distance may be exceeded because of rounding."""
LIMIT_NOISE = 1e-9
"""Excess over a joint limit (rad) that comes from rounding."""


def preflight(
    program: Program, language: str = "rapid", settings: LanguageSettings | None = None
) -> list[ProgramIssue]:
    """Return all issues that speak against running `program`; empty if none is known.

    Parameters
    ----------
    program : Program
    language : str
        One of `languages()`.
    settings : LanguageSettings, optional
        Settings of the language; default: its defaults.

    Raises
    ------
    InputError
        The language is unknown, or the settings are those of another language.
    """
    chosen = find_language(language)
    settings = chosen.settings() if settings is None else settings
    if not isinstance(settings, chosen.settings):
        raise InputError(
            f"settings: expected {chosen.settings.__name__} of language {language!r}, got "
            f"{type(settings).__name__}"
        )
    issues = foresee(program, chosen, settings)
    settings = chosen.completed(settings)
    rules = chosen.rules(settings)
    for section in program.sections:
        issues += [*_check_laser(section), *_check_power(section)]
        issues += _check_stays(section)
        issues += _check_motion(program, section, rules)
        issues += _check_limits(program, section)
    if not any(issue.level == "error" for issue in issues):
        issues += find_long_contours(chosen.formatter(program, settings))
        issues += [] if chosen.check is None else chosen.check(program, settings)
    if not program.air_checked and any(isinstance(move, JointMove) for move in program.moves):
        issues.append(
            ProgramIssue(
                "warning",
                "air-moves",
                "the transfer moves have not been checked for collisions; run them at low speed "
                "first",
                "program",
            )
        )
    return issues


def foresee(program: Program, chosen: Language, settings: LanguageSettings) -> list[ProgramIssue]:
    """Return the issues of a program that do not depend on targets: names, numbers, outputs."""
    rules = chosen.rules(settings)
    issues = list(_check_robot(program, chosen))
    numbers = [issue for section in program.sections for issue in _check_numbers(section, rules)]
    outputs = list(_check_outputs(program, chosen, settings))
    settings = chosen.completed(settings)
    outputs += _check_ports(program, chosen, settings)
    if program.robot.externals and chosen.externals is not None:
        found = chosen.externals(program.robot, settings)
        outputs += [ProgramIssue("error", "external-axes", each, "program") for each in found]
    issues += numbers + outputs
    # Speeds and zones are named by their formatted values: only finite ones can be.
    unnamed = any(issue.level == "error" for issue in outputs)
    if not numbers and not unnamed and not chosen.refusal(program.robot):
        issues += _check_names(program, chosen, rules, settings)
    return issues


def _check_outputs(
    program: Program, language: Language, settings: LanguageSettings
) -> Iterator[ProgramIssue]:
    """Check that there is an output for everything that is switched; warn of assumed ones."""
    assumed = [key.removesuffix("_output") for key in language.assumed]
    follows = any(isinstance(step, SetPower) and step.per_speed for step in program.steps)
    refusal = language.power_refusal("controller" if follows else "steps")
    if "power" in program.signals and refusal:
        yield ProgramIssue("error", "power", refusal, "program")
        return
    if getattr(settings, "power_output", None) is not None:
        if getattr(settings, "power_full", None) is None:
            message = f"say the value at full power with power_full in [program.{language.name}]"
            yield ProgramIssue("error", "output", message, "program")
        elif "power" not in program.signals:
            message = "power_output is named, but stays 0: no power_by_speed says how it is set"
            yield ProgramIssue("warning", "power", message, "program")
    for signal in sorted({*program.signals, *assumed}):
        key = f"{signal}_output"
        if key not in type(settings).model_fields or getattr(settings, key) is not None:
            continue
        remedy = f"name it with {key} in [program.{language.name}]"
        message = f"the {signal} is switched, but no output is named for it; {remedy}"
        if (taken := language.assumed.get(key)) is not None:
            message = f"no output is named for the {signal}, so {taken} is used; {remedy}"
        yield ProgramIssue("error" if taken is None else "warning", "output", message, "program")


def _check_ports(
    program: Program, language: Language, settings: LanguageSettings
) -> Iterator[ProgramIssue]:
    """Check that every handshake has its own input or output."""
    known = handshakes(settings)
    steps = dict.fromkeys(s for s in program.steps if isinstance(s, Request | Await))
    wanted = {(s.partner, "input" if isinstance(s, Await) else "output") for s in steps}
    for partner, way in sorted(wanted):
        if (partner, way) not in known:
            message = f"{language.title} has no {way} for the handshake {partner}; leave it out"
            yield ProgramIssue("error", "handshake", message, "program")
        elif known[partner, way] is None:
            message = (
                f"no {way} is named for the handshake {partner}; name it with {partner}_{way} in "
                f"[program.{language.name}]"
            )
            yield ProgramIssue("error", "handshake", message, "program")
    ports: list[tuple[str, str, object]] = [
        (signal, "output", getattr(settings, f"{signal}_output", None))
        for signal in SIGNALS
        if signal != "power"  # which is analogue
    ]
    ports += [(partner, way, port) for (partner, way), port in known.items()]
    taken: dict[tuple[str, object], str] = {}
    for name, way, port in ports:
        key = f"{name}_{way}"
        if port is not None and (other := taken.setdefault((way, port), key)) != key:
            message = f"{other} and {key} are both {port}; name two different ones"
            code = "output" if name in SIGNALS else "handshake"
            yield ProgramIssue("error", code, message, "program")


def _check_robot(program: Program, language: Language) -> Iterator[ProgramIssue]:
    if refusal := language.refusal(program.robot):
        yield ProgramIssue("error", "wrong-arm", refusal, "program")
    if doubt := language.doubt(program.robot):
        yield ProgramIssue("warning", "wrong-robot", doubt, "program")
    if not program.sections:
        yield ProgramIssue("error", "empty", "there is no contour to cut", "program")


def _check_names(
    program: Program, language: Language, rules: Rules, settings: LanguageSettings
) -> Iterator[ProgramIssue]:
    seen: dict[str, str] = {}
    for name, what in language.formatter(program, settings).names():
        if not re.fullmatch(rules.name, name, re.ASCII):
            yield ProgramIssue(
                "error",
                "name-identifier",
                f"{name!r} is not a name in {language.title}; expected a letter, then letters, "
                "digits and _",
                what,
            )
        elif len(name) > rules.longest_name:
            yield ProgramIssue(
                "error",
                "name-length",
                f"{name!r} has {len(name)} characters, expected at most {rules.longest_name}",
                what,
            )
        elif language.is_reserved(name):
            message = f"{name!r} is reserved in {language.title}; rename it"
            yield ProgramIssue("error", "name-reserved", message, what)
        elif (other := seen.get(name.lower())) is not None:
            yield ProgramIssue(
                "error", "name-collision", f"{name!r} is also the name of {other}; rename it", what
            )
        seen[name.lower()] = what


def _check_numbers(section: Section, rules: Rules) -> Iterator[ProgramIssue]:
    """Check that speeds, zones and lead times are numbers that the language can write."""
    lead = f"the lead time must lie between 0 and {rules.longest_lead:g} s"
    share = f"the share of the full speed must lie between {LOWEST_SHARE:g} and 1"
    most = "" if np.isinf(rules.fastest) else f" and at most {rules.fastest * 1e3:g} mm/s"
    speed = f"the speed must be at least {rules.slowest * 1e3:g} mm/s{most}"
    for place, step, _, _ in _walk(section):
        wrong: list[tuple[str, str]] = []
        if isinstance(step, LinearMove) and not (
            np.isfinite(step.speed) and rules.slowest <= step.speed <= rules.fastest
        ):
            wrong.append(("speed", f"{speed}, got {step.speed * 1e3:g} mm/s"))
        if isinstance(step, JointMove) and not LOWEST_SHARE <= step.speed <= 1:
            wrong.append(("speed", f"{share}, got {step.speed:g}"))
        if isinstance(step, LinearMove | JointMove) and not 0 <= step.zone < np.inf:
            message = f"the zone must be 0 mm (stop) or more, got {step.zone * 1e3:g} mm"
            wrong.append(("zone", message))
        for switch in switches_of(step):
            if not (0 <= switch.lead_time < np.inf and switch.lead_time <= rules.longest_lead):
                wrong.append(("lead-time", f"{lead}, got {switch.lead_time:g} s"))
        for code, message in wrong:
            yield ProgramIssue("error", code, message, place)


def _walk(section: Section) -> Iterator[tuple[str, Step, bool, bool]]:
    """Yield place and step, and whether the robot is stopped before it and the laser is on."""
    stands, on = False, False
    for number, step in enumerate(section.steps):
        yield f"{section.name}, step {number}", step, stands, on
        if isinstance(step, JointMove | LinearMove):
            stands = step.zone == 0
        for switch in switches_of(step):
            on = switch.on if switch.signal == "laser" else on


def _check_stays(section: Section) -> Iterator[ProgramIssue]:
    """Check that waits and handshakes take a sensible time while the robot is stopped."""
    for place, step, stands, on in _walk(section):
        if isinstance(step, Wait):
            if not 0 < step.time <= LONGEST_WAIT:
                message = f"more than 0 s and at most {LONGEST_WAIT:g} s, got {step.time:g} s"
                yield ProgramIssue("error", "wait", f"a wait must last {message}", place)
            if not stands:
                yield ProgramIssue("error", "wait", "a wait must follow a move that stops", place)
        if isinstance(step, SetPower) and not (
            stands and 0 <= step.share <= 1 and 0 <= step.per_speed < np.inf
        ):
            message = "a power must be a share from 0 to 1, and follow a move that stops"
            yield ProgramIssue("error", "power", message, place)
        if isinstance(step, Request | Await) and (on or not stands):
            message = "a handshake must follow a move that stops, with the laser off"
            yield ProgramIssue("error", "handshake", message, place)
        if isinstance(step, Await) and not 0 < step.timeout <= LONGEST_TIMEOUT:
            message = f"more than 0 s and at most {LONGEST_TIMEOUT:g} s, got {step.timeout:g} s"
            yield ProgramIssue("error", "handshake", f"a timeout must be {message}", place)


def _check_laser(section: Section) -> Iterator[ProgramIssue]:
    """Check that the laser is only on between its switches, along the path, and off after."""
    on = False
    for place, step, _, on in _walk(section):
        if isinstance(step, JointMove) and on:
            yield ProgramIssue("error", "laser-order", "the laser is on during a joint move", place)
        for switch in switches_of(step):
            if switch.signal == "laser" and on == switch.on:
                state = "on" if on else "off"
                message = f"the laser is switched {state}, but is already {state}"
                yield ProgramIssue("error", "laser-order", message, place)
            on = switch.on if switch.signal == "laser" else on
    if on:
        yield ProgramIssue("error", "laser-order", "the laser is still on at the end", section.name)


def _check_power(section: Section) -> Iterator[ProgramIssue]:
    """Check that there is no power in joint moves and at the end, and that it is a share."""
    share = 0.0
    for index, step in enumerate(section.steps):
        place = f"{section.name}, step {index}"
        if isinstance(step, JointMove) and share > 0:
            yield ProgramIssue("error", "power", "the power is on during a joint move", place)
        share = max(step.share, step.per_speed) if isinstance(step, SetPower) else share
        for switch in switches_of(step):
            said = switch.share if switch.signal == "power" else None
            if (said is None) == (switch.signal == "power"):
                message = f"expected a share of the {switch.signal} if and only if it is the power"
                yield ProgramIssue("error", "power", message, place)
            elif said is not None and (not 0 <= said <= 1 or switch.on != (said > 0)):
                message = f"expected a share of the power from 0 to 1, on above 0, got {said:g}"
                yield ProgramIssue("error", "power", message, place)
            share = share if said is None else said
    if share > 0:
        yield ProgramIssue("error", "power", "the power is still on at the end", section.name)


def _check_motion(program: Program, section: Section, rules: Rules) -> Iterator[ProgramIssue]:
    """Check the path of a section: steps, zones, turning speed, lead times."""
    moves = section.moves
    if len(moves) < 2:
        return
    T = program.tips(moves)
    q = np.array([move.q for move in moves])
    lengths, turn = distances(T[:-1], T[1:])
    on_path = np.array([isinstance(move, LinearMove) for move in moves[1:]])
    linear = np.array([unit == "m" for unit in program.robot.units])
    step = np.where(linear, 0.0, np.abs(np.diff(q, axis=0)))
    for k in np.flatnonzero(on_path & (step.max(axis=1) >= LARGEST_JOINT_STEP)).tolist():
        joint = int(np.argmax(step[k]))
        name, by_deg = program.robot.joint_names[joint], np.degrees(step[k, joint])
        yield ProgramIssue(
            "error",
            "joint-step",
            f"{name} turns {by_deg:.1f} deg in one move of the path, expected less than "
            f"{np.degrees(LARGEST_JOINT_STEP):g} deg; use finer nodes",
            f"{section.name}, move {k + 1}",
        )
    for k in np.flatnonzero(on_path & (turn >= LARGEST_ORIENTATION_STEP)).tolist():
        yield ProgramIssue(
            "error",
            "orientation-step",
            f"the tool turns {np.degrees(turn[k]):.1f} deg in one move of the path, expected less "
            f"than {np.degrees(LARGEST_ORIENTATION_STEP):g} deg; use finer nodes",
            f"{section.name}, move {k + 1}",
        )
    speed = np.array([move.speed for move in moves[1:]])
    most = rules.controller.turning_speed
    if too_fast := int((on_path & (turn * speed > most * lengths)).sum()):
        yield ProgramIssue(
            "warning",
            "turning-speed",
            f"in {too_fast} moves of the path the tool turns faster than "
            f"{np.degrees(most):g} deg/s; the controller will slow the tip down",
            section.name,
        )
    yield from _check_shortest(section, lengths, rules)
    near = np.minimum(np.append(lengths, np.inf), np.append(np.inf, lengths))
    zone = np.array([move.zone for move in moves])
    if overlaps := int((zone > near / 2 * (1 + ROUNDING)).sum()):
        yield ProgramIssue(
            "warning",
            "zone-overlap",
            f"at {overlaps} of {len(moves)} targets the zone is larger than half the distance to a "
            "neighbour; the controller will reduce it",
            section.name,
        )
    yield from _check_lead_times(section, lengths.tolist())


def _check_shortest(section: Section, lengths: Array, rules: Rules) -> Iterator[ProgramIssue]:
    """Check that the controller's cycle does not stretch moves of the path."""
    controller, moves = rules.controller, section.moves[1:]
    took = np.array(
        [
            move.duration if isinstance(move, CircularMove) else length / max(move.speed, 1e-9)
            for move, length in zip(moves, lengths.tolist(), strict=True)
            if isinstance(move, LinearMove)
        ]
    )
    number = [k for k, move in enumerate(moves, 1) if isinstance(move, LinearMove)]
    if not took.size:
        return
    found = controller.short_moves(np.maximum(took, SHORTEST))
    if found.share <= STRETCHED:
        return
    planned, last = took[found.worst] * 1e3, number[found.worst]
    at = f"x, y, z = {', '.join(f'{x * 1e3:.1f}' for x in _end(moves[last - 1]))} mm"
    yield ProgramIssue(
        found.level,
        "cycle-as-run",
        f"{found.words}. The worst, to {at}, lasts {planned:.3g} ms and takes "
        f"{planned * (1 + found.share):.3g} ms; {REMEDY_SHORT}",
        f"{section.name}, move {last}",
    )


def _end(move: Move) -> Array:
    assert isinstance(move, LinearMove)
    return move.T_part_tip[:3, 3]


def _check_lead_times(section: Section, lengths: list[float]) -> Iterator[ProgramIssue]:
    for k, (move, length) in enumerate(zip(section.moves[1:], lengths, strict=True), 1):
        for switch in move.switches if isinstance(move, LinearMove) and move.speed > 0 else ():
            if switch.lead_time > length / move.speed:
                yield ProgramIssue(
                    "warning",
                    "short-lead",
                    f"the {switch.signal} is to be switched {switch.lead_time * 1e3:g} ms ahead, "
                    f"but the move there lasts only {length / move.speed * 1e3:.1f} ms; it is "
                    "switched as that move begins",
                    f"{section.name}, move {k}",
                )


def _check_limits(program: Program, section: Section) -> Iterator[ProgramIssue]:
    if not section.moves:
        return
    robot = program.robot
    limits, arm = robot.joint_limits(), robot.family.joints
    q = np.array([move.q for move in section.moves])
    below, above = limits.lower - q, q - limits.upper
    below[:, limits.endless] = above[:, limits.endless] = -np.inf
    sums = q @ limits.rows.T
    below = np.insert(below, [arm], limits.row_lower - sums, axis=1)
    above = np.insert(above, [arm], sums - limits.row_upper, axis=1)
    excess = np.stack([below, above], axis=2).reshape(len(q), -1)
    words = list(robot.bounds())
    words += [Reason(end, axis.name) for axis in robot.externals for end in (Loss.LOW, Loss.HIGH)]
    linear = {axis.name for axis in robot.externals if axis.kind == "linear"}
    for k, i in np.argwhere(excess > LIMIT_NOISE).tolist():
        in_mm, by = words[i].which in linear, float(excess[k, i])
        said = f"{by * 1e3:.3f} mm" if in_mm else f"{np.degrees(by):.3f} deg"
        message = f"{words[i]}: {said} beyond its limit"
        yield ProgramIssue("error", "axis-limit", message, f"{section.name}, move {k}")
