"""Configuration of what both processes share: run, loop, link, recording, real time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.config.names import ClockName, LinkName

STATUS_HZ = 10
"""How often a loop tells its status."""

SNAPSHOT_HZ = 4
"""How often it records all that it remembers."""


class RunConfig(Section):
    """One run.

    duration_s: how long, of simulated time
    seed: of everything random
    """

    duration_s: float = Field(default=2.0, gt=0.0, le=86_400.0)
    seed: int = Field(default=1, ge=0, le=2**63 - 1)


class LoopConfig(Section):
    """The fixed step and what paces it.

    rate_hz: ticks a second
    clock: in real time, or lockstep: as fast as both can, with the same numbers every time
    peer_timeout_s: how long a process waits for the other one at the start
    """

    rate_hz: int = Field(default=1000, ge=100, le=20_000)
    clock: ClockName = "realtime"
    peer_timeout_s: float = Field(default=5.0, gt=0.0, le=600.0)

    @property
    def period_ns(self) -> int:
        """Length of a tick [ns]."""
        return round(1e9 / self.rate_hz)

    @property
    def status_every(self) -> int:
        """Ticks from one status to the next."""
        return max(self.rate_hz // STATUS_HZ, 1)

    @property
    def snapshot_every(self) -> int:
        """Ticks from one snapshot to the next."""
        return max(self.rate_hz // SNAPSHOT_HZ, 1)


CommonName = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9 ._@-]{0,63}$")]
CommonNames = Annotated[tuple[CommonName, ...], Field(min_length=1, max_length=16)]


class RolesConfig(Section):
    """Whose certificate, by its common name, may be what.

    plant, controller: this process
    operator: gives commands
    observer: sees the status
    """

    plant: CommonNames = ("plant",)
    controller: CommonNames = ("controller",)
    operator: CommonNames = ("operator",)
    observer: CommonNames = ("observer",)


class SafetyConfig(Section):
    """What leads out of the safe state besides an operator's start: nothing, unless it is said."""

    rearm: bool = Field(
        default=False,
        description="the plant goes on when commands return, a restarted controller resumes",
    )


class TlsConfig(Section):
    """Mutual TLS of a Zenoh endpoint that leaves the machine."""

    root_ca_certificate: Path
    certificate: Path
    private_key: Path
    roles: RolesConfig = RolesConfig()


class ZenohConfig(Section):
    """Where the Zenoh link listens and connects; nothing beyond this machine unless said so.

    engine: name of the pair, part of every key
    plant_endpoint, controller_endpoint: `tcp/HOST:PORT`, `tls/HOST:PORT`, `unixsock-stream//PATH`;
        empty: a unix socket in the engine's directory
    allow_insecure: lets an endpoint leave the machine without mutual TLS
    """

    engine: str = Field(default="fpeg", pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")
    plant_endpoint: str = ""
    controller_endpoint: str = ""
    tls: TlsConfig | None = None
    allow_insecure: bool = False


Instant = Annotated[float, Field(ge=0.0, le=1e6)]


class LinkConfig(Section):
    """How plant and controller exchange frames.

    kind: what joins them
    bus: the CAN bus of kind can, INTERFACE:CHANNEL
    bitrate_bit_s: of the CAN bus
    silences: beginning and end [s] of each in order, and of what: samples, answers or both
    """

    kind: LinkName = "zenoh"
    bus: str | None = Field(default=None, pattern=r"^[a-z0-9_]+:.+$")
    bitrate_bit_s: int = Field(default=1_000_000, ge=10_000, le=1_000_000)
    wire_timing: bool = Field(default=False, description="zenoh bus: frames take their time")
    zenoh: ZenohConfig = ZenohConfig()
    silences: tuple[tuple[Instant, Instant, Literal["samples", "answers", "both"]], ...] = Field(
        default=(), description="link memory: when nothing comes through"
    )

    @model_validator(mode="after")
    def _silences_are_in_order(self) -> LinkConfig:
        if self.silences and self.kind != "memory":
            raise ValueError("silences: accepted with kind = 'memory' (--link memory)")
        ends = [instant for begin_s, end_s, _ in self.silences for instant in (begin_s, end_s)]
        if ends != sorted(ends):
            raise ValueError("silences: accepted are [begin_s, end_s, of], one after the other")
        return self

    @model_validator(mode="after")
    def _can_has_a_bus(self) -> LinkConfig:
        if self.kind == "can" and self.bus is None:
            raise ValueError(
                "kind = 'can' needs bus = 'INTERFACE:CHANNEL' (--bus), as in zenoh:can0,"
                " socketcan:vcan0"
            )
        return self

    def bus_parts(self) -> tuple[str, str]:
        """Interface and channel of the bus."""
        interface, _, channel = (self.bus or ":").partition(":")
        return interface, channel


class RealtimeConfig(Section):
    """What the process asks of the operating system; what it was granted goes into the log.

    cpu: the one core to run on
    lock_memory: keeps all pages in memory
    spin_s: time before a deadline in which sleeping turns into polling
    """

    priority: int = Field(default=20, ge=0, le=98, description="SCHED_FIFO priority, 0: leave")
    cpu: int | None = Field(default=None, ge=0, le=1023)
    lock_memory: bool = False
    spin_s: float = Field(default=0.06e-3, ge=0.0, le=2e-3)


class LogConfig(Section):
    """Recording.

    enabled: whether logs are written
    plant, controller: files to write
    segment_bytes, segment_s: where a log goes on in another file
    retain_bytes: how much of the earlier files is kept
    recorder_lost: what the loss of a recorder does; another one takes down the end in any case
    defer: nothing is written before the end of the run, which is kept in memory until then
    """

    enabled: bool = True
    plant: Path | None = None
    controller: Path | None = None
    segment_bytes: int | None = Field(default=None, ge=1 << 16, le=1 << 50)
    segment_s: float | None = Field(default=None, gt=0.0, le=1e6)
    retain_bytes: int | None = Field(default=None, ge=1 << 16, le=1 << 60)
    recorder_lost: Literal["end", "restart"] = "end"
    defer: bool = False

    @model_validator(mode="after")
    def _retaining_needs_segments(self) -> LogConfig:
        if self.retain_bytes is not None and self.segment_bytes is self.segment_s is None:
            raise ValueError("retain_bytes needs segment_bytes or segment_s")
        return self
