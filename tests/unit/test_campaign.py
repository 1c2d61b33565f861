"""Campaigns: draws by seed and number alone, parts that are never run twice, one table."""

import math
import tomllib
from contextlib import contextmanager
from itertools import pairwise

import pytest
from rich.console import Console

from bench.judge.response import Response
from bench.run import scenarios
from bench.run.memory.pair import Pair
from bench.run.offline import Silence, silences_of, simulate
from bench.run.resolve import resolve
from bench.studies.campaign import config, run
from bench.studies.campaign import execution as campaigns
from bench.studies.campaign import table as campaign_table
from bench.studies.campaign.config import (
    Campaign,
    LoadSpread,
    MisfireSpread,
    Spread,
    StopRule,
    draw,
)
from bench.studies.campaign.execution import Shard
from bench.studies.campaign.stopping import Tally, Watch, half_width
from bench.studies.compare import compare, laws_of
from bench.studies.compare_page import table
from hil.config.check import check
from hil.config.process import LinkConfig
from hil.errors import ConfigError, RunError
from plant.sensors import sample

pytest.importorskip("pyarrow")

CONSOLE = Console(quiet=True)
SMALL = Campaign(
    name="small", runs=10, seed=3, duration_s=0.4, controllers=("cascade", "pdf"),
    load=LoadSpread(at_s=0.2, ramp_s=0.05),
    misfires=MisfireSpread(),
    set={"plant.sensors.noise_v_m_s": 0.02},
    vary={"plant.engine.moving_mass_kg": Spread(relative=0.1),
          "plant.injector.dead_time_s": Spread(low=0.72e-3, high=0.88e-3),
          "plant.command_delay_ticks": Spread(choices=(0, 1))},
)  # fmt: skip


class Future:
    def __init__(self, key, value):
        self.key, self.value, self.status = key, value, "finished"

    def result(self):
        return self.value


class Serial:
    """A cluster in this process; `fail_after` parts it is gone."""

    def __init__(self, fail_after=None):
        self.ran, self.fail_after = [], fail_after

    def scheduler_info(self):
        return {"workers": {"here": {}}}

    def submit(self, function, campaign, indices, pure):
        if self.fail_after is not None and len(self.ran) >= self.fail_after:
            future = Future(str(indices[0]), None)
            future.status, future.exception = "error", lambda: "killed"
            return future
        self.ran.append(indices)
        return Future(str(indices[0]), function(campaign, indices))


@pytest.fixture
def cluster(monkeypatch):
    pytest.importorskip("distributed")
    made = []

    class Queue(list):
        def add(self, future):
            self.append(future)

        def __iter__(self):
            while self:
                yield self.pop(0)

    @contextmanager
    def serial(scheduler, workers):
        yield made[-1]

    monkeypatch.setattr(campaigns, "_cluster", serial)
    monkeypatch.setattr(campaigns, "PART", 4)
    monkeypatch.setattr("distributed.as_completed", Queue)
    return made


def test_a_draw_depends_on_seed_and_number_alone():
    assert draw(SMALL, 17) == draw(SMALL, 17)
    assert draw(SMALL, 17) != draw(SMALL, 19)
    other = draw(SMALL.model_copy(update={"seed": 4}), 17)
    assert other.facts != draw(SMALL, 17).facts


def test_laws_meet_the_same_draws():
    one, two = draw(SMALL, 20).facts, draw(SMALL, 21).facts
    assert one.pop("controller") == "cascade"
    assert two.pop("controller") == "pdf"
    assert one == two


def test_draws_stay_in_their_spreads():
    for index in range(0, 200, 2):
        facts = draw(SMALL, index).facts
        assert 6.3 <= facts["plant.engine.moving_mass_kg"] <= 7.7
        assert 0.72e-3 <= facts["plant.injector.dead_time_s"] <= 0.88e-3
        assert facts["plant.command_delay_ticks"] in (0, 1)
        assert 0.8 <= facts["load"] <= 1.2


def test_the_controller_believes_the_engine_that_was_not_varied():
    nominal = Campaign(runs=1, duration_s=0.4, load=LoadSpread(at_s=0.2))
    varied = config.scenario_of(SMALL, draw(SMALL, 0)).controller.preset
    assert varied == config.scenario_of(nominal, draw(nominal, 0)).controller.preset


