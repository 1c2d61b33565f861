"""Files in and out: what is read is a regular file; what is written hides nothing there."""

import os

import pytest
from foreign_logs import PLAIN, Topic, plain, write
from hypothesis import given
from hypothesis import strategies as st

from bench.cli import main
from hil.errors import ConfigError, HilError, printable
from hil.files import Output, open_regular, read_regular


@pytest.fixture(params=["fifo", "directory", "device", "nothing"])
def odd(request, tmp_path):
    """What is no regular file; reading the first would wait for ever, the third never end."""
    path = tmp_path / "odd"
    if request.param == "fifo":
        os.mkfifo(path)
    elif request.param == "directory":
        path.mkdir()
    elif request.param == "device":
        path.symlink_to("/dev/zero")
    return path


def test_what_is_no_regular_file_is_one_line_and_never_waited_for(odd):
    with pytest.raises(ConfigError) as caught:
        read_regular(odd)
    assert str(caught.value).startswith(f"{odd}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.timeout(60)
@pytest.mark.parametrize(
    "arguments",
    [
        ["info"], ["info", "--verify"], ["export"], ["repair"], ["replay"], ["diff", "{}"],
        ["fmu", "check"], ["plant", "--config"], ["controller", "--config"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_no_command_hangs_on_a_pipe(arguments, tmp_path, monkeypatch, capsys):
    path = tmp_path / "odd.mcap"
    os.mkfifo(path)
    words = [word.format(path) for word in arguments]
    monkeypatch.setattr("sys.argv", ["hil", *words, str(path)])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    assert (ended.value.code, out) == (2, "")
    assert err.strip().count("\n") == 0
    assert "accepted is a regular file" in err


def test_a_file_that_is_there_is_replaced_by_force_alone(tmp_path):
    path = tmp_path / "out.txt"
    Output("--out", path).write("first")
    with pytest.raises(ConfigError, match=r"--out .*out\.txt: exists already; accepted is"):
        Output("--out", path).write("second")
    with pytest.raises(ConfigError, match="exists already"):
        Output("--out", path).check()
    assert path.read_text() == "first"
    Output("--out", path, force=True).write("third")
    assert path.read_text() == "third"
    assert list(tmp_path.iterdir()) == [path]


def test_an_input_is_never_written_over_not_even_by_force(tmp_path):
    log = write(tmp_path / "rig.mcap", [Topic("/a", PLAIN, plain())])
    before = log.read_bytes()
    (tmp_path / "other.svg").symlink_to(log)
    for path in (log, tmp_path / "other.svg"):
        file = Output("--picture", path, force=True, inputs=(log,))
        for attempt in (file.check, lambda file=file: file.write("no")):
            with pytest.raises(ConfigError, match="is read by this command"):
                attempt()
    assert log.read_bytes() == before


def test_what_fails_half_way_leaves_nothing_and_changes_nothing(tmp_path):
    path = tmp_path / "out.txt"
    path.write_text("precious")

    def half(force):
        with Output("--out", path if force else tmp_path / "new", force).writing() as beside:
            beside.write_text("half")
            raise KeyboardInterrupt

    for force in (True, False):
        with pytest.raises(KeyboardInterrupt):
            half(force)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "precious"


def test_a_file_that_comes_meanwhile_is_not_replaced(tmp_path):
    path = tmp_path / "out.txt"

    def overtaken():
        with Output("--out", path).writing() as beside:
            beside.write_text("late")
            path.write_text("early")

    with pytest.raises(ConfigError, match="exists already"):
        overtaken()
    assert path.read_text() == "early"


@pytest.mark.parametrize("force", [False, True])
def test_no_device_and_no_directory_is_replaced(odd, force):
    if not odd.exists():
        return
    with pytest.raises(ConfigError, match=r"accepted is a regular file|Is a directory"):
        Output("--out", odd, force).check()
    with pytest.raises(ConfigError):
        Output("--out", odd, force).write("no")


def test_a_link_keeps_pointing_where_it_did(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to("real.txt")
    Output("--out", tmp_path / "link.txt", force=True).write("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("none/out.svg", "No such file"),
        ("out.txt", "ending in .svg, .png"),
        ("a" * 300 + ".svg", "too long"),
        ("nul\0.svg", "null"),
    ],
)
def test_a_place_that_cannot_be_written_is_told_before_the_work(tmp_path, name, told):
    with pytest.raises(ConfigError, match=told) as caught:
        Output("--out", tmp_path / name).check(".svg", ".png")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_reading_a_regular_file_is_as_ever(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    with open_regular(tmp_path / "a") as file:
        assert file.read() == b"abc"


@given(st.text())
def test_a_line_for_the_user_steers_no_terminal(text):
    shown = printable(text)
    assert all(c.isprintable() or c == "\n" for c in shown)
    assert str(HilError(text)) == shown


@pytest.mark.parametrize(
    "arguments",
    [["run", "steady", "--out", ""], ["run", "steady", "--out="], ["report", ""], ["info", ""]],
)
def test_an_empty_argument_is_not_the_directory_one_is_in(arguments, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["hil", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    out, err = capsys.readouterr()
    assert (ended.value.code, out) == (2, "")
    assert "accepted is a value that is not empty" in err
