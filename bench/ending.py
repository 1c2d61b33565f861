"""How a command ends: one line on standard error, and an exit code that keeps its meaning.

0 and 1 are verdicts; what nobody has foreseen is 3.
"""

from __future__ import annotations

import errno
import signal
import traceback
from collections.abc import Callable
from typing import Any, Final

from bench import streams
from bench.interrupt import EXIT_CODE, is_interrupt, told

FAULT: Final = 3
_USAGE: Final = 2
_OF_THE_USER: Final = {
    errno.ENOENT, errno.EACCES, errno.EPERM, errno.EEXIST, errno.ENOTDIR, errno.EISDIR,
    errno.ENAMETOOLONG, errno.EROFS, errno.ELOOP, errno.ENOTEMPTY, errno.ENXIO,
}  # fmt: skip
"""What is wrong with a file that was named; all else is the machine's."""


def run_to_end(command: Callable[[], Any]) -> int:
    """Run a command; a known failure is one line. Returns the exit code."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) == signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)
    outlet = streams.install()
    return outlet.exit_code(_code_of(command))


def _code_of(command: Callable[[], Any]) -> int:
    try:
        code = command()
    except KeyboardInterrupt:
        return told()
    except SystemExit as error:  # of a library, as for a pipe without a reader
        return error.code if isinstance(error.code, int) else FAULT
    except BaseException as error:  # panics of libraries in Rust are no Exception
        if is_interrupt(error) or type(error).__name__ == "Abort":  # of the parser
            return told()
        line, code = _told(error)
        streams.say(line or traceback.format_exc().rstrip())
        return code
    # What the library that reads arguments makes of an interrupt; it says nothing.
    return told() if code == EXIT_CODE else int(code or 0)


def _told(error: BaseException) -> tuple[str, int]:
    """What a failure is in one line, and its exit code; an empty line when nobody foresaw it."""
    from hil.errors import HilError

    if isinstance(error, HilError):
        return str(error), error.exit_code
    if isinstance(error, OSError):
        named = isinstance(error.filename, str) and error.errno in _OF_THE_USER
        line = f"{error.filename or 'operating system'}: {error.strerror or error}"
        return line, _USAGE if named else FAULT
    if isinstance(error, MemoryError):
        return "out of memory", FAULT
    panics = type(error).__name__ == "PanicException"
    if panics or (isinstance(error, ImportError) and "shared object" in str(error)):
        return " ".join(str(error).split()), FAULT  # too little memory, as a rule
    return _of_the_parser(error)


def _of_the_parser(error: BaseException) -> tuple[str, int]:
    """What the library that reads arguments has to say of them."""
    context, message = getattr(error, "ctx", None), getattr(error, "format_message", None)
    if message is None:
        return "", FAULT
    if type(error).__name__ == "NoArgsIsHelpError" and context is not None:
        return str(context.get_help()), _USAGE
    where = f" ({context.command_path} --help tells more)" if context is not None else ""
    return " ".join(message().replace("Value error, ", "").split()) + where, _USAGE
