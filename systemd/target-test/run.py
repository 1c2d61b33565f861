"""The target test: builds the guest, boots it, judges what it brought back.

python systemd/target-test/run.py [functional] [timing] [--update-budget]

Needs what systemd/target-test/prepare installs; keeps the guest under ~/.cache/fpeg-hil-target, or
where TARGET_TEST_CACHE says. Exit 0 when everything held.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tarfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
CHECKOUT = HERE.parent.parent
sys.path.insert(0, str(HERE))

import judge  # noqa: E402

from hil import compiled  # noqa: E402
from hil.errors import HilError  # noqa: E402

TOOLS = ("qemu-system-x86_64", "mmdebstrap", "busybox", "mke2fs", "depmod", "modprobe", "cpio",
         "dpkg-deb", "apt-get", "chroot")  # fmt: skip
CODE = ("pyproject.toml", "hil", "drivers", "plant", "controller", "bench", "systemd", "docs")
BOOTS = ("functional", "timing")
GUEST_PYTHON = (3, 11)


def missing_tools() -> list[str]:
    """Return the tools that this host lacks."""
    path = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
    return [tool for tool in TOOLS if shutil.which(tool, path=path) is None]


def build_guest(cache: Path) -> Path:
    """Build the guest unless it is there; returns its directory."""
    environment = {**os.environ, "PATH": f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"}
    built = subprocess.run(
        ["nice", "-n", "10", HERE / "build", cache, sys.executable],
        stdout=subprocess.PIPE, text=True, check=True, env=environment,
    )  # fmt: skip
    return Path(built.stdout.strip())


def compile_loops(cache: Path) -> Path:
    """Compile the loops of this checkout unless it was done; the guest has no compiler."""
    into = cache / "compiled"
    subprocess.run(
        ["nice", "-n", "10", sys.executable, "-P", "-m", "bench.cli", "compile", "--into", into],
        check=True, cwd=CHECKOUT, env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
    )  # fmt: skip
    return into / compiled.key_of(CHECKOUT)


def wanted(member: tarfile.TarInfo) -> tarfile.TarInfo | None:
    """Leave out what the target does not need."""
    return None if member.name.endswith(("__pycache__", ".svg")) else member


def boot(guest: Path, results: Path, kind: str) -> bool:
    """Boot once with a copy of this checkout; returns whether the guest ended as it should."""
    shutil.rmtree(results, ignore_errors=True)
    inside = results / "in"
    shutil.copytree(HERE / "guest", inside / "guest")
    shutil.copy(HERE / "guest" / kind, inside / "test")
    if kind == "timing":
        loops = compile_loops(results.parent.parent)
        shutil.copytree(loops, inside / "compiled" / loops.name)
    # One file: each single one that the guest has to fetch from the host costs it time.
    with tarfile.open(inside / "checkout.tar", "w") as archive:
        for name in CODE:
            archive.add(CHECKOUT / name, name, filter=wanted)
    return subprocess.run([HERE / "boot", guest, results, kind], check=False).returncode == 0


def judged(out: Path, *, update_budget: bool) -> list[judge.Finding]:
    """Judge the timing boot; what it did not bring back is a finding, not a fault of the test."""
    try:
        return judge.judge_timing(out, HERE / "budget.json", update=update_budget)
    except (HilError, OSError, ValueError, KeyError) as error:
        return [judge.Finding(False, f"cannot be judged: {error!r}")]


def test(kind: str, guest: Path, cache: Path, *, update_budget: bool) -> bool:
    """Boot and judge once; prints what was found."""
    results = cache / "results" / kind
    start_s = time.monotonic()
    ended = boot(guest, results, kind)
    findings = judge.read_checks(results / "out" / "checks.txt")
    if kind == "timing" and ended:
        findings += judged(results / "out", update_budget=update_budget)
    findings.append(judge.Finding(ended, "the guest ran to its end and powered off"))
    print(f"\n{kind}: {time.monotonic() - start_s:.0f} s")
    for finding in findings:
        print(f"  {'ok  ' if finding.held else 'FAIL'} {finding.text}")
    held = all(finding.held for finding in findings)
    shutil.rmtree(results / "in", ignore_errors=True)
    if held:
        shutil.rmtree(results)
    else:
        print(f"  what the guest left: {results}")
    return held


def main() -> int:
    """Run the boots that were asked for, both without a wish."""
    parser = argparse.ArgumentParser(prog="target-test")
    parser.add_argument("boots", nargs="*", metavar="BOOT", help="functional, timing")
    parser.add_argument("--update-budget", action="store_true", help="store what was measured")
    given = parser.parse_args()
    for name in given.boots:
        if name not in BOOTS:
            parser.error(f"{name}: accepted {', '.join(BOOTS)}")
    missing = missing_tools()
    if missing or os.geteuid() != 0:
        lack = f"not installed: {', '.join(missing)}" if missing else "needs root (mmdebstrap)"
        print(f"target-test: {lack}; systemd/target-test/prepare installs all of it on Debian 12",
              file=sys.stderr)  # fmt: skip
        return 1
    if sys.version_info[:2] != GUEST_PYTHON:
        version = ".".join(map(str, GUEST_PYTHON))
        print(f"target-test: compiles the loops for the guest's Python: run it with {version}",
              file=sys.stderr)  # fmt: skip
        return 1
    cache = Path(os.environ.get("TARGET_TEST_CACHE", Path.home() / ".cache" / "fpeg-hil-target"))
    cache.mkdir(parents=True, exist_ok=True)
    guest = build_guest(cache)
    held = [
        test(kind, guest, cache, update_budget=given.update_budget) for kind in given.boots or BOOTS
    ]
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
