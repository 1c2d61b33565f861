"""Records of a tick, added one by one; written by `python -m bench.dev.generate`.

What they hold is declared in hil/log/topics.py. A number outside its type raises struct.error.
"""

# fmt: off
# ruff: noqa: E501
from __future__ import annotations

import struct
from typing import Final

from librt.strings import BytesWriter, write_f64_le, write_i32_le, write_i64_le
from mypy_extensions import i32, i64

_OUT: Final = BytesWriter()
_PARTS: Final[list[bytes]] = []
_add: Final = _PARTS.append


def begin() -> None:
    """Begin with no record."""
    if NATIVE:
        _OUT.truncate(0)
    else:
        _PARTS.clear()


def packed() -> bytes:
    """Return the records added since the beginning, one behind the other."""
    return _OUT.getvalue() if NATIVE else b"".join(_PARTS)


def _stamp(tick: i64, t_ns: i64) -> None:
    write_i32_le(_OUT, i32(tick))
    write_i64_le(_OUT, t_ns)
    write_i64_le(_OUT, t_ns)
    write_i32_le(_OUT, 256)


NATIVE: Final = not hasattr(_stamp, "__code__")
"""Whether this module is compiled: interpreted, a native store costs more than `struct` does."""


_SENSOR: Final = struct.Struct("<11sIQQ4sIxxxxqdddddB").pack


