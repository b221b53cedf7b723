"""Experiments as declarations: trials, resuming, keys over code, differences on the same seeds, the files written."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.stage import Parameters

from benchmarks import command, discovery, keeping
from benchmarks.command import run
from benchmarks.discovery import experiment_files, load_experiment
from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, mean, share
from benchmarks.tabulation import Figure


class Options(Parameters):
    """Options of the small experiment."""

    scale: float = Field(1.0, description="Factor")
    place: Path | None = Field(None, description="Where things are")


@dataclass(frozen=True)
class Row:
    """A record."""

    value: float


MEASURED: list[Trial] = []
FAILS: set[Trial] = set()
BONUS = {"ours": 1.0, "thesis": 0.0}


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Row]]:
    for trial in trials:
        if trial in FAILS:
            raise RuntimeError("killed here")
        MEASURED.append(trial)
        # Rooms differ far more than arms do; two seeds of one room are alike.
        yield trial, Row(bench.parameters.scale * (10.0 * int(trial.seed[0]) + BONUS[trial.arm]))


SMALL = Experiment(
    name="small",
    title="Small",
    simulated="All.",
    knows="All.",
    does_not_show="All.",
    arms={"thesis": "thesis", "ours": "ours"},
    cases=("one", "two/parts"),
    tuning=("7a",),
    reporting=("1a", "1b", "2a", "3a"),
    cluster=lambda seed: seed[0],
    together=lambda trial: trial.seed,
    measure=measure,
    record=Row,
    measures={"value": mean("value", "m"), "count": Measure(lambda records: float(len(records)), interval=False)},
    parameters=Options,
    places=frozenset({"place"}),
    quick_seeds=2,
    quick={"scale": 0.5},
    pairs=(("ours", "thesis"),),
    compared=("value",),
)


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeping, "load_experiment", lambda name: SMALL)
    MEASURED.clear()
    FAILS.clear()


def figures_in(out: Path) -> dict[str, dict[str, float]]:
    return json.loads((out / "figures.json").read_text())["figures"]


def test_what_is_measured_is_kept_and_the_figures_are_written(tmp_path: Path, capsys) -> None:
    words = ["small", "--out", str(tmp_path), "--scale", "2"]
    assert run(SMALL, words) == 0 and len(MEASURED) == 16
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["ours/one/value"] == 2 * (1 + (10 + 10 + 20 + 30) / 4) and metrics["ours/two/parts/count"] == 4
    about = json.loads((tmp_path / "figures.json").read_text())
    assert about["experiment"] == "small" and about["command"].endswith("--scale 2")
    assert set(figures_in(tmp_path)["ours/one/value"]) == {"value", "low", "high", "cases", "unit"}
    assert figures_in(tmp_path)["ours/one/count"]["low"] is None
    assert "| one: ours – thesis | 2 [2, 2] |" in capsys.readouterr().out, "paired: rooms cancel"
    before = (tmp_path / "metrics.json").read_bytes()
    assert run(SMALL, words) == 0 and len(MEASURED) == 16, "nothing is measured twice"
    assert (tmp_path / "metrics.json").read_bytes() == before
    assert run(SMALL, [*words, "--place", "elsewhere"]) == 0 and len(MEASURED) == 16, "where things are is in no key"
    assert run(SMALL, [*words, "--fresh", "--arms", "ours", "--cases", "one"]) == 0 and len(MEASURED) == 20
    assert run(SMALL, ["small", "--out", str(tmp_path), "--seeds", "2a"]) == 0 and len(MEASURED) == 24, "other scale"


def test_further_figures_may_say_of_how_many_cases_they_are(tmp_path: Path) -> None:
    share = Figure(0.5, 0.1, 0.9, 4, "m")
    more = replace(SMALL, more_figures=lambda _: {"ours/one/half": share, "ours/one/two": 2.0, "ours/one/none": None})
    assert run(more, ["small", "--out", str(tmp_path)]) == 0
    figures = figures_in(tmp_path)
    assert figures["ours/one/half"] == vars(share) and "ours/one/none" not in figures
    assert figures["ours/one/two"] == {"value": 2.0, "low": None, "high": None, "cases": None, "unit": ""}


def test_a_run_that_was_stopped_goes_on(tmp_path: Path) -> None:
    FAILS.add(Trial("ours", "two/parts", "2a"))
    words = ["small", "--out", str(tmp_path)]
    assert run(SMALL, words) == 1
    kept = len(MEASURED)
    assert "Not measured: ours/two/parts/2a" in (tmp_path / "table.md").read_text()
    FAILS.clear()
    assert run(SMALL, words) == 0 and len(MEASURED) == 16 and kept == 15
    assert "Not measured" not in (tmp_path / "table.md").read_text()


def test_quick_tuning_and_counts_choose_the_trials(tmp_path: Path) -> None:
    assert run(SMALL, ["small", "--out", str(tmp_path), "--quick", "--cases", "one"]) == 0
    assert {trial.seed for trial in MEASURED} == {"1a", "1b"}
    assert figures_in(tmp_path)["thesis/one/value"]["value"] == 5.0, "the parameters of --quick"
    assert figures_in(tmp_path)["thesis/one/value"]["low"] is None, "one room has no interval"
    MEASURED.clear()
    assert run(SMALL, ["small", "--out", str(tmp_path), "--tuning", "--count", "1"]) == 0
    assert {trial.seed for trial in MEASURED} == {"7a"}
    assert run(SMALL, ["small", "--out", str(tmp_path / "other"), "--kept"]) == 0 and len(MEASURED) == 4
    for wrong in (["--arms", "nobody"], ["--seeds", "9z"], ["--cases", "three"]):
        with pytest.raises(UsageError):
            run(SMALL, ["small", "--out", str(tmp_path), *wrong])
    with pytest.raises(SystemExit) as left:
        run(SMALL, ["small", "--out", str(tmp_path), "--scale", "nan"])
    assert left.value.code == 2


def test_differences_resample_whole_rooms() -> None:
    values = {"1a": (1.0, 0.0), "1b": (1.0, 0.0), "2a": (0.0, 0.0)}
    records = {Trial(arm, "one", s): Row(v[k]) for s, v in values.items() for k, arm in enumerate(("ours", "thesis"))}
    results = Results(SMALL, Bench(Path("nowhere"), Options.model_validate({})), records)
    found = results.difference("ours", "thesis", "one", "value")
    assert found is not None and found.value == pytest.approx(2 / 3) and (found.low, found.high) == (0.0, 1.0)
    alone = Results(replace(SMALL, cluster=str), results.bench, {t: r for t, r in records.items() if t.seed == "1a"})
    assert alone.difference("ours", "thesis", "one", "value") is None


def test_tries_that_all_came_out_alike_have_an_interval_with_a_width() -> None:
    records = {Trial("ours", "one", str(seed)): Row(1.0) for seed in range(20)}
    tries = replace(SMALL, cluster=str, measures={"value": share("value")})
    bench = Bench(Path("nowhere"), Options.model_validate({}))
    found = Results(tries, bench, records).interval("ours", "one", "value")
    assert found is not None
    assert (found.value, found.low, found.high) == pytest.approx((1.0, 20 / (20 + 1.959964**2), 1.0))
    rooms = Results(replace(tries, cluster=lambda seed: seed[0]), bench, records).interval("ours", "one", "value")
    assert rooms is not None and (rooms.low, rooms.high) == (1.0, 1.0), "several tries a room: rooms are drawn anew"


def test_every_experiment_is_found_by_its_place_and_says_what_it_shows() -> None:
    names = list(experiment_files())
    assert {"mapping", "scene", "graph_supports", "poses", "planning_motion", "disparity"} <= set(names)
    for name in names:
        experiment = load_experiment(name)
        for text in (experiment.title, experiment.simulated, experiment.knows, experiment.does_not_show):
            assert text, name
        assert {arm for pair in experiment.pairs for arm in pair} <= set(experiment.arms), name
        assert set(experiment.compared) <= set(experiment.measures), name
        assert not set(experiment.tuning) & set(experiment.reporting), name
        assert experiment.places <= set(experiment.parameters.model_fields), name


def test_listing_imports_no_experiment(capsys) -> None:
    before = set(sys.modules)
    for file in experiment_files().values():
        assert discovery.summary_of(file).endswith("."), file
    assert not {name for name in set(sys.modules) - before if name.startswith("benchmarks.experiments.")}


def test_what_is_published_is_whole_and_of_reporting_seeds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, folder = tmp_path / "out", tmp_path / "published"
    folder.mkdir()
    monkeypatch.setattr(command.publish, "__defaults__", (folder,))
    for words in (["--quick"], ["--tuning"]):
        with pytest.raises(UsageError, match="nothing is published"):
            run(SMALL, ["small", "--out", str(tmp_path / words[0]), "--publish", *words])
    assert run(SMALL, ["small", "--out", str(out), "--publish"]) == 0
    made = json.loads((folder / "small.json").read_text())
    assert made == json.loads((out / "figures.json").read_text())
    assert "reporting" in made["notes"] and "FOLDER" in made["command"] and "--publish" not in made["command"]
    (lost,) = [path for path in out.rglob("record.json")][:1]
    lost.unlink()
    assert run(SMALL, ["small", "--out", str(out), "--publish", "--kept"]) == 0
    (name,) = json.loads((folder / "small.json").read_text())["not_measured"]
    assert name == "/".join(lost.relative_to(out / "trials").parts[:-2])
