"""What this machine can do, in plain words, with the command that mends what it cannot."""

from __future__ import annotations

import os
import platform
import resource
import socket
import sys
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from hil.errors import install_command

NEEDED = ("numpy", "pydantic", "mcap", "zstandard", "eclipse-zenoh", "python-can", "uvloop")
DESK = ("matplotlib", "scipy", "control", "cantools")
OLDEST_PYTHON = (3, 11)

OK, WORTH_KNOWING, MISSING = "ok", "note", "missing"
_SIGNS = {OK: ("✓", "green"), WORTH_KNOWING: ("•", "yellow"), MISSING: ("✗", "red")}
_AF_CAN, _RAW, _CAN_RAW = 29, 3, 1


_CPUS = Path("/sys/devices/system/cpu")
_THROTTLING = tuple(
    Path("/proc/sys/kernel") / f"sched_rt_{what}_us" for what in ("runtime", "period")
)


class Finding(NamedTuple):
    """One thing looked at: how it stands, in words, and the command that mends it."""

    what: str
    state: str
    text: str
    mend: str = ""


def python() -> Finding:
    """Whether the interpreter is new enough."""
    found = platform.python_version()
    if sys.version_info >= OLDEST_PYTHON:
        return Finding("Python", OK, found)
    return Finding("Python", MISSING, f"{found}, 3.11 is needed", "apt install python3.11")


def packages() -> Finding:
    """Whether everything that a run needs is installed."""
    missing = _not_installed(NEEDED)
    if not missing:
        return Finding("packages", OK, "everything that a run needs")
    text = f"not installed: {', '.join(missing)}"
    return Finding("packages", MISSING, text, install_command())


def desk() -> Finding:
    """Whether reports and analysis are possible."""
    missing = _not_installed(DESK)
    if not missing:
        return Finding("desk packages", OK, "reports and analysis are possible")
    text = f"no reports or analysis: {', '.join(missing)} not installed"
    return Finding("desk packages", WORTH_KNOWING, text, install_command("desk"))


def _not_installed(names: tuple[str, ...]) -> list[str]:
    missing = []
    for name in names:
        try:
            version(name)
        except PackageNotFoundError:
            missing.append(name)
    return missing


def kernel() -> Finding:
    """Whether the kernel is built for real time."""
    release = platform.release()
    flag = Path("/sys/kernel/realtime")
    if flag.exists() and flag.read_text().strip() == "1":
        return Finding("kernel", OK, f"{release}, PREEMPT_RT")
    text = f"{release}, not PREEMPT_RT: single ticks may come milliseconds late"
    return Finding("kernel", WORTH_KNOWING, text, "apt install linux-image-rt-amd64, then reboot")


def clock_source() -> Finding:
    """Whether reading the clock is cheap."""
    base = Path("/sys/devices/system/clocksource/clocksource0")
    try:
        current = (base / "current_clocksource").read_text().strip()
        available = (base / "available_clocksource").read_text().split()
    except OSError:
        return Finding("clock source", WORTH_KNOWING, "not told by this kernel")
    cheap = {"tsc", "kvm-clock", "arch_sys_counter"}
    if current in cheap:
        return Finding("clock source", OK, current)
    text = f"{current}: every look at the clock is a system call or worse"
    better = next((name for name in available if name in cheap), None)
    mend = f"echo {better} > {base / 'current_clocksource'}" if better else ""
    return Finding("clock source", WORTH_KNOWING, text, mend)


def processors() -> Finding:
    """Whether plant and controller can have a core each."""
    count = len(os.sched_getaffinity(0))
    if count >= 4:
        return Finding("processors", OK, f"{count}")
    text = f"{count}: plant, controller and two recorders share them"
    return Finding("processors", WORTH_KNOWING if count >= 2 else MISSING, text)


def isolation() -> Finding:
    """Whether a core is kept free of everything that was not put there."""
    try:
        isolated = (_CPUS / "isolated").read_text().strip()
    except OSError:
        return Finding("isolated cores", WORTH_KNOWING, "not told by this kernel")
    if isolated:
        return Finding("isolated cores", OK, f"{isolated}: give one to realtime.cpu")
    last = (os.cpu_count() or 1) - 1
    if last < 1:
        return Finding("isolated cores", WORTH_KNOWING, "none, and only one to have")
    text = "none: anything may run between two ticks"
    kernel = f"isolcpus=managed_irq,domain,{last} nohz_full={last} rcu_nocbs={last}"
    mend = f"add to GRUB_CMDLINE_LINUX in /etc/default/grub: {kernel}, then update-grub and reboot"
    return Finding("isolated cores", WORTH_KNOWING, text, mend)


