"""How a program in URScript switches an output ahead of a target, and at what distance.

No instruction of URScript switches an output along a path. An instruction after a move acts when
the tip enters the blend at its end, or when it stops there. To switch earlier, a thread checks in
every control cycle how far the tip is from the target, and switches once it is close enough; the
instruction after the move repeats this, so that an output is never switched later.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

from kerfpath.post._program import Signal

__all__ = [
    "LOCAL",
    "distance_ahead",
    "names",
    "stop_lines",
    "switch_lines",
    "time_ahead",
    "wait_lines",
]

LOCAL = ("due", "gap", "most", "near", "on", "port", "target", "value", "waited")
"""Names inside the thread and the functions of `switch_lines`; contours must not have them."""


def distance_ahead(lead_time: float, speed: float, acceleration: float, *, stops: bool) -> float:
    """Return how far (m) from a target the tip is `lead_time` (s) before it arrives.

    Its speed (m/s) is constant; if it `stops`, it brakes with the acceleration (m/s^2).
    """
    braking = speed / acceleration if stops else 0.0
    if lead_time <= braking:
        return acceleration * lead_time**2 / 2
    return speed * (lead_time - braking / 2)


def time_ahead(distance: float, speed: float, acceleration: float, *, stops: bool) -> float:
    """Return the inverse of `distance_ahead`, s."""
    braking = speed / acceleration if stops else 0.0
    if distance <= speed * braking / 2:
        return sqrt(2 * distance / acceleration)
    return distance / speed + braking / 2


def names(signal: Signal) -> list[str]:
    """Return every name that the lines of `switch_lines` define."""
    parts = ("waits", "point", "distance", "value", "thread", "ahead", "set", "run")
    return [f"{signal}_{part}" for part in parts]


def stop_lines(outputs: Sequence[int]) -> list[str]:
    """Return the lines by which the controller sets outputs low whenever no program runs."""
    return [f"set_runstate_standard_digital_output_to_value({output}, 1)" for output in outputs]


def wait_lines(outputs: Sequence[int]) -> list[str]:
    """Return the lines that define the wait for an input.

    Without an answer all `outputs` are switched off and the program ends.
    """
    return [
        "def await_input(port, most):",
        "  waited = 0.0",
        "  while (get_standard_digital_in(port) == False) and (waited < most):",
        "    sync()",
        "    waited = waited + get_steptime()",
        "  end",
        "  if get_standard_digital_in(port) == False:",
        *(f"    set_standard_digital_out({output}, False)" for output in outputs),
        '    popup("no answer at an input", title="kerfpath", error=True)',
        "    halt",
        "  end",
        "end",
    ]


def switch_lines(signal: Signal, output: int) -> list[str]:
    """Return the lines that define how a signal is switched, by which digital output."""
    put = f"set_standard_digital_out({output}, "
    return [
        f"global {signal}_waits = False",
        f"global {signal}_point = p[0, 0, 0, 0, 0, 0]",
        f"global {signal}_distance = 0.0",
        f"global {signal}_value = False",
        f"thread {signal}_thread():",
        "  while True:",
        "    enter_critical",
        f"    gap = point_dist(get_actual_tcp_pose(), {signal}_point)",
        f"    value = {signal}_value",
        f"    due = {signal}_waits and (gap <= {signal}_distance)",
        "    if due:",
        f"      {signal}_waits = False",
        "    end",
        "    exit_critical",
        "    if due:",
        f"      {put}value)",
        "    end",
        "    sync()",
        "  end",
        "end",
        f"def {signal}_ahead(target, near, on):",
        "  enter_critical",
        f"  {signal}_point = pose_trans(part_frame, target)",
        f"  {signal}_distance = near",
        f"  {signal}_value = on",
        f"  {signal}_waits = True",
        "  exit_critical",
        "end",
        f"def {signal}_set(on):",
        f"  {signal}_waits = False",
        f"  {put}on)",
        "end",
    ]
