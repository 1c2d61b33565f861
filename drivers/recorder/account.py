"""What a recorder says of a log that is not whole: what was lost, when, and how full the ring was.

All of it is in the account with which the recorder process ends: numbers that go into the log's
metadata, the line of the process that logged, and the summary of the run.
"""

from __future__ import annotations

from typing import NamedTuple

from drivers.recorder.ring import Loss


class Account(NamedTuple):
    """How the recording went.

    error: of the disk, and lost_bytes since; loss: puts that found no room in the ring
    end_ns: log time of the last record; ring_bytes: what the ring holds; most_bytes: held at most
    """

    messages: int
    error: str | None
    lost_bytes: int
    loss: Loss
    end_ns: int
    ring_bytes: int
    most_bytes: int

    @property
    def is_cut(self) -> bool:
        """Whether there were records after the last one of the log."""
        return self.error is not None or (self.loss.puts > 0 and self.loss.last_ns > self.end_ns)

    @property
    def text(self) -> str:
        """One line about what is missing; empty when nothing is."""
        parts = []
        if self.error is not None:
            parts.append(f"{self.error}; {self.lost_bytes} bytes of records are lost")
        if self.loss.puts:
            puts, size, first_ns, last_ns = self.loss
            parts.append(
                f"{puts} ticks ({size / 1e6:.1f} MB) from {first_ns * 1e-9:.3f} to"
                f" {last_ns * 1e-9:.3f} s found no room: the recorder was too slow"
            )
        if not parts:
            return ""
        share = self.most_bytes / self.ring_bytes if self.ring_bytes else 0.0
        return (
            f"{', '.join(parts)}; the last record is of {self.end_ns * 1e-9:.3f} s, and the ring of"
            f" {self.ring_bytes / 1e6:.1f} MB was at most {share:.0%} full"
        )

    def metadata(self) -> dict[str, str]:
        """Return it as a log holds it: nothing of a whole one."""
        if not self.text:
            return {}
        told = {
            "missing": self.text,
            "error": self.error,
            "lost_bytes": self.lost_bytes,
            "dropped": self.loss.puts,
            "dropped_bytes": self.loss.size,
            "dropped_from_ns": self.loss.first_ns,
            "dropped_to_ns": self.loss.last_ns,
        }
        whole = {"ring_bytes": self.ring_bytes, "ring_most_bytes": self.most_bytes}
        return {key: str(value) for key, value in {**told, **whole}.items() if value}


NOTHING_LOST = Loss(0, 0, 0, 0)


def loss_text(before: Loss, now: Loss) -> str:
    """One line about the puts that were given up in between, for the event behind the gap."""
    return (
        f"{now.puts - before.puts} ticks are missing here: the recorder was too slow, "
        f"{(now.size - before.size) / 1e6:.3f} MB up to {now.last_ns * 1e-9:.3f} s found no room"
    )