def sensor(
    tick: i64, t_ns: i64, x_m: float, v_m_s: float, p_left_pa: float, p_right_pa: float,
    electric_power_w: float, status: i64,
) -> None:
    """Add a record of /sensor."""
    if NATIVE and not (tick >> 32 | t_ns >> 63 | status >> 8):
        _OUT.write(b'\x05S\x00\x00\x00\x00\x00\x00\x00\x01\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, tick)
        write_i64_le(_OUT, t_ns)
        write_f64_le(_OUT, x_m)
        write_f64_le(_OUT, v_m_s)
        write_f64_le(_OUT, p_left_pa)
        write_f64_le(_OUT, p_right_pa)
        write_f64_le(_OUT, electric_power_w)
        _OUT.append(status)
    else:
        _add(_SENSOR(
            b'\x05S\x00\x00\x00\x00\x00\x00\x00\x01\x00', tick, t_ns, t_ns, b'\x00\x01\x00\x00',
            tick, t_ns, x_m, v_m_s, p_left_pa, p_right_pa, electric_power_w, status,
        ))


_TRUTH: Final = struct.Struct("<11sIQQ4sIxxxxqddddIIqdIxxxxdd").pack


def truth(
    tick: i64, t_ns: i64, x_m: float, v_m_s: float, fuel_kg: float, load_coefficient_n_s_m: float,
    disturbance: i64, dc_index: i64, dc_t_ns: i64, dc_x_m: float, contacts: i64,
    lambda_ratio: float, manifold_pa: float,
) -> None:
    """Add a record of /truth."""
    if NATIVE and not (tick >> 32 | t_ns >> 63 | disturbance >> 32 | dc_index >> 32 | contacts >> 32):
        _OUT.write(b'\x05z\x00\x00\x00\x00\x00\x00\x00\x04\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, tick)
        write_i64_le(_OUT, t_ns)
        write_f64_le(_OUT, x_m)
        write_f64_le(_OUT, v_m_s)
        write_f64_le(_OUT, fuel_kg)
        write_f64_le(_OUT, load_coefficient_n_s_m)
        write_i64_le(_OUT, disturbance | dc_index << 32)
        write_i64_le(_OUT, dc_t_ns)
        write_f64_le(_OUT, dc_x_m)
        write_i64_le(_OUT, contacts)
        write_f64_le(_OUT, lambda_ratio)
        write_f64_le(_OUT, manifold_pa)
    else:
        _add(_TRUTH(
            b'\x05z\x00\x00\x00\x00\x00\x00\x00\x04\x00', tick, t_ns, t_ns, b'\x00\x01\x00\x00',
            tick, t_ns, x_m, v_m_s, fuel_kg, load_coefficient_n_s_m, disturbance, dc_index,
            dc_t_ns, dc_x_m, contacts, lambda_ratio, manifold_pa,
        ))


_TIMING: Final = struct.Struct("<11sIQQ4sIxxxxqqqqqB").pack


def timing(
    tick: i64, t_ns: i64, scheduled_ns: i64, woke_ns: i64, done_ns: i64, used_tick: i64,
    missed: i64,
) -> None:
    """Add a record of /timing."""
    if NATIVE and not (tick >> 32 | t_ns >> 63 | missed >> 8):
        _OUT.write(b'\x05K\x00\x00\x00\x00\x00\x00\x00\x05\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, tick)
        write_i64_le(_OUT, t_ns)
        write_i64_le(_OUT, scheduled_ns)
        write_i64_le(_OUT, woke_ns)
        write_i64_le(_OUT, done_ns)
        write_i64_le(_OUT, used_tick)
        _OUT.append(missed)
    else:
        _add(_TIMING(
            b'\x05K\x00\x00\x00\x00\x00\x00\x00\x05\x00', tick, t_ns, t_ns, b'\x00\x01\x00\x00',
            tick, t_ns, scheduled_ns, woke_ns, done_ns, used_tick, missed,
        ))


_ACTUATOR: Final = struct.Struct("<11sIQQ4sIxxxxqIBxxxdddB4Bxxx4q4q").pack


def actuator(
    tick: i64, t_ns: i64, answers_tick: i64, mode: i64, force_n: float,
    load_coefficient_n_s_m: float, throttle: float, pulse_count: i64,
    pulse_channel: tuple[i64, i64, i64, i64], pulse_open_t_ns: tuple[i64, i64, i64, i64],
    pulse_duration_ns: tuple[i64, i64, i64, i64],
) -> None:
    """Add a record of /actuator."""
    if NATIVE and not (tick >> 32 | t_ns >> 63 | answers_tick >> 32 | mode >> 8 | pulse_count >> 8 | pulse_channel[0] >> 8 | pulse_channel[1] >> 8 | pulse_channel[2] >> 8 | pulse_channel[3] >> 8):
        _OUT.write(b'\x05\x92\x00\x00\x00\x00\x00\x00\x00\x02\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, tick)
        write_i64_le(_OUT, t_ns)
        write_i64_le(_OUT, answers_tick | mode << 32)
        write_f64_le(_OUT, force_n)
        write_f64_le(_OUT, load_coefficient_n_s_m)
        write_f64_le(_OUT, throttle)
        write_i64_le(_OUT, pulse_count | pulse_channel[0] << 8 | pulse_channel[1] << 16 | pulse_channel[2] << 24 | pulse_channel[3] << 32)
        write_i64_le(_OUT, pulse_open_t_ns[0])
        write_i64_le(_OUT, pulse_open_t_ns[1])
        write_i64_le(_OUT, pulse_open_t_ns[2])
        write_i64_le(_OUT, pulse_open_t_ns[3])
        write_i64_le(_OUT, pulse_duration_ns[0])
        write_i64_le(_OUT, pulse_duration_ns[1])
        write_i64_le(_OUT, pulse_duration_ns[2])
        write_i64_le(_OUT, pulse_duration_ns[3])
    else:
        _add(_ACTUATOR(
            b'\x05\x92\x00\x00\x00\x00\x00\x00\x00\x02\x00', tick, t_ns, t_ns, b'\x00\x01\x00\x00',
            tick, t_ns, answers_tick, mode, force_n, load_coefficient_n_s_m, throttle, pulse_count,
            *pulse_channel, *pulse_open_t_ns, *pulse_duration_ns,
        ))


_FRAMES_SENT: Final = struct.Struct("<BQHIQQ4sIxxxxqI").pack


def frames_sent(tick: i64, t_ns: i64, data: bytes) -> None:
    """Add a record of /frames/sent."""
    if NATIVE and not (tick >> 32 | t_ns >> 63):
        size = len(data)
        _OUT.append(5)
        write_i64_le(_OUT, 46 + size)
        _OUT.write(b'\x07\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, tick)
        write_i64_le(_OUT, t_ns)
        write_i32_le(_OUT, i32(size))
        _OUT.write(data)
    else:
        _add(_FRAMES_SENT(
            5, 46 + len(data), 7, tick, t_ns, t_ns, b'\x00\x01\x00\x00', tick, t_ns, len(data),
        ) + data)


_FRAMES_RECEIVED: Final = struct.Struct("<BQHIQQ4sIxxxxqI").pack


def frames_received(tick: i64, t_ns: i64, data: bytes) -> None:
    """Add a record of /frames/received."""
    if NATIVE and not (tick >> 32 | t_ns >> 63):
        size = len(data)
        _OUT.append(5)
        write_i64_le(_OUT, 46 + size)
        _OUT.write(b'\x08\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, tick)
        write_i64_le(_OUT, t_ns)
        write_i32_le(_OUT, i32(size))
        _OUT.write(data)
    else:
        _add(_FRAMES_RECEIVED(
            5, 46 + len(data), 8, tick, t_ns, t_ns, b'\x00\x01\x00\x00', tick, t_ns, len(data),
        ) + data)


_STROKE: Final = struct.Struct("<11sIQQ4sIIqBxxxxxxxddddddddddddd").pack


def stroke(
    index: i64, tick: i64, t_ns: i64, side: i64, tdc_m: float, tdc_ref_m: float, v_mid_m_s: float,
    v_ref_m_s: float, fuel_kg: float, outer_p_m_s: float, outer_i_m_s: float, inner_p_kg: float,
    inner_i_kg: float, speed_hz: float, power_w: float, power_ref_w: float, lambda_ratio: float,
) -> None:
    """Add a record of /stroke."""
    if NATIVE and not (index >> 32 | tick >> 32 | t_ns >> 63 | side >> 8):
        _OUT.write(b'\x05\x9a\x00\x00\x00\x00\x00\x00\x00\x03\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, index | tick << 32)
        write_i64_le(_OUT, t_ns)
        write_i64_le(_OUT, side)
        write_f64_le(_OUT, tdc_m)
        write_f64_le(_OUT, tdc_ref_m)
        write_f64_le(_OUT, v_mid_m_s)
        write_f64_le(_OUT, v_ref_m_s)
        write_f64_le(_OUT, fuel_kg)
        write_f64_le(_OUT, outer_p_m_s)
        write_f64_le(_OUT, outer_i_m_s)
        write_f64_le(_OUT, inner_p_kg)
        write_f64_le(_OUT, inner_i_kg)
        write_f64_le(_OUT, speed_hz)
        write_f64_le(_OUT, power_w)
        write_f64_le(_OUT, power_ref_w)
        write_f64_le(_OUT, lambda_ratio)
    else:
        _add(_STROKE(
            b'\x05\x9a\x00\x00\x00\x00\x00\x00\x00\x03\x00', tick, t_ns, t_ns, b'\x00\x01\x00\x00',
            index, tick, t_ns, side, tdc_m, tdc_ref_m, v_mid_m_s, v_ref_m_s, fuel_kg, outer_p_m_s,
            outer_i_m_s, inner_p_kg, inner_i_kg, speed_hz, power_w, power_ref_w, lambda_ratio,
        ))


_DEMAND: Final = struct.Struct("<11sIQQ4sIxxxxqdd").pack


def demand(tick: i64, t_ns: i64, fuel_kg: float, v_ref_m_s: float) -> None:
    """Add a record of /demand."""
    if NATIVE and not (tick >> 32 | t_ns >> 63):
        _OUT.write(b'\x05:\x00\x00\x00\x00\x00\x00\x00\t\x00')
        _stamp(tick, t_ns)
        write_i64_le(_OUT, tick)
        write_i64_le(_OUT, t_ns)
        write_f64_le(_OUT, fuel_kg)
        write_f64_le(_OUT, v_ref_m_s)
    else:
        _add(_DEMAND(
            b'\x05:\x00\x00\x00\x00\x00\x00\x00\t\x00', tick, t_ns, t_ns, b'\x00\x01\x00\x00',
            tick, t_ns, fuel_kg, v_ref_m_s,
        ))