def test_a_run_gives_the_same_row_again():
    assert str(run.run_one(SMALL, 5)) == str(run.run_one(SMALL, 5))


def silences_drawn(campaign, index):
    return draw(campaign, index).overrides["link.silences"]


def test_silences_are_drawn_apart_at_any_phase_and_end_before_the_run_does():
    campaign = config.read("no-loss")
    found = [silences_drawn(campaign, index) for index in range(0, 60, 6)]
    assert found == [silences_drawn(campaign, index) for index in range(5, 60, 6)]
    for silences in found:
        for begin_s, end_s, of in silences:
            assert 1e-3 <= end_s - begin_s <= 9e-3
            assert end_s < campaign.duration_s
            assert of in ("samples", "answers", "both")
        assert all(a[1] < b[0] for a, b in pairwise(silences))


def silent():
    """A draw with silences of all kinds, one in each stroke."""
    drawn = draw(SMALL, 0)
    silences = [[1e-3 * k, 1e-3 * k + 6e-3, ("answers", "samples", "both")[k % 3]]
                for k in range(30, 250, 31)]  # fmt: skip
    silences = {"link.kind": "memory", "link.silences": silences}
    return drawn.model_copy(update={"overrides": drawn.overrides | silences})


def test_a_silence_hides_samples_and_answers_and_the_engine_goes_on():
    scenario = config.scenario_of(SMALL, silent())
    assert silences_of(scenario)[:2] == (
        Silence(30, 36, samples=False),
        Silence(61, 67, answers=False),
    )
    course = simulate(scenario)
    assert course.dead_centres != simulate(config.scenario_of(SMALL, draw(SMALL, 0))).dead_centres
    assert course.mode == "generating"


def test_the_scenario_of_a_worst_run_repeats_it_silences_included(tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_table, "draw", lambda campaign, index: silent())
    campaign_table.write_worst(SMALL, [run.run_one(SMALL, 0)], tmp_path)
    scenario = resolve(scenarios.read(str(tmp_path / "000000.toml")))
    assert len(scenario.link.silences) == 8
    assert simulate(scenario) == simulate(config.scenario_of(SMALL, silent()))


def test_a_silence_is_the_same_in_both_loops():
    """But for the resolution of the wire."""
    scenario = config.scenario_of(SMALL, silent())
    course = simulate(scenario)
    x_m = []
    with Pair(scenario) as pair:
        for _ in range(scenario.ticks):
            x_m.append(sample(pair.plant.params, pair.plant.state).x_m)
            pair.advance()
    assert x_m == pytest.approx(course.x_m, abs=20e-6)


@pytest.mark.parametrize(
    "link",
    [
        {"silences": [[0.1, 0.2, "both"]]},
        {"kind": "memory", "silences": [[0.2, 0.1, "both"]]},
        {"kind": "memory", "silences": [[0.1, 0.2, "none"]]},
    ],
)
def test_a_silence_that_cannot_be_is_refused(link):
    with pytest.raises(ConfigError, match="silences"):
        check(LinkConfig, link, "here")


def test_what_is_refused_is_not_lost():
    campaign = SMALL.model_copy(update={
        "set": {"loop.rate_hz": 500, "plant.command_delay_ticks": 3},
        "vary": {}, "models": ("harmonic",), "prototypes": ("nu",),
    })  # fmt: skip
    row = run.run_one(campaign, 0)
    assert (row["mode"], row["lost"]) == (run.NOT_BEGUN, False)
    assert "loop.rate_hz 500 with plant.command_delay_ticks 3" in row["note"]
    text = campaign_table.table(campaign, [row])
    assert "| cascade | 1 | 1 | 0 |" in text


@pytest.mark.parametrize("name", ["no-loss", "no-loss-two-stroke"])
def test_campaigns_of_every_kind_of_trouble_are_shipped(name):
    campaign = config.read(name)
    assert campaign.misfires.probability == 0.01
    assert campaign.vary["plant.command_delay_ticks"].choices == (0, 1, 2, 3)
    assert silences_drawn(campaign, 0)


def test_the_packaged_campaign_can_be_drawn():
    campaign = config.read("robustness")
    assert campaign.runs == 2000
    for index in range(40):
        config.scenario_of(campaign, draw(campaign, index))


@pytest.mark.parametrize(
    "spread", [{}, {"low": 1.0}, {"low": 0.0, "high": 1.0, "relative": 0.1}, {"relative": 2.0}]
)
def test_a_spread_is_of_one_kind(spread):
    with pytest.raises(ValueError, match=r"accepted|less than"):
        Spread.model_validate(spread)


