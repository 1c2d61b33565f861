"""The table of attacks: what is counted, what is told, and the page that is made of it."""

import random

import pytest

from bench.trust import damage, kills, page, victims
from bench.trust.attack import Attack, Field, Tally
from hil.files import Output


@pytest.fixture
def field(tmp_path):
    return Field(tmp_path, True, random.Random(1), lambda _line: None)


def attack(*lost, tried=5):
    return Attack("kills", "what | is done", "promised", lambda _: Tally(tried, lost, "noted"))


def test_what_is_not_lost_has_survived():
    assert Tally(5, ("a", "b")).survived == 3


@pytest.mark.parametrize(("lost", "code"), [((), 0), (("zenoh: it went on",), 1)])
def test_a_promise_that_was_not_kept_is_told_and_exit_1(tmp_path, monkeypatch, capsys, lost, code):
    monkeypatch.setattr(page, "ALL", (attack(), attack(*lost)))
    out = tmp_path / "trust.md"
    assert page.run(Output("--out", out), quick=True) == code
    text = out.read_text()
    assert "| kills | what \\| is done | promised | 5 | 5 | 0 | noted |" in text
    assert ("zenoh: it went on" in text) == bool(lost)
    assert ("lost: zenoh: it went on" in capsys.readouterr().out) == bool(lost)
    assert "Klipper" in text


def test_few_tries_are_made_when_it_has_to_be_quick(field):
    assert (field.tries(8, 200), field._replace(quick=False).tries(8, 200)) == (8, 200)


def test_every_attack_has_a_promise_and_its_own_function():
    assert len({row.tries for row in page.ALL}) == len(page.ALL)
    assert all(row.kind and row.does and row.promise for row in page.ALL)


@pytest.mark.slow
@pytest.mark.parametrize("attack", [damage.flip, damage.cut])
def test_a_damaged_log_is_never_taken_for_what_it_is_not(field, attack):
    tally = attack(field)
    assert tally.lost == ()
    assert tally.tried >= 20


@pytest.mark.slow
@pytest.mark.timeout(400)  # eight runs, each killed, repaired and followed by a next one
def test_a_killed_run_of_each_link_is_survived(field):
    tally = kills.kill(field)
    assert tally.lost == ()
    assert tally.tried == 2 * len(victims.LINKS)
