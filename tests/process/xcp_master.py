"""A public XCP master, pyxcp, in a process of its own: measures twenty signals, changes a gain.

python xcp_master.py TCP|UDP PORT ROWS FILE.npz

It measures until each side has sent so many rows, as long as a busy machine may take for them.
"""

import struct
import sys
import time

import numpy as np
from pyxcp.config import create_application_from_config, set_application
from pyxcp.daq_stim import DaqList, DaqOnlinePolicy
from pyxcp.master import Master

from bench.live.xcp.addresses import TYPES, address_of, places

TRUTH = ("tick", "x_m", "v_m_s", "load_coefficient_n_s_m", "dc_x_m")
SENSED = ("x_m", "v_m_s", "p_left_pa", "p_right_pa")
SIGNALS = {
    "plant": (
        *(f"plant.truth.{name}" for name in TRUTH), *(f"plant.sensor.{name}" for name in SENSED),
        "plant.timing.missed",
    ),
    "controller": (
        "controller.sensor.tick", *(f"controller.sensor.{name}" for name in SENSED),
        *(f"controller.actuator.{name}" for name in
          ("mode", "force_n", "load_coefficient_n_s_m", "throttle", "pulse_count")),
    ),
}  # fmt: skip
GAIN = "controller.cascade.outer.kp"
PATIENCE_S = 40.0
KINDS = {"UBYTE": "U8", "UWORD": "U16", "ULONG": "U32", "A_UINT64": "U64", "FLOAT64_IEEE": "F64",
         "SBYTE": "I8", "SWORD": "I16", "SLONG": "I32", "A_INT64": "I64", "FLOAT32_IEEE": "F32",
         }  # fmt: skip


class Rows(DaqOnlinePolicy):
    """Keeps what comes."""

    def initialize(self):
        self.rows = [[] for _ in self.daq_lists]

    def on_daq_list(self, daq_list, _received, sent, payload):
        self.rows[daq_list].append((sent, *payload))

    def finalize(self):
        pass


def measurement(name):
    address = address_of(name)
    return name, address, 0, KINDS[TYPES[places()[address].signal.type]]


def wait_for(daq, count):
    """Measure until each list has so many rows."""
    end_s = time.monotonic() + PATIENCE_S
    while min(map(len, daq.rows)) < count:
        assert time.monotonic() < end_s, f"rows within {PATIENCE_S:g} s: {[*map(len, daq.rows)]}"
        time.sleep(0.01)


def main(protocol, port, rows, file):
    daq = Rows([
        DaqList(name=side, event_num=number, stim=False, enable_timestamps=True,
                measurements=[measurement(name) for name in names], priority=0, prescaler=1)
        for number, (side, names) in enumerate(SIGNALS.items())
    ])  # fmt: skip
    ethernet = {"host": "127.0.0.1", "port": int(port), "protocol": protocol, "ipv6": False}
    app = create_application_from_config({"Transport": {"layer": "ETH", "Eth": ethernet}})
    set_application(app)
    with Master("eth", config=app, policy=daq) as master:
        master.connect()
        daq.setup()
        daq.start()
        wait_for(daq, int(rows))
        master.setMta(address_of(GAIN))
        master.download(struct.pack("<d", 41.0 if protocol == "TCP" else 43.0))
        daq.stop()
        master.disconnect()
    np.savez(file, **{
        name: [row[1 + at] for row in rows]
        for rows, listed in zip(daq.rows, daq.daq_lists, strict=True)
        for at, (name, *_) in enumerate(listed.headers)
    })  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