def test_what_is_not_a_campaign_is_said_so(tmp_path):
    with pytest.raises(ConfigError, match="robustness"):
        config.read("unknown")
    file = tmp_path / "c.toml"
    file.write_text("runs = 0\n")
    with pytest.raises(ConfigError, match="runs"):
        config.read(str(file))


def test_a_campaign_that_was_killed_goes_on_and_runs_nothing_twice(cluster, tmp_path):
    cluster.append(Serial())
    whole = campaigns.run(SMALL, tmp_path / "whole", None, 1, CONSOLE)
    first = Serial(fail_after=2)
    cluster.append(first)
    with pytest.raises(RunError, match="killed"):
        campaigns.run(SMALL, tmp_path / "cut", None, 1, CONSOLE)
    second = Serial()
    cluster.append(second)
    cut = campaigns.run(SMALL, tmp_path / "cut", None, 1, CONSOLE)
    assert len(first.ran) == 2
    assert len(second.ran) == 1
    rows = campaigns.rows_of(cut)
    assert [row["run"] for row in rows] == list(range(10))
    tables = [campaign_table.table(SMALL, campaigns.rows_of(file)) for file in (whole, cut)]
    assert tables[0] == tables[1]
    cluster.append(None)
    assert campaigns.rows_of(campaigns.run(SMALL, tmp_path / "cut", None, 1, CONSOLE)) is not None


