"""Entry point of `hil`; a command to a running engine goes a short way.

To read arguments with typer takes longer than to ask an engine. So what such a command is plainly
given is read here; help, mistakes and whatever else are left to the declarations in bench/cli, to
which tests hold this.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from bench.ending import run_to_end

RUN: Final = ("--run", "--config")
WITH_VALUE: Final = (*RUN, "--save")
OPTIONS: Final = {
    "set": (*RUN, "--save", "--force"),
    "get": (*RUN, "--json"),
    "status": (*RUN, "--json"),
    "start": RUN,
    "stop": RUN,
}
"""Commands that go the short way, and their options here."""

_WITH_WORDS: Final = ("set", "get")


class Plain(NamedTuple):
    """A command as it was given: its words, and its options with their values, if they have one."""

    name: str
    words: list[str]
    options: dict[str, str]

    @property
    def run(self) -> Path | None:
        """Which engine."""
        return self.path(*RUN)

    def path(self, *names: str) -> Path | None:
        """Return the value of an option that is a path."""
        given = next((self.options[name] for name in names if name in self.options), None)
        return None if given is None else Path(given)


def read(arguments: Sequence[str]) -> Plain | None:
    """Read arguments; None when that is better left to the declarations."""
    name, *rest = arguments or [""]
    if name not in OPTIONS:
        return None
    plain, left = Plain(name, [], {}), iter(rest)
    if not all(_take(plain, word, left) for word in left):
        return None
    is_whole = len(plain.options.keys() & set(RUN)) < 2 and (name in _WITH_WORDS or not plain.words)
    return plain if is_whole else None


def _take(plain: Plain, word: str, left: Iterator[str]) -> bool:
    """Take one word, and the value behind it; whether it is plain what it means."""
    if not word.startswith("-"):
        plain.words.append(word)
        return bool(word)
    if word not in OPTIONS[plain.name] or word in plain.options:
        return False
    value = next(left, "") if word in WITH_VALUE else "yes"
    plain.options[word] = value
    return bool(value) and not value.startswith("-")


def work_of(plain: Plain) -> Callable[[], int]:
    """Return what does a command; importing what it needs is part of it."""

    def work() -> int:
        if plain.name == "status":
            from bench.live import status

            return status.show(plain.run, as_json="--json" in plain.options)
        from bench.live import steer

        if plain.name == "set":
            save, force = plain.path("--save"), "--force" in plain.options
            return steer.change(plain.words, save, plain.run, force)
        if plain.name == "get":
            return steer.tell_values(plain.words, plain.run, as_json="--json" in plain.options)
        return steer.order(plain.name, plain.run)

    return work


def main() -> None:
    """Run a command and end with its exit code."""
    plain = read(sys.argv[1:])
    if plain is not None:
        sys.exit(run_to_end(work_of(plain)))
    from bench import cli

    cli.main()


if __name__ == "__main__":
    main()
