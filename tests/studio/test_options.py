"""The form of options: what a control must know of a key follows from the key's declaration."""

from kerfpath.robots import robot
from kerfpath.studio.options import options_message

FORM = options_message(robot("abb_irb4600_60_205"))
FIELDS = {field.key: field for group in FORM.groups for field in group.fields}


def test_a_field_has_kind_unit_choices_and_bounds_of_its_key():
    step, metric = FIELDS["plan.gamma_step_deg"], FIELDS["plan.metric"]
    assert (step.kind, step.unit, step.default, step.high) == ("number", "deg", 2.0, 360.0)
    assert (metric.kind, metric.choices) == ("choice", ["manhattan", "chebychev", "euclid"])
    assert FIELDS["plan.refine"].kind == "switch"
    assert FIELDS["sequence"].kind == "table"
    assert FIELDS["part.xyz_mm"].kind == "list"
    assert FIELDS["plan.tilt_deg"].high == 90
    assert FIELDS["plan.tilt_cost_per_deg"].unit == "per deg"
    assert {"front/up", "rear", "front/down/minus"} <= set(FIELDS["plan.posture"].choices)
    assert {"rapid", "none"} <= set(FORM.languages)


def test_what_a_field_needs_or_goes_with_is_a_field():
    for field in FIELDS.values():
        assert field.needs is None or field.needs in FIELDS
        assert field.companion is None or field.companion.key in FIELDS
