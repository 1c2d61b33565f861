"""Engines of the literature: what is printed of them; kinds of machine on one engine."""

import pytest

from bench.studies.atlas.command import results
from bench.studies.atlas.entries.machines import kinds
from bench.studies.engine.operation import operate
from hil.config.detailed import ideal, literature, names, read
from hil.config.plant import PlantConfig
from plant.engines.detailed.settle import calibration_of


def test_engines_of_the_literature_give_their_printed_figures():
    assert [j.id for _, j in results(["2"]) if j.verdict != "pass"] == []


def test_engines_of_the_literature_are_found_by_name_and_settle():
    assert {c.name for c in literature()} == {"wvu", "ulsan", "fpec", "bounce-chamber"}
    for c in literature():
        assert c.name in names()
        assert operate(c).contacts == 0


def test_kinds_of_machine_agree_where_windings_are_quick():
    """Eq. 3.56 of all of them: the same dead centre to 0.1 mm, and work is power and heat."""
    found = {name: operate(c).figures for name, c in kinds().items()}
    plain = found["load constant"]
    for figures in found.values():
        assert figures.tdc_m == pytest.approx(plain.tdc_m, abs=1e-4)
        given = figures.electric_w + figures.copper_w
        assert given == pytest.approx(plain.electric_w, rel=0.02)
    assert found["circuit"].copper_w == pytest.approx(found["coil and magnets"].copper_w, rel=0.01)


def test_ideal_engine_neither_leaks_nor_warms_its_walls():
    config = PlantConfig(model="starting", prototype="bit", ideal=True)
    c = calibration_of(config)
    assert c == ideal(read("bit-starting"))
    assert (c.left.walls, c.left.leak_m2, c.right.walls, c.right.leak_m2) == (0.0,) * 4
    with pytest.raises(ValueError, match="ideal: model harmonic has no such losses"):
        PlantConfig(ideal=True)
