"""The linear machine of an engine in full: load constant, circuit, coil and magnets, dq machine."""

from __future__ import annotations

import math
from typing import Final, Self

from pydantic import Field, model_validator

from hil.config.base import Section
from hil.config.ranges import ForceN, LoadCoefficient, StartForceN

MU_0: Final = 4e-7 * math.pi
"""Permeability of the vacuum [H/m]."""


class Circuit(Section):
    """Equivalent circuit (3.54); thrust and back-EMF constants, and pole pitch for one coil.

    resistance_ohm: R_S, the machine's own; what the load coefficient asks for beyond it is the
        load's R_L (3.56), and what that takes is the electric power. 0: both are one
    """

    thrust_n_a: float = Field(gt=0.0, le=1e4)
    emf_v_s_m: float = Field(gt=0.0, le=1e4)
    resistance_ohm: float = Field(default=0.0, ge=0.0, le=1e3)
    inductance_h: float = Field(gt=1e-6, le=10.0)
    capacitance_f: float | None = Field(default=None, gt=0.0, le=1e3)
    pole_pitch_m: float | None = Field(default=None, gt=1e-3, le=1.0)


class Flux(Section):
    """One coil and the magnets that pass it (3.31 to 3.51).

    air_gap_m, turns, coil_length_m: g_0, N and l_m; mmf_a: height M_PM of the magnets' rectangular
    wave; magnet_m, pole_pitch_m: their width tau_p and their pitch tau; resistance_ohm: R_S
    """

    air_gap_m: float = Field(gt=1e-5, le=0.1)
    turns: int = Field(gt=0, le=100_000)
    coil_length_m: float = Field(gt=1e-3, le=10.0)
    mmf_a: float = Field(gt=0.0, le=1e6)
    magnet_m: float = Field(gt=1e-4, le=1.0)
    pole_pitch_m: float = Field(gt=1e-3, le=1.0)
    resistance_ohm: float = Field(gt=0.0, le=1e3)
    inductance_h: float = Field(gt=1e-6, le=10.0)

    @model_validator(mode="after")
    def _magnets_fit(self) -> Self:
        if self.magnet_m > self.pole_pitch_m:
            raise ValueError("magnet_m is wider than pole_pitch_m; accepted is at most as wide")
        return self

    @property
    def linkage_v_s(self) -> float:
        """Greatest flux linkage (mu_0/g_0)(8/pi^2) tau N l_m M_PM sin(pi tau_p/(2 tau))  (3.50)."""
        wave = math.sin(0.5 * math.pi * self.magnet_m / self.pole_pitch_m) * self.mmf_a
        field = MU_0 / self.air_gap_m * 8.0 / math.pi**2 * wave
        return field * self.pole_pitch_m * self.turns * self.coil_length_m

    @property
    def circuit(self) -> Circuit:
        """The circuit that it is: F = i dlambda/dx, K = pi/tau times the linkage  (3.51, 3.53)."""
        k = math.pi / self.pole_pitch_m * self.linkage_v_s
        return Circuit(thrust_n_a=k, emf_v_s_m=k, resistance_ohm=self.resistance_ohm,
                       inductance_h=self.inductance_h, pole_pitch_m=self.pole_pitch_m)  # fmt: skip


class Dq(Section):
    """Three-phase machine in dq coordinates (App. I eqs. 22, 23) on current regulators.

    regulator_s: time constant of the regulators; supply_v: greatest phase voltage
    """

    thrust_n_a: float = Field(gt=0.0, le=1e4)
    resistance_ohm: float = Field(ge=0.0, le=1e3)
    inductance_h: float = Field(gt=1e-6, le=10.0)
    pole_pitch_m: float = Field(gt=1e-3, le=1.0)
    regulator_s: float = Field(gt=1e-5, le=0.1)
    supply_v: float = Field(gt=0.0, le=1e5)


class Machine(Section):
    """Linear machine: load constant (3.56), a circuit, one from its magnets, or a dq machine."""

    load_coefficient_n_s_m: LoadCoefficient
    peak_force_n: ForceN
    start_force_n: StartForceN
    circuit: Circuit | None = None
    flux: Flux | None = None
    dq: Dq | None = None

    @model_validator(mode="after")
    def _is_one_machine(self) -> Self:
        if sum(kind is not None for kind in (self.circuit, self.flux, self.dq)) > 1:
            raise ValueError("circuit, flux and dq are kinds of machine; accepted is one of them")
        return self
