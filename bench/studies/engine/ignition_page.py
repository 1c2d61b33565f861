"""`hil engine ignition`: the tables."""

from __future__ import annotations

from bench.studies.engine.ignition import estimates, operating_points, worth
from hil.config.engine.models import FAST_MODELS
from hil.config.prototypes import PROTOTYPES
from hil.errors import ConfigError


def show(prototype: str, model: str | None) -> None:
    """Print what the spark's place is worth, and where it is best, by operating point.

    Raises: ConfigError for an engine or a model that has no such map
    """
    pairs = [name for name, engine in PROTOTYPES.items() if engine.chambers == 2]
    if prototype not in pairs:
        raise ConfigError(f"--prototype {prototype}: accepted: {', '.join(pairs)}")
    if model is not None and model not in FAST_MODELS:
        raise ConfigError(f"--estimate {model}: accepted: {', '.join(FAST_MODELS)}")
    print("lead [ms]  work  peak [bar]")
    for lead_s, factor, peak_pa in worth(prototype):
        print(f"{1e3 * lead_s:9.2f}  {factor:.4f}  {1e-5 * peak_pa:6.1f}")
    print("\nTDC [mm]  load [N s/m]  fuel [mg]  best torque [ms, mm]  knock limit [ms, mm]  bar")
    for p in operating_points(prototype):
        print(
            f"{1e3 * p.tdc_m:8.2f}  {p.load_n_s_m:12.1f}  {1e6 * p.fuel_kg:9.4f}"
            f"  {1e3 * p.best_s:8.1f} {1e3 * p.best_m:10.3f}"
            f"  {1e3 * p.knock_s:9.1f} {1e3 * p.knock_m:10.3f}  {1e-5 * p.peak_pa:6.1f}"
        )
    if model is not None:
        print("\nfuel [mg]  lead [ms]  work  TDC estimated [mm]  settled [mm]  error [%]")
        for e in estimates(model):
            error = 100.0 * (e.estimated_m / e.settled_m - 1.0)
            print(
                f"{1e6 * e.fuel_kg:9.4f}  {1e3 * e.lead_s:9.2f}  {e.work:.4f}"
                f"  {1e3 * e.estimated_m:18.3f}  {1e3 * e.settled_m:12.3f}  {error:8.2f}"
            )
