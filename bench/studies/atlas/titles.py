"""What each figure and table shows, for those that no entry of its own draws."""

from __future__ import annotations

from typing import Final

TITLES: Final = {
    "T2.3": "Beijing engines", "T2.4": "West Virginia engine, spark-ignited",
    "T2.5": "Newcastle engine with a bounce chamber", "T2.6": "Sandia engine",
    "T2.7": "FPEC engine", "T2.9": "German Aerospace engine", "T2.10": "Toyota engine",
    "T2.11": "West Virginia engine, dimensions", "T2.12": "West Virginia engine, diesel",
    "T2.13": "Ulsan engine", "S2.3.2": "Pempek engine",
    "T3.1": "Processes and machine by stroke", "E3.18": "Heat to the wall",
    "E3.19": "Heat release", "E3.55": "Load circuit", "T3.2": "Newcastle engine",
    "T3.3": "Valve positions", "T4.1": "Motoring profile", "F4.6": "Settings of the drive",
    "F4.7": "Velocity in motoring", "F4.9": "Pressure in motoring",
    "E4.2": "Power spent on motoring", "E4.3": "Equivalent crank angle",
    "F4.16": "Shares of power over throttle, four-stroke", "F4.18": "Power over ignition timing",
    "F4.20": "Shares of power over motor force", "T5.1": "Analogy to mass, spring and damper",
    "T5.2": "Beijing engine", "F5.3": "Ideal cycle", "F5.7": "Where disturbances act",
    "E5.11": "Excitation by the heat release", "E5.13": "Pressure at mid-stroke",
    "E5.26": "Throttle factor", "E5.27": "Mixture", "E5.37": "Point of linearisation",
    "E5.53": "First harmonic of the excitation", "E5.58": "Frequency", "E5.60": "Settled motion",
    "E5.76": "Stability", "F6.1": "Levels of control", "T6.1": "What TDC and speed depend on",
    "T6.2": "Events of the single loop", "F6.5": "Cascade", "F6.11": "Moments of disturbance",
    "A1-T1": "Beijing engine", "A1-F7": "Peak pressures of six cycles",
    "A1-T2": "Performance over load", "A1-T3": "Performance at full throttle",
    "A2-T2": "Beijing engine", "A2-F6": "Displacement, test and linear model",
    "A2-F7": "Estimator of TDC and two controllers",
}  # fmt: skip


def title_of(group: str) -> str:
    """Return what a figure, table or section shows."""
    return TITLES.get(group, "printed in the text")