def governor() -> Finding:
    """Whether the cores keep their speed while they wait for the next tick."""
    found = {path.read_text().strip() for path in _CPUS.glob("cpu[0-9]*/cpufreq/scaling_governor")}
    if not found:
        return Finding("governor", OK, "none: the cores' speed is fixed, or not ours to set")
    if found == {"performance"}:
        return Finding("governor", OK, "performance")
    text = f"{', '.join(sorted(found))}: a core may have to speed up within a tick"
    mend = "echo performance | tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"
    return Finding("governor", WORTH_KNOWING, text, mend)


def throttling() -> Finding:
    """Whether the kernel takes the processor from real-time loops once a second."""
    try:
        runtime_us, period_us = (int(path.read_text()) for path in _THROTTLING)
    except (OSError, ValueError):
        return Finding("throttling", WORTH_KNOWING, "not told by this kernel")
    if runtime_us < 0 or runtime_us >= period_us:
        return Finding("throttling", OK, "off")
    share = 100 * runtime_us // period_us
    text = (
        f"real-time threads get at most {share} % of {period_us // 1000} ms; loops stay far below"
    )
    return Finding("throttling", OK, text)


def priority() -> Finding:
    """Whether this user may ask for real-time priority."""
    if os.geteuid() == 0:
        return Finding("real-time priority", OK, "allowed (root): realtime.priority works")
    allowed = resource.getrlimit(resource.RLIMIT_RTPRIO)[0]
    if allowed > 0:
        return Finding("real-time priority", OK, f"allowed up to {allowed}")
    mend = "echo '@USER - rtprio 90' >> /etc/security/limits.d/hil.conf, then log in again"
    return Finding("real-time priority", WORTH_KNOWING, "not allowed to this user", _for_user(mend))


def locked_memory() -> Finding:
    """Whether this user may lock its memory."""
    allowed = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if os.geteuid() == 0 or allowed == resource.RLIM_INFINITY:
        return Finding("locked memory", OK, "allowed: realtime.lock_memory works")
    mend = "echo '@USER - memlock unlimited' >> /etc/security/limits.d/hil.conf, then log in again"
    text = f"limited to {allowed // 1024} KiB"
    return Finding("locked memory", WORTH_KNOWING, text, _for_user(mend))


def _for_user(command: str) -> str:
    return command.replace("@USER", os.environ.get("USER", str(os.geteuid())))


def can_bus() -> Finding:
    """Whether the kernel speaks CAN, and which interfaces there are."""
    try:
        socket.socket(_AF_CAN, _RAW, _CAN_RAW).close()
    except OSError:
        text = "this kernel has no SocketCAN: --link can works with adapters of python-can only"
        return Finding("CAN", WORTH_KNOWING, text, "modprobe can_raw")
    found = [name for _, name in socket.if_nameindex() if _is_can(name)]
    if found:
        return Finding("CAN", OK, f"SocketCAN, interfaces: {', '.join(found)}")
    mend = "modprobe vcan && ip link add vcan0 type vcan && ip link set vcan0 up"
    return Finding("CAN", WORTH_KNOWING, "SocketCAN, but no interface", mend)


def _is_can(name: str) -> bool:
    try:
        return Path(f"/sys/class/net/{name}/type").read_text().strip() == "280"  # ARPHRD_CAN
    except OSError:
        return False


LOOKS: tuple[Callable[[], Finding], ...] = (
    python, packages, desk, processors, kernel, isolation, governor, clock_source, throttling,
    priority, locked_memory, can_bus,
)  # fmt: skip


def look_around() -> int:
    """Print all findings; 1 when something is missing that a run needs."""
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    findings = [look() for look in LOOKS]
    for finding in findings:
        sign, colour = _SIGNS[finding.state]
        console.print(
            Text.assemble((f"{sign} ", colour), f"{finding.what:<19}", finding.text), soft_wrap=True
        )
        if finding.mend:
            console.print(Text(f"{'':21}→ {finding.mend}", style="dim"), soft_wrap=True)
    return 1 if any(finding.state == MISSING for finding in findings) else 0
