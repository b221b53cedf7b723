"""Experiments as declarations: trials, resuming, keys over code, differences on the same seeds, the files written."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import Field
from scenewright.schemas.errors import UsageError
from scenewright.stages.kit.measurement.bootstrap import bootstrap_interval
from scenewright.stages.kit.stage import Parameters
from scipy import stats

from benchmarks import command, discovery, keeping
from benchmarks.command import changed_code, run
from benchmarks.discovery import experiment_files, load_experiment
from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, mean, median, ratio, share
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
    assert "one: ours – thesis" not in capsys.readouterr().out, "three rooms have no interval"
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


def results_with(values: dict[str, tuple[float, ...]], **changes: object) -> Results:
    """Return the results of the small experiment's arms in the case `one`."""
    records = {Trial(arm, "one", s): Row(x) for s, v in values.items() for arm, x in zip(SMALL.arms, v, strict=False)}
    return Results(replace(SMALL, **changes), Bench(Path("nowhere"), Options.model_validate({})), records)


def test_of_fewer_than_five_clusters_there_is_no_interval() -> None:
    values = {f"{room}{draw}": (float(room), 0.0) for room in range(4) for draw in "ab"}
    found = results_with(values)
    assert found.interval("thesis", "one", "value") is None, "eight trials of four rooms"
    assert found.difference("thesis", "ours", "one", "value") is None
    assert results_with(values, cluster=str).interval("thesis", "one", "value") is not None
    for of in (np.mean, np.median):
        alone = ratio([(1.0, 2.0), (3.0, 2.0), (2.0, 2.0), (2.0, 4.0)], of)
        assert alone is not None and alone.low is None and alone.cases == 4
        assert ratio([], of) is None


def test_of_five_to_nineteen_clusters_the_interval_of_a_mean_is_that_of_students_t() -> None:
    random = np.random.default_rng(1)
    values = {str(seed): tuple(random.normal(1.0, 0.5, 2)) for seed in range(8)}
    found = results_with(values, cluster=str)
    for told, of in (
        (found.interval("thesis", "one", "value"), np.array([v[0] for v in values.values()])),
        (found.difference("thesis", "ours", "one", "value"), np.array([v[0] - v[1] for v in values.values()])),
    ):
        low, high = stats.ttest_1samp(of, 0.0).confidence_interval(0.95)
        assert told is not None and (told.value, told.low, told.high) == pytest.approx((of.mean(), low, high))
    ratios = np.array([random.normal(2.0, 0.1, 400), np.ones(400)]).T
    told = [ratio([(r[0], r[1]) for r in ratios[8 * k : 8 * k + 8]]) for k in range(50)]
    assert 42 <= sum(each.low <= 2.0 <= each.high for each in told if each and each.low and each.high) <= 50
    unequal = results_with({f"{k}{d}": (float(k),) for k in range(5) for d in "abcd"[: 1 + k % 2]})
    told = unequal.interval("thesis", "one", "value")
    assert told is not None and told.value == unequal.value("thesis", "one", "value") and told.low < told.value


def test_of_many_clusters_the_interval_is_a_bootstrap_and_no_mean_has_another() -> None:
    values = {str(seed): (float(seed % 7), 0.0) for seed in range(24)}
    found = results_with(values, cluster=str).interval("thesis", "one", "value")
    assert found is not None
    assert found == bootstrap_interval(np.array([v[0] for v in values.values()]), np.random.default_rng(0))
    few = {str(seed): (float(seed), 0.0) for seed in range(7)}
    middle = results_with(few, cluster=str, measures={"value": median("value")}).interval("thesis", "one", "value")
    assert middle is not None and (middle.low, middle.high) == (1.0, 5.0)


def test_tries_that_all_came_out_alike_have_an_interval_with_a_width_or_none() -> None:
    values = {str(seed): (1.0,) for seed in range(20)}
    found = results_with(values, cluster=str, measures={"value": share("value")}).interval("thesis", "one", "value")
    assert found is not None
    assert (found.value, found.low, found.high) == pytest.approx((1.0, 20 / (20 + 1.959964**2), 1.0))
    rooms = {f"{room}{draw}": (1.0,) for room in range(6) for draw in "ab"}
    found = results_with(rooms, measures={"value": share("value")}).interval("thesis", "one", "value")
    assert found is not None and (found.low, found.high) == pytest.approx((6 / (6 + 1.959964**2), 1.0)), "of six rooms"
    assert results_with(rooms).interval("thesis", "one", "value") is None, "a mean"


def test_every_experiment_is_found_by_its_place_and_says_what_it_shows() -> None:
    names = list(experiment_files())
    assert {"graph_supports", "poses", "planning_motion", "disparity"} <= set(names)
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


@pytest.fixture
def published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Publishing goes to this folder, and the code is in a commit."""
    folder = tmp_path / "published"
    folder.mkdir()
    monkeypatch.setattr(command, "PUBLISHED", folder)
    monkeypatch.setattr(command, "changed_code", list)
    return folder


def test_what_is_published_is_whole_and_of_reporting_seeds(tmp_path: Path, published: Path) -> None:
    out = tmp_path / "out"
    for words in (["--quick"], ["--tuning"]):
        with pytest.raises(UsageError, match="nothing is published"):
            run(SMALL, ["small", "--out", str(tmp_path / words[0]), "--publish", *words])
    (published / "small.json").write_text('{"written": "by hand"}')
    assert run(SMALL, ["small", "--out", str(out), "--publish"]) == 0
    made = json.loads((published / "small.json").read_text())
    assert made == json.loads((out / "figures.json").read_text()) and "written" not in made
    assert "reporting" in made["notes"] and "FOLDER" in made["command"] and "--publish" not in made["command"]
    FAILS.add(Trial("ours", "one", "2a"))
    with pytest.raises(UsageError, match="1 trials are missing"):
        run(SMALL, ["small", "--out", str(tmp_path / "other"), "--publish", "--arms", "ours", "--cases", "one"])


def test_records_of_other_code_are_not_published(tmp_path: Path, published: Path) -> None:
    words = ["small", "--out", str(tmp_path / "out")]
    assert run(SMALL, words) == 0
    with pytest.raises(UsageError, match="any code"):
        run(SMALL, [*words, "--publish", "--kept"])
    assert not list(published.iterdir())


def test_figures_of_code_in_no_commit_are_not_published(
    tmp_path: Path, published: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(command, "changed_code", lambda: [" M stages/fuse/stage.py"])
    with pytest.raises(UsageError, match="stages/fuse"):
        run(SMALL, ["small", "--out", str(tmp_path / "out"), "--publish"])
    assert not MEASURED, "said before anything is measured"


def test_code_counts_as_changed_where_git_says_so(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no git checkout"):
        changed_code(tmp_path)
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "figures.json").write_text("{}")
    assert changed_code(tmp_path) == []
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "new.py").write_text("")
    assert changed_code(tmp_path) == ["?? stages/"]
