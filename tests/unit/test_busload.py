"""Bus load of a run, and the frames of a run in the formats of the CAN world."""

import json
import random
import re
import subprocess
import sys

import can
import cantools
import numpy as np
import pytest

import hil
import hil.log
from bench.bus import commands, monitor
from bench.bus.can_log import output_of
from bench.bus.load import frame_bits
from bench.run import scenarios
from bench.run.directory import RunFiles
from hil.config.resolved import read_resolved
from hil.errors import ConfigError
from hil.wire.busload import classic_bits
from hil.wire.codec import iter_frames


def test_a_block_of_frames_has_the_bits_of_each():
    source = random.Random(4)
    ids = [source.randrange(0x800) for _ in range(300)]
    words = [source.choice([0, 2**64 - 1, source.getrandbits(64)]) for _ in ids]
    bits = frame_bits(np.array(ids), np.array(words, dtype=np.uint64))
    each = [classic_bits(i, w.to_bytes(8, "little")) for i, w in zip(ids, words, strict=True)]
    assert bits.tolist() == each


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    out = tmp_path_factory.mktemp("run")
    command = [sys.executable, "-m", "bench.cli", "run", "load-decrease", "--link", "memory",
               "--clock", "lockstep", "--no-report", "--out", str(out), "--force", "--set",
               "run.duration_s=1.6", "--can-log", str(out / "frames.log")]  # fmt: skip
    subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    return RunFiles(out)


def test_a_candump_of_a_run_decodes_to_the_values_of_its_log(done):
    """cantools, which nobody here wrote, against the MCAP log."""
    database = cantools.database.load_file(hil.__path__[0] + "/wire/fpeg.dbc")
    with can.LogReader(done.directory / "frames.log") as reader:
        decoded = [
            (database.get_message_by_frame_id(m.arbitration_id).name,
             database.decode_message(m.arbitration_id, m.data, decode_choices=False))
            for m in reader
        ]  # fmt: skip
    with hil.log.open(done.plant_log) as log:
        sensor = log.array("/sensor")
        sent = sum(len(batch) // 10 for _, _, batch in log.frames("sent"))
    samples = [values for name, values in decoded if name == "PistonSample"]
    heads = [values for name, values in decoded if name == "PlantTick"]
    assert [values["tick"] for values in heads] == sensor["tick"].tolist()
    assert len(samples) + len(heads) == sent
    assert np.allclose([v["x_m"] for v in samples], sensor["x_m"], rtol=0.0, atol=0.5001e-8)
    assert np.allclose([v["v_m_s"] for v in samples], sensor["v_m_s"], rtol=0.0, atol=0.5001e-6)
    with hil.log.open(done.controller_log) as log:
        loads = log.array("/actuator")["load_coefficient_n_s_m"]
    machine = [v["load_coefficient_n_s_m"] for name, v in decoded if name == "MachineCommand"]
    assert np.allclose(machine, loads, rtol=0.0, atol=0.0051)


@pytest.mark.parametrize("suffix", ["asc", "blf", "csv"])
def test_other_formats_hold_the_same_frames_in_the_same_order(done, suffix):
    path = done.directory / f"frames.{suffix}"
    scenario = read_resolved(done.scenario)
    count = commands.write_can_log(output_of(path), scenario, done, "2026-01-02T03:04:05+0000")
    frames = []
    for log in (done.plant_log, done.controller_log):
        with hil.log.open(log) as opened:
            frames += [
                (t_ns, order, can_id, word.to_bytes(8, "little"))
                for t_ns, order, batch in ((t, i, b) for i, (_, t, b) in
                                           enumerate(opened.frames("sent")))
                for can_id, word in iter_frames(batch)
            ]  # fmt: skip
    with can.LogReader(path) as reader:
        read = [(m.arbitration_id, bytes(m.data), m.timestamp) for m in reader]
    assert len(read) == len(frames) == count
    assert sorted((i, d) for i, d, _ in read) == sorted((i, d) for _, _, i, d in frames)
    stamps = [stamp for _, _, stamp in read]
    assert stamps == sorted(stamps)


def test_the_load_is_told_in_one_line(done, capsys):
    assert commands.load(done.directory, None) == 0
    line = capsys.readouterr().out
    assert re.search(r"bus load \d\d\.\d% in the mean tick", line)
    assert "81.0% at the worst possible" in line
    figures = commands.figures(read_resolved(done.scenario), done)
    assert json.dumps(figures)
    assert 0.4 < figures["load_mean"] < figures["load_fullest_tick"] < 0.81


@pytest.mark.parametrize("name", ["frames.txt", "frames", "missing/frames.log"])
def test_a_can_log_that_could_not_be_written_is_refused_before_the_run(name, tmp_path):
    with pytest.raises(ConfigError, match="--can-log"):
        output_of(tmp_path / name)


@pytest.mark.parametrize("text", ["zenoh", ":can0", "zenoh:", ""])
def test_a_bus_that_is_none_is_refused(text):
    with pytest.raises(ConfigError, match="accepted is INTERFACE:CHANNEL"):
        monitor.parse_bus(text)


def test_can_without_a_bus_is_refused_with_examples():
    with pytest.raises(ConfigError, match=r"link: kind = 'can' needs bus .* zenoh:can0"):
        scenarios.read("steady", [("link.kind", "can")])


def test_a_rate_that_the_bus_cannot_carry_is_refused():
    changes = [("link.kind", "can"), ("link.bus", "zenoh:can0"), ("loop.rate_hz", 2000)]
    with pytest.raises(ConfigError, match="accepted up to 1234 Hz"):
        scenarios.read("steady", changes)


def test_the_monitor_says_what_became_of_each_frame():
    judge = monitor.Judge()
    from hil.wire.codec import Encoder
    from hil.wire.messages import PistonSample

    batch = Encoder().encode([PistonSample(0.01, 1.0)])
    ((can_id, word),) = iter_frames(batch)

    def shown(can_id, word, **kwargs):
        data = word.to_bytes(8, "little")
        return judge.judge(
            can.Message(arbitration_id=can_id, data=data, is_extended_id=False, **kwargs)
        )

    assert shown(can_id, word) == ("PistonSample", "ok", "x_m=0.01 v_m_s=1 unheard=0")
    assert shown(can_id, word)[1] == "repeated"
    assert shown(can_id, word ^ 1 << 33)[1] == "corrupted"
    assert shown(0x123, word)[:2] == ("0x123", "not ours")
    assert shown(can_id, 0, is_error_frame=True)[0] == "error frame"
