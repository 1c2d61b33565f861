"""Two logs side by side: the first divergence, its side of the wire, and how far it goes."""

import pytest
from runs import each_record, make_run, records_of, rewrite

import hil.log
from bench.logs.commands import diff as diff_command
from bench.logs.diff import compare
from hil.log import topics


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """The same run with another gain: it parts after the load step."""
    gains = ("controller.cascade.outer", {"kp": 10.0, "ki": 52.0})
    return make_run(tmp_path_factory.mktemp("other"), gains)


def compared(a, b):
    with hil.log.open(a) as left, hil.log.open(b) as right:
        return compare(left, right)


def test_a_log_is_the_same_as_itself(run_directory):
    found = compared(run_directory / "plant.mcap", run_directory / "plant.mcap")
    assert found.same
    assert all(gap.different == 0 for gap in found.topics)


def test_two_runs_of_one_scenario_are_the_same(run_directory, tmp_path):
    again = make_run(tmp_path / "again")
    for process in ("plant", "controller"):
        assert compared(run_directory / f"{process}.mcap", again / f"{process}.mcap").same


def test_what_is_said_of_each_topic_fits_80_columns(run_directory, other, capsys):
    diff_command(run_directory / "controller.mcap", other / "controller.mcap", timing=False)
    table = capsys.readouterr().out.partition("  topic ")[2].splitlines()
    assert any(line.strip().startswith("at most ") for line in table)
    assert any("/frames/received" in line for line in table)
    assert all(len(line) <= 80 for line in table)


def test_the_cause_is_placed_on_its_side_of_the_wire(run_directory, other):
    controllers = compared(run_directory / "controller.mcap", other / "controller.mcap")
    plants = compared(run_directory / "plant.mcap", other / "plant.mcap")
    assert not controllers.from_input
    assert controllers.first.topic == "/demand"
    assert plants.from_input
    assert plants.first.tick > controllers.first.tick
    keys = {key for key, *_ in controllers.configuration}
    assert "controller.cascade.outer.kp" in keys


def test_missing_ticks_are_told_as_such(run_directory, tmp_path):
    path = run_directory / "plant.mcap"
    kept = [
        record
        for _, record in each_record(records_of(path))
        if int.from_bytes(record[11:15], "little") not in range(100, 110)
    ]
    found = compared(path, rewrite(path, tmp_path / "holes.mcap", b"".join(kept)))
    sensor = next(gap for gap in found.topics if gap.topic == "/sensor")
    assert (sensor.common, sensor.different, sensor.only_a, sensor.only_b) == (690, 0, 10, 0)
    assert (found.first.tick, found.first.field) == (100, "record")


def test_a_single_bit_is_found_with_both_values(run_directory, tmp_path):
    path = run_directory / "plant.mcap"
    layout = topics.TRUTH.layout
    changed = []
    for channel, record in each_record(records_of(path)):
        if channel == topics.TRUTH.channel_id and record[11:15] == (77).to_bytes(4, "little"):
            values = list(layout.unpack(record[35:]))
            raw = bytearray(topics.TRUTH.pack(*values))
            raw[35 + 16] ^= 1  # the last bit of x_m
            record = bytes(raw)  # noqa: PLW2901
        changed.append(record)
    found = compared(path, rewrite(path, tmp_path / "bit.mcap", b"".join(changed)))
    assert (found.first.tick, found.first.topic, found.first.field) == (77, "/truth", "x_m")
    truth = next(gap for gap in found.topics if gap.topic == "/truth")
    assert truth.different == 1
    assert 0.0 < truth.fields["x_m"].largest < 1e-17


def test_the_command_ends_with_what_it_found(run_directory, other, capsys):
    plant = run_directory / "plant.mcap"
    assert diff_command(plant, plant, timing=True) == 0
    assert diff_command(plant, other / "plant.mcap", timing=False) == 1
    told = capsys.readouterr().out
    assert "the same" in told
    assert "part at tick" in told
    assert "the cause lies in the controller or on the link" in told
