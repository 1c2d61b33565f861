"""Records: the packed bytes are MCAP Message records that others decode to the same values."""

import math
import struct
from io import BytesIO
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.data_stream import ReadDataStream
from mcap.records import Message
from mcap_ros2._dynamic import generate_dynamic

from hil.log import packing
from hil.log.definitions import parse_definition
from hil.log.records import CDR_LE, Field, Layout, Record, Topic, definition, fields_of
from hil.log.topics import ALL, EVENT, FRAMES_SENT, HOT, SENSOR, TIMING

FLOATS = st.floats(allow_nan=False)
SCALARS = {
    "uint8": st.integers(0, 2**8 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "float64": FLOATS,
    "string": st.text(st.characters(exclude_characters="\0", codec="utf-8")),
    "uint8[]": st.binary(max_size=200),
    "uint8[4]": st.tuples(*[st.integers(0, 255)] * 4),
    "float64[8]": st.tuples(*[st.floats(allow_nan=False)] * 8),
    "int64[4]": st.tuples(*[st.integers(-(2**63), 2**63 - 1)] * 4),
}


def values_of(topic):
    """Any record of the topic, at a time that MCAP can hold."""
    by_name = {"t_ns": st.integers(0, 2**63 - 1)}
    return st.tuples(*[by_name.get(f.name, SCALARS[f.type]) for f in topic.layout.fields])


def message_of(packed):
    opcode, length = struct.unpack_from("<BQ", packed)
    assert (opcode, length) == (5, len(packed) - 9)
    return Message.read(ReadDataStream(BytesIO(packed[9:])), length)


def plain(value):
    """Arrays and bytes come in containers of the decoder's own: compare their items."""
    return value if isinstance(value, (str, int, float)) else tuple(value)


DECODERS = {
    topic.name: generate_dynamic(topic.schema_name, topic.definition)[topic.schema_name]
    for topic in ALL
}


@pytest.mark.parametrize("topic", ALL, ids=lambda topic: topic.name)
@given(data=st.data())
def test_every_decoder_returns_what_was_packed(topic, data):
    values = data.draw(values_of(topic))
    message = message_of(topic.pack(*values))
    names = [field.name for field in topic.layout.fields]
    named = dict(zip(names, values, strict=True))
    assert message.channel_id == topic.channel_id
    assert message.log_time == message.publish_time == named["t_ns"]
    assert message.sequence == named["tick"]
    assert message.data[:4] == CDR_LE
    assert topic.layout.unpack(message.data[4:]) == values
    theirs = DECODERS[topic.name](message.data)
    for name, value in named.items():
        assert plain(getattr(theirs, name)) == plain(value), name


@pytest.mark.parametrize("topic", [t for t in ALL if not t.layout.variable], ids=lambda t: t.name)
@given(data=st.data())
def test_numpy_reads_what_was_packed(topic, data):
    values = data.draw(values_of(topic))
    payload = message_of(topic.pack(*values)).data[4:]
    row = np.frombuffer(payload, np.dtype(topic.layout.numpy_spec))[0]
    assert len(payload) == topic.layout.size
    for field, value in zip(topic.layout.fields, values, strict=True):
        assert np.array_equal(row[field.name], value), field.name


def test_not_a_number_survives():
    packed = SENSOR.pack(1, 2, math.nan, 0.0, 0.0, 0.0, 0.0, 1)
    assert math.isnan(SENSOR.layout.unpack(message_of(packed).data[4:])[2])


def test_fields_may_be_given_by_name():
    by_name = EVENT.pack(text="b", code="a", severity=1, t_ns=3, tick=2)
    assert by_name == EVENT.pack(2, 3, 1, "a", "b")


@pytest.mark.parametrize("topic", ALL, ids=lambda topic: topic.name)
def test_the_definition_holds_everything_that_was_declared(topic):
    assert parse_definition(topic.definition) == topic.layout.fields


@pytest.mark.parametrize("topic", ALL, ids=lambda topic: topic.name)
def test_every_field_that_names_a_unit_declares_it(topic):
    units = {"_m_s": "m/s", "_n_s_m": "N s/m", "_ns": "ns", "_kg": "kg", "_pa": "Pa", "_w": "W"}
    for field in topic.layout.fields:
        expected = next((u for end, u in units.items() if field.name.endswith(end)), None)
        assert field.text
        assert expected in (None, field.unit), field.name


def test_topics_have_names_and_channels_of_their_own():
    assert len({topic.name for topic in ALL}) == len(ALL)
    assert len({topic.channel_id for topic in ALL}) == len(ALL)


def add(topic, values):
    """Add a record by the generated function of its topic."""
    getattr(packing, topic.name[1:].replace("/", "_"))(*values)


@given(data=st.data())
def test_the_generated_functions_pack_the_same_bytes(data):
    """One record or several, in any order: as `Topic.pack`, which the decoders above judge."""
    topics = data.draw(st.lists(st.sampled_from(HOT), max_size=6))
    records = [(topic, data.draw(values_of(topic))) for topic in topics]
    packing.begin()
    for topic, values in records:
        add(topic, values)
    assert packing.packed() == b"".join(topic.pack(*values) for topic, values in records)


@pytest.mark.parametrize("topic", HOT, ids=lambda topic: topic.name)
def test_the_generated_functions_refuse_what_is_outside_its_type(topic):
    zeros = {"uint8[]": b"", "float64": 0.0}
    kinds = [field.type for field in topic.layout.fields]
    values = [zeros.get(k, (0,) * 4 if "[4]" in k else 0) for k in kinds]
    packing.begin()
    add(topic, values)
    good = packing.packed()
    for i, kind in enumerate(kinds):
        if not kind.startswith("uint") or kind == "uint8[]":
            continue
        for wrong in (-1, 2 ** (32 if kind == "uint32" else 8)):
            bad = (0, 0, 0, wrong) if "[4]" in kind else wrong
            with pytest.raises(struct.error):
                add(topic, [*values[:i], bad, *values[i + 1 :]])
    with pytest.raises(struct.error):
        add(topic, [-1 if field.name == "t_ns" else value
                    for field, value in zip(topic.layout.fields, values, strict=True)])  # fmt: skip
    assert packing.packed() == good


@pytest.mark.parametrize("values", [(1, 2), (1, 2, 3, 4, 5, 6, 7, 8)])
def test_a_record_with_a_field_too_few_or_too_many_is_refused(values):
    with pytest.raises(TypeError, match="/timing has the fields tick, t_ns, scheduled_ns"):
        TIMING.pack(*values)


def test_a_value_outside_its_type_is_refused():
    with pytest.raises(struct.error):
        SENSOR.pack(2**32, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
    with pytest.raises(struct.error):
        FRAMES_SENT.pack(0, -1, b"")


def test_a_field_without_declaration_is_refused():
    class Wrong(Record):
        tick: int

    with pytest.raises(TypeError, match=r"Wrong\.tick: exactly one Field"):
        fields_of(Wrong)


def test_a_record_needs_tick_and_time():
    class Timeless(Record):
        tick: Annotated[int, Field("uint32", "number of the tick")]

    with pytest.raises(ValueError, match="tick and t_ns"):
        Topic("/timeless", 9, Timeless)


@pytest.mark.parametrize("kind", ["uint24", "string[4]", "float64[]", "geometry_msgs/Point"])
def test_an_unknown_type_is_refused_with_the_accepted_ones(kind):
    with pytest.raises(ValueError, match="accepted are bool, uint8"):
        Layout((Field(kind, "x", name="x"),))


def test_fields_of_variable_size_come_last():
    fields = (Field("string", "s", name="s"), Field("uint8", "n", name="n"))
    with pytest.raises(ValueError, match="come last"):
        Layout(fields)


def test_a_short_payload_is_refused():
    with pytest.raises(ValueError, match="its fields need 57"):
        SENSOR.layout.unpack(bytes(56))
    payload = message_of(EVENT.pack(1, 2, 0, "code", "text")).data[4:]
    with pytest.raises(ValueError, match="text ends at"):
        EVENT.layout.unpack(payload[:-1])


def test_a_line_that_is_no_field_is_refused():
    with pytest.raises(ValueError, match="no field definition: 'uint8'"):
        parse_definition("uint8\n")


def test_fields_need_no_unit():
    text = definition((Field("bool", "whether", name="on"),), "A switch.")
    assert text == "# A switch.\nbool on  # whether\n"
