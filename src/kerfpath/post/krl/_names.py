"""Names that mean something else in KRL."""

from __future__ import annotations

__all__ = ["is_reserved"]

KEYWORDS = (
    "and anin anout asyptp asycancel b_and b_exor b_not b_or bool brake c_dis c_ori c_ptp c_spl "
    "c_vel case cast_from cast_to char circ circ_rel confirm const continue decl def default "
    "defdat deffct delay distance do else end enddat endfct endfor endif endloop endspline "
    "endswitch endwhile enum exit exor ext extfct false for global goto halt if import in inout "
    "int interrupt is lin lin_rel loop maximum minimum not on onstart off or out path prio ptp "
    "ptp_rel ptp_spline public pulse real repeat resume return scirc scirc_rel sec signal slin "
    "slin_rel spl spl_rel spline sptp sptp_rel step struc switch then time_block to trigger true "
    "until wait when while with const_vel"
)
"""Keywords of the language."""
MEANINGS = (
    "abs acos atan2 cos sin sqrt tan axis e3axis e3pos e6axis e6pos frame load pos base_data "
    "tool_data load_data machine_def machine_tool_data bas bas_command cell home xhome sps "
    "ir_stopm p00 fdat pdat ldat fdat_act pdat_act ldat_act basis_sugg_t err_raise varstate cread "
    "on_error_proceed cwrite copen cclose sread swrite forward inverse strlen strclear stradd "
    "strcomp strcopy strfind strtofrm timer flag msgnotify msgquit msgdialog"
)
"""Types, functions, data and programs that a controller has, where a contour may be named so."""
RESERVED = frozenset((KEYWORDS + " " + MEANINGS).split())


def is_reserved(name: str) -> bool:
    """Return whether KRL or every KUKA controller gives `name` another meaning."""
    return name.lower() in RESERVED