@pytest.mark.parametrize("damage", ["flip", "cut", "empty"])
def test_a_damaged_part_is_a_part_not_yet_done(cluster, tmp_path, damage):
    cluster.append(Serial())
    whole = campaigns.rows_of(campaigns.run(SMALL, tmp_path, None, 1, CONSOLE))
    file = sorted(tmp_path.glob("parts/part-*.parquet"))[1]
    data = bytearray(file.read_bytes())
    data[len(data) // 3] ^= 1
    file.write_bytes({"flip": data, "cut": data[: len(data) // 2], "empty": b""}[damage])
    again = Serial()
    cluster.append(again)
    assert campaigns.rows_of(campaigns.run(SMALL, tmp_path, None, 1, CONSOLE)) == whole
    assert again.ran == [list(range(4, 8))]
    assert len(list(tmp_path.glob("parts/*"))) == 3


def test_results_of_something_else_are_not_written_over(cluster, tmp_path):
    (tmp_path / "table.md").write_text("precious")
    cluster.append(Serial())
    with pytest.raises(ConfigError, match=r"table\.md: exists already"):
        campaigns.run(SMALL, tmp_path, None, 1, CONSOLE)
    assert (tmp_path / "table.md").read_text() == "precious"


STOPPING = SMALL.model_copy(
    update={"runs": 40, "stop": StopRule(figure="sigma_mm", half_width=1.0, least=10)}
)


def test_a_campaign_ends_when_enough_is_known_whatever_the_order(cluster, tmp_path):
    cluster.append(Serial())
    file = campaigns.run(STOPPING, tmp_path, None, 1, CONSOLE)
    runs = [row["run"] for row in campaigns.rows_of(file, ["run"])]
    assert runs == list(range(20))  # ten of each law, at the end of a part
    rows = run.run_many(STOPPING, list(range(24)))
    watch = Watch(STOPPING.stop, STOPPING.controllers)
    for number in (5, 2, 4, 0, 3, 1):
        watch.take(number, rows[4 * number : 4 * number + 4])
    assert watch.end == 5
    cluster.append(None)  # and none is run when it goes on
    assert campaigns.run(STOPPING, tmp_path, None, 1, CONSOLE) == file


@pytest.mark.parametrize(
    ("n", "lost", "low", "high"), [(100, 0, 0.0, 0.037), (400, 40, 0.0743, 0.1333)]
)
def test_the_interval_of_a_share_is_wilsons(n, lost, low, high):
    """Limits from the tables of Wilson's interval at 95 %."""
    rule = StopRule(figure="lost", half_width=0.01)
    width = half_width(rule, Tally(n, float(lost), float(lost)))
    assert 2.0 * width == pytest.approx(high - low, abs=1e-3)


def test_the_interval_of_a_mean_is_that_of_its_scatter():
    rule = StopRule(figure="peak_mm", half_width=0.01)
    values = [0.1 * k for k in range(-50, 51)]
    tally = Tally(len(values), sum(values), sum(v * v for v in values))
    assert half_width(rule, tally) == pytest.approx(1.96 * 2.930 / math.sqrt(101), rel=1e-3)
    assert half_width(rule, Tally(1, 0.0, 0.0)) == math.inf


def test_shards_of_a_campaign_come_together(cluster, tmp_path):
    cluster.append(Serial())
    whole = campaigns.run(SMALL, tmp_path / "whole", None, 1, CONSOLE)
    cluster.append(Serial())
    assert campaigns.run(SMALL, tmp_path / "a", None, 1, CONSOLE, Shard(1, 2)) is None
    assert cluster[-1].ran == [[0, 1, 2, 3], [8, 9]]
    cluster.append(Serial())
    assert campaigns.run(SMALL, tmp_path / "b", None, 1, CONSOLE, Shard(2, 2)) is None
    for part in (tmp_path / "b" / "parts").iterdir():
        part.rename(tmp_path / "a" / "parts" / part.name)
    cluster.append(None)
    merged = campaigns.run(SMALL, tmp_path / "a", None, 1, CONSOLE)
    assert str(campaigns.rows_of(merged)) == str(campaigns.rows_of(whole))


def test_a_million_runs_are_a_thousand_parts():
    assert campaigns.part_count(SMALL.model_copy(update={"runs": 1_000_000})) == 1000
    assert campaigns.part_count(SMALL.model_copy(update={"runs": 2000})) == 100


def test_another_campaign_does_not_go_into_the_same_directory(cluster, tmp_path):
    cluster.append(Serial())
    small = SMALL.model_copy(update={"runs": 2})
    campaigns.run(small, tmp_path, None, 1, CONSOLE)
    with pytest.raises(ConfigError, match="another campaign"):
        campaigns.run(small.model_copy(update={"seed": 9}), tmp_path, None, 1, CONSOLE)


def test_worst_runs_are_scenarios_that_can_be_run(tmp_path):
    rows = run.run_many(SMALL, list(range(6)))
    campaign_table.write_worst(SMALL, rows, tmp_path)
    files = sorted(tmp_path.glob("*.toml"))
    assert files
    tree = tomllib.loads(files[0].read_text())
    drawn = draw(SMALL, int(files[0].stem))
    again = config.build(tree, files[0].name)
    wanted = config.build(config.tree_of(SMALL, drawn), "x")
    assert again.plant == wanted.plant
    assert again.events == wanted.events
    assert again.controller == wanted.controller


def test_settling_counts_to_the_first_dead_centre_inside():
    response = Response((0.01, 0.02, 0.03), (1.0, 0.05, -0.02))
    assert response.settling_ms == pytest.approx(20.0)
    assert Response((0.01,), (1.0,)).settling_ms == math.inf
    noisy = Response(tuple(0.01 * k for k in range(1, 31)),
                     (2.0, *(0.2 * (-1) ** k for k in range(29))), 0.2)  # fmt: skip
    assert noisy.settling_ms == math.inf
    assert noisy.settling_band_ms == pytest.approx(20.0)
    assert noisy.settling_mean_ms == pytest.approx(20.0)


def test_a_comparison_shows_every_law_and_the_bound():
    found = compare("load-decrease", ["pdf"], [("plant.model", "rectangular")])
    text = table(found)
    assert "| bound |" in text
    assert "| pdf |" in text
    for load in found.loads:
        assert found.cells["pdf", load, "c"].response.peak_mm == pytest.approx(
            found.bounds[load, "c", "full"].peak_mm, rel=0.05, abs=0.012
        )


def test_unknown_laws_are_refused():
    with pytest.raises(ConfigError, match="cascade"):
        laws_of("cascade,none-such")
    with pytest.raises(ConfigError, match="load step"):
        compare("steady", ["pdf"])


@pytest.mark.slow
def test_a_local_cluster_gives_what_one_process_gives(tmp_path):
    pytest.importorskip("distributed")
    campaign = SMALL.model_copy(update={"runs": 24, "duration_s": 0.4})
    file = campaigns.run(campaign, tmp_path, None, 2, CONSOLE)
    here = run.run_many(campaign, list(range(24)))
    there = campaigns.rows_of(file)
    assert [str(row) for row in there] == [str(row) for row in here]
