"""Bad arguments of every command: one line that names them, exit code 2, never a traceback."""

import contextlib

import pytest
import typer
from mcap.writer import Writer

from bench import ending
from bench.cli import app
from bench.run.directory import directory_of, logs_of
from drivers.system.process import in_words
from hil.errors import ConfigError

FILES = ("missing", "dir", "empty", "junk.mcap", "foreign.mcap", "junk.toml", "/dev/null")

TAKE_A_FILE = (
    ("replay", "{}"), ("what-if", "{}", "--from", "1s"), ("report", "{}"), ("bus", "load", "{}"),
    ("view", "--no-browser", "{}"), ("diff", "{}", "missing"), ("fmu", "check", "{}"),
    ("check", "law", "{}"), ("status", "--run", "{}"), ("get", "--run", "{}"),
    ("start", "--run", "{}"), ("stop", "--run", "{}"), ("panel", "--no-browser", "--run", "{}"),
    ("run", "{}"), ("compare", "{}"), ("map", "{}"), ("campaign", "{}"), ("tune", "{}"),
    ("scenario", "prove", "{}"),
)  # fmt: skip

VALUES = (
    "export {log} --from nan", "export {log} --from -1", "export {log} --from 5 --until 1",
    "export {log} --topic /b", "replay {log} --to -1", "bus monitor pigeon:1",
    "bus fuzz --frames -1", "run steady --seed -1", "run steady --set run.duration_s=nan",
    "run steady --set run.duration_s=-1", "run steady --set loop.rate_hz=-5",
    "run steady --set plant=1", "run steady --set x=1", "run steady --set events.x=1",
    "run steady --set @missing", "run steady --out empty", "run steady --out /dev/null",
    "run steady --log-segment ...s", "run steady --log-segment nans", "run steady --log-retain -1",
    "run steady --panel -3", "run steady --junit dir", "run steady --can-log x.txt",
    "run blank.toml", "run steady --bus zenoh:can0", "run steady --link shm --bus zenoh:can0",
    "run load-decrease --set events.load.at_s=2.5", "run late-expectation.toml",
    "run late-ramp.toml", "compare --quick --set x=1", "compare --set x=1 --out new",
    "run steady --link can", "run steady --link can --bus foo", "run steady::x", "run ::",
    "run load-decrease --set events.load.at_s=-1", "run load-decrease --set events.load.value=nan",
    "compare steady", "compare --controllers ,", "compare --controllers cascade,foo",
    "compare --model foo", "compare --out empty", "compare --quick --model foo",
    "compare --json x.json", "compare --quick --workers 0", "compare --set plant.modle=x",
    "tune foo", "tune cascade --from a,b", "tune cascade --from 1", "tune cascade --generations 0",
    "tune cascade --out dir/none/x.toml", "tune cascade --out x.txt", "map --tdc a",
    "map --tdc nan", "map --tdc -5", "map --tdc 500", "map --tdc ,", "map --out dir/none/x.toml",
    "campaign robustness --runs -5", "campaign robustness --shard 2/1",
    "campaign robustness --out empty", "atlas foo", "atlas --out empty", "engine sweep --over foo",
    "engine sweep --over load --engine foo", "engine sweep --over load --out x.txt",
    "engine analyse --engine foo", "engine analyse --fuel-mg -1", "engine precision --engine foo",
    "engine sensitivities foo", "engine sensitivities --out dir/none/x.toml",
    "compile --into empty",
    "bench soak --minutes -1",
)  # fmt: skip


SCENARIOS = {
    "blank.toml": "# nothing\n",
    "late-expectation.toml": 'expect.a = {signal = "plant.truth.x_m", max = 1.0, from_s = 2.0}',
    "late-ramp.toml": """
[events.more]
kind = "ramp"
parameter = "plant.disturbance.load_scale"
value = 1.1
over_s = 1.0
at_s = 5.0
""",
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A directory with what is no run, no log and no scenario; the working directory meanwhile."""
    place = tmp_path_factory.mktemp("place")
    (place / "dir").mkdir()
    (place / "empty").touch()
    for name in ("junk.mcap", "junk.toml"):
        (place / name).write_bytes(b"\x89junk" * 50)
    for name, text in SCENARIOS.items():
        (place / name).write_text(text, encoding="utf-8")
    with (place / "foreign.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("x", "jsonschema", b"{}")
        writer.add_message(writer.register_channel("/a", "json", schema), 0, b"{}", 0)
        writer.finish()
    with contextlib.chdir(place):
        yield place


def _refusal(arguments):
    """Return the exit code of a command and the line that it says; an empty one: a traceback."""
    try:
        app(list(arguments), standalone_mode=False)
    except typer.Exit as end:
        return end.exit_code, "ended"
    except Exception as error:
        line, code = ending._told(error)
        return code, line
    return 0, "went well"


def _assert_refused(arguments):
    code, line = _refusal(arguments)
    assert (code, len(line.splitlines())) == (2, 1), (arguments, code, line)


@pytest.mark.slow
@pytest.mark.parametrize("words", TAKE_A_FILE, ids=" ".join)
def test_a_file_that_is_none_of_ours_is_refused_in_one_line(place, words):
    for name in FILES:
        if name == "empty" and "--run" in words:
            continue  # a scenario in which nothing is set: the engine at its default place
        _assert_refused([word.format(name) for word in words])


@pytest.mark.slow
def test_a_value_that_is_none_is_refused_in_one_line(place):
    for words in VALUES:
        _assert_refused(words.format(log="foreign.mcap").split())


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("run blank.toml", "blank.toml: empty; accepted"),
        ("run steady --bus zenoh:can0", "link.bus: the link is zenoh; accepted with"),
        ("run late-expectation.toml", "expect.a.from_s: at 2 s of a run that ends at"),
        ("run late-ramp.toml", "events.more.at_s: at 5 s of a run that ends at"),
        ("compare --quick --set x=1", "nu harmonic --set: x: unknown key"),
    ],
)
def test_what_would_have_no_effect_is_refused_by_its_name(place, words, named):
    code, line = _refusal(words.split())
    assert (code, named in line) == (2, True), line


def test_a_comparison_that_is_refused_leaves_nothing_behind(place):
    _refusal(["compare", "--set", "x=1", "--out", "new"])
    assert not (place / "new").exists()


def test_a_run_is_named_by_its_directory_or_a_file_in_it(place):
    run = place / "a-run"
    run.mkdir()
    for name in ("plant.mcap", "controller.mcap"):
        (run / name).write_bytes((place / "foreign.mcap").read_bytes())
    assert logs_of(run) == [run / "plant.mcap", run / "controller.mcap"]
    assert logs_of(run / "plant.mcap") == [run / "plant.mcap"]
    assert directory_of(run / "plant.mcap") == directory_of(run) == run
    for words in (f"info {run}", f"diff {run} {run}", f"diff {run} {run}/plant.mcap"):
        assert _refusal(words.split())[0] == 0
    with pytest.raises(ConfigError, match=r"foreign\.mcap: no finished run"):
        app(["report", "foreign.mcap"], standalone_mode=False)


def test_a_process_tells_a_person_in_words():
    facts = {"ticks": 7, "reception": {"accepted": 7, "lost": 0}, "link": {"dropped": 0}}
    assert in_words(facts) == "ticks      7\nreception  accepted 7\nlink       nothing"
