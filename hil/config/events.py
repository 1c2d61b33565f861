"""Events of a scenario, as the configuration holds them: read and written by hil/wire/commands."""

from __future__ import annotations

from typing import Annotated, Any, Final

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from hil.wire import commands
from hil.wire.commands import Declaration
from hil.wire.quantities import Field, Name, Number

Schema = dict[str, Any]

COURSES: Final = ("step", "ramp", "sine", "pulse", "noise", "playback")
"""Kinds of an entry of [events] that are no commands, but stimuli (suite/stimulus.py)."""


class _Table:
    """Tells pydantic how an event is read from its table, written as one, and described."""

    def __get_pydantic_core_schema__(
        self,
        _source: object,
        _handler: GetCoreSchemaHandler,
    ) -> CoreSchema:
        table = core_schema.plain_serializer_function_ser_schema(_table_of)
        return core_schema.no_info_plain_validator_function(_event_of, serialization=table)

    def __get_pydantic_json_schema__(
        self, _schema: CoreSchema, _handler: GetJsonSchemaHandler
    ) -> Schema:
        return {"oneOf": [_schema_of(declared) for declared in commands.DECLARED]}


def _event_of(given: Any) -> commands.TimedCommand:  # noqa: ANN401
    return (
        given if isinstance(given, commands.TimedCommand) else commands.read_event(given, COURSES)
    )


def _table_of(event: commands.TimedCommand) -> dict[str, Any]:
    return dict(event.table())


def _schema_of(declared: Declaration) -> Schema:
    fields = {field.name: _schema_of_field(field) for field in (commands.AT_S, *declared.fields)}
    required = [f.name for f in declared.fields if f.default is None and not f.optional]
    return {
        "type": "object", "title": declared.kind, "description": declared.meaning,
        "properties": {"kind": {"const": declared.kind}, **fields},
        "required": ["kind", *required], "additionalProperties": False,
    }  # fmt: skip


def _schema_of_field(field: Field) -> Schema:
    shared: Schema = {"description": field.meaning}
    if field.default is not None:
        shared["default"] = field.default
    if isinstance(field, Number):
        kind = "integer" if field.whole else "number"
        return shared | {"type": kind, "minimum": field.low, "maximum": field.high}
    if isinstance(field, Name):
        return shared | {"type": "string", "pattern": field.pattern}
    return shared | {"enum": list(field.names)}


Event = Annotated[commands.TimedCommand, _Table()]
