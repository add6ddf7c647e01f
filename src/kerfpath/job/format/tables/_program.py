"""The [program] and [audit] tables: the robot program, and the tolerances of its audit."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, ValidationError, field_validator, model_validator

from kerfpath.job.format._values import Identifier, NotNegative, Positive, fault, key, nearest
from kerfpath.job.format.tables._table import Table
from kerfpath.post import PARTNERS, Await, Handshake, LanguageSettings, Partner, Request, languages

__all__ = ["AuditTable", "ProgramTable"]


PARTNERS_SAID = f"a list of {', '.join(PARTNERS)}"


class ProgramTable(Table):
    """[program]: the robot program, its language and process values.

    A table [program.LANGUAGE] in it holds the settings of that language.
    """

    model_config = ConfigDict(extra="allow")

    language: Annotated[str, key("a robot language, or none for no program", '"rapid"')] = "rapid"
    name: Identifier = None
    retract_mm: Annotated[Positive, key("a number above 0, in mm", "50")] = 50.0
    zone_mm: Annotated[
        NotNegative | Literal["auto"], key('"auto" or a number not below 0, in mm', '"auto"')
    ] = "auto"
    zone_error_mm: Annotated[Positive | None, key("a number above 0, in mm", "0.1")] = None
    lead_time_s: Annotated[NotNegative, key("a number not below 0, in s", "0.02")] = 0.02
    arcs_mm: Annotated[Positive | None, key("a number above 0, in mm", "0.01")] = None
    gas_lead_s: Annotated[NotNegative | None, key("a number not below 0, in s", "0.3")] = None
    pierce_time_s: Annotated[NotNegative, key("a number from 0 to 60, in s", "0.3", le=60)] = 0.0
    approach_mm_s: Annotated[Positive, key("a number above 0, in mm/s", "100")] = 100.0
    air_speed: Annotated[
        Positive | None, key("a share of the full speed, from 0.01 to 1", "0.25", ge=0.01, le=1)
    ] = None

    request: Annotated[list[Partner] | None, key(PARTNERS_SAID, '["shutter"]')] = None
    wait_for: Annotated[list[Partner] | None, key(PARTNERS_SAID, '["ready"]')] = None
    wait_timeout_s: Annotated[Positive, key("a number from 0 to 600, in s", "5", le=600)] = 5.0

    @field_validator("request", "wait_for")
    @classmethod
    def _is_said_once(cls, partners: list[Partner] | None) -> list[Partner] | None:
        if partners and len(set(partners)) < len(partners):
            raise fault("each partner once", repr(partners), "remove the second")
        return partners

    def handshakes(self) -> tuple[Handshake, ...]:
        """Return the handshakes before each contour."""
        requests = (Request(partner=partner, on=True) for partner in self.request or ())
        timeout = self.wait_timeout_s
        waits = (Await(partner=partner, timeout=timeout) for partner in self.wait_for or ())
        return *requests, *waits

    @field_validator("language")
    @classmethod
    def _is_known(cls, name: str) -> str:
        if name not in languages() and name != "none":
            known = [*languages(), "none"]
            raise fault("a robot language, or none", None, f"write one; {nearest(name, known)}")
        return name

    @model_validator(mode="after")
    def _settings_fit(self) -> ProgramTable:
        for name, table in (self.model_extra or {}).items():
            if name not in languages():
                known = [*type(self).model_fields, *languages()]
                raise fault("a key of [program]", "an unknown name", nearest(name, known), (name,))
            _settings(name, table)
        return self

    def settings(self) -> LanguageSettings | None:
        """Return the settings of the language; None without a program."""
        if self.language == "none":
            return None
        return _settings(self.language, (self.model_extra or {}).get(self.language, {}))


def _settings(name: str, table: Any) -> LanguageSettings:
    """Return the settings that a table [program.LANGUAGE] holds, or raise at its first fault."""
    model = languages()[name].settings
    try:
        return model.model_validate(table)
    except ValidationError as error:
        detail = error.errors(include_url=False)[0]
    at = str(detail["loc"][0]) if detail["loc"] else ""
    if at not in model.model_fields:
        got = "an unknown name" if at else f"{table!r}"
        remedy = nearest(at, list(model.model_fields))
        raise fault(f"a key of [program.{name}]", got, remedy, (name, *([at] if at else [])))
    field = model.model_fields[at]
    remedy = f"write, for example, {at} = {(field.examples or [''])[0]}"
    got = f"{detail['input']!r}"[:60]
    raise fault(field.description or "another value", got, remedy, (name, at))


class AuditTable(Table):
    """[audit]: how far the tool may leave the path between the nodes."""

    path_tolerance_mm: Annotated[Positive, key("a number above 0, in mm", "0.1")] = 0.1
    axis_tolerance_deg: Annotated[Positive, key("a number above 0, in deg", "1")] = 1.0
