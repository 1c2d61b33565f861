"""What a loop process asks of the operating system, and what it was granted.

Nothing here fails a run: a refusal is told in plain words, which go into the log's metadata, so
that a latency figure can be read together with the privileges it was measured under.
"""

from __future__ import annotations

import ctypes
import gc
import os
import resource
from collections.abc import Callable
from functools import partial
from typing import Final

from hil.config.process import RealtimeConfig

_PR_SET_TIMERSLACK: Final = 29
_MCL_CURRENT_AND_FUTURE: Final = 1 | 2
NOT_ASKED: Final = "not asked for"

_M_TRIM_THRESHOLD, _M_MMAP_MAX, _INT_MAX = -1, -4, 2**31 - 1
_BUFFER_BYTES: Final = 4 << 20
_OBJECT_BYTES: Final = 450  # with its header still one of the small objects that live in arenas
_OBJECTS: Final = 20_000
_HELD_EVERY: Final = 250
_HELD: Final[list[bytes]] = []


def prepare(config: RealtimeConfig, *, lockstep: bool = False) -> dict[str, str]:
    """Ask for memory, scheduling and timers; return what was granted or refused.

    In lockstep no priority is asked for: two loops that never sleep would leave none of the
    processors to anybody else.

    Call it after the recorder's process is started, which must not inherit the priority, and
    before the link is opened: the link's own threads then do inherit it. Left at normal priority
    they starve beside a loop that spins under SCHED_FIFO, and with them the frames.
    """
    priority = 0 if lockstep else config.priority
    return {
        "garbage_collection": _told(_stop_collecting),
        "timer_slack": _told(_cut_timer_slack),
        "locked_memory": _told(_lock_memory) if config.lock_memory else NOT_ASKED,
        "reserved_memory": _told(_reserve_memory) if config.lock_memory else NOT_ASKED,
        "scheduling": _told(partial(_schedule, priority)) if priority else NOT_ASKED,
    }


def pin(config: RealtimeConfig) -> dict[str, str]:
    """Ask for the loop's CPU; return what was granted or refused and what is in force by now.

    Call it after the link is opened: its threads are better left to run on the other CPUs.
    """
    cpu = NOT_ASKED if config.cpu is None else _told(partial(_pin, config.cpu))
    return {"cpu": cpu, "in_force": in_force()}


def _told(ask: Callable[[], str]) -> str:
    """Run one request; put a refusal into words."""
    try:
        return f"granted: {ask()}"
    except OSError as error:
        return f"refused: {error.strerror or error}"
    except (AttributeError, OverflowError, ValueError) as error:
        return f"refused: not on this system ({error})"


def _stop_collecting() -> str:
    """Collect once, keep what is left out of every later pass and stop the automatic passes."""
    gc.collect()
    gc.freeze()
    gc.disable()
    return f"collected, {gc.get_freeze_count()} objects frozen, automatic passes off"


def _libc() -> ctypes.CDLL:
    """The C library of this process, with errno kept."""
    return ctypes.CDLL(None, use_errno=True)


def _check(returned: int, call: str) -> None:
    """Raise OSError when a C call failed."""
    if returned != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{call}: {os.strerror(number)}")


def _cut_timer_slack() -> str:
    """Let this thread's sleeps end without the 50 us by which the kernel may batch them."""
    _check(_libc().prctl(_PR_SET_TIMERSLACK, *map(ctypes.c_ulong, (1, 0, 0, 0))), "prctl")
    return "1 ns"


def _lock_memory() -> str:
    """Keep every page resident, those allocated later included."""
    _check(_libc().mlockall(_MCL_CURRENT_AND_FUTURE), "mlockall")
    return "current and future pages"


def _reserve_memory() -> str:
    """Have room for objects and buffers at hand, and never give it back.

    Python returns an arena (1 MiB) to the kernel when its last object goes, and asks for one again
    with the next: hundreds of page faults in one tick, each time.
    """
    libc = _libc()
    if not (libc.mallopt(_M_MMAP_MAX, 0) and libc.mallopt(_M_TRIM_THRESHOLD, _INT_MAX)):
        raise ValueError("mallopt")
    buffer = bytearray(_BUFFER_BYTES)
    del buffer
    objects = [bytes(_OBJECT_BYTES) for _ in range(_OBJECTS)]
    _HELD.extend(objects[::_HELD_EVERY])  # one in an arena keeps all of it
    return f"{(_BUFFER_BYTES + _OBJECTS * _OBJECT_BYTES) >> 20} MiB"


def _pin(cpu: int) -> str:
    """Let this thread run on one CPU only."""
    os.sched_setaffinity(0, {cpu})
    return f"CPU {cpu}"


def _schedule(priority: int) -> str:
    """Put this thread, and those it starts, into the first-in-first-out real-time class."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    return f"SCHED_FIFO priority {priority}"


def in_force() -> str:
    """Say how this thread runs by now, whoever arranged it (a service manager may have)."""
    names = {os.SCHED_OTHER: "SCHED_OTHER", os.SCHED_FIFO: "SCHED_FIFO", os.SCHED_RR: "SCHED_RR"}
    policy = os.sched_getscheduler(0)
    name = names.get(policy, f"policy {policy}")
    priority = os.sched_getparam(0).sched_priority
    cpus = ",".join(map(str, sorted(os.sched_getaffinity(0))))
    return f"{name} priority {priority}, CPUs {cpus}"


def page_faults() -> tuple[int, int]:
    """Return (minor, major) page faults of this thread so far; rising ones disturb its loop."""
    usage = resource.getrusage(resource.RUSAGE_THREAD)
    return usage.ru_minflt, usage.ru_majflt
