"""Reporting seeds: what met them when, and when they are none any more; the figures that stand here keep to it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.command import bench_of, seeds_met
from benchmarks.discovery import load_experiment
from benchmarks.experiment import Trial
from benchmarks.generated_rooms import INDEPENDENT
from benchmarks.reporting_seeds import FILE, UNRECORDED, Method, SeedSet, newest, note_use, read_sets

RESULTS = Path(__file__).resolve().parents[3] / "docs" / "results"
TEXT = """
[[set]]
name = "first"
group = "rooms"
seeds = ["kitchen-1"]

[[set]]
name = "second"
group = "rooms"
seeds = ["kitchen-2", "office-2"]

[[met]]
set = "first"
experiment = "mapping"
method = "unrecorded"
day = 2026-11-22
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "seeds.toml"
    path.write_text(TEXT)
    return path


def test_seeds_that_two_methods_of_an_experiment_have_met_are_tuning_seeds(file: Path) -> None:
    assert newest("rooms", file).kind == "reporting" and newest("rooms", file).first_used is None
    assert read_sets(file)[0].kind == "tuning", "whose code is not known"
    assert note_use("second", "mapping", "aa", file).kind == "reporting"
    before = file.read_text()
    assert note_use("second", "mapping", "aa", file).kind == "reporting" and file.read_text() == before
    assert note_use("second", "scene", "bb", file).kind == "reporting", "another experiment compares other steps"
    assert note_use("second", "mapping", "cc", file).kind == "tuning"
    found = newest("rooms", file)
    assert found.first_used is not None and found.met_first("mapping") == "aa" and found.met_first("house") is None


def test_a_set_of_numbers_may_be_a_range(file: Path) -> None:
    file.write_text(TEXT.replace('["kitchen-2", "office-2"]', '"9..12"'))
    assert newest("rooms", file).seeds == ("9", "10", "11", "12")


def test_uses_name_a_set_and_sets_have_names_of_their_own(file: Path) -> None:
    file.write_text(TEXT.replace('set = "first"', 'set = "third"'))
    with pytest.raises(ValueError, match="no set 'third'"):
        read_sets(file)
    file.write_text(TEXT.replace('name = "second"', 'name = "first"'))
    with pytest.raises(ValueError, match="two sets"):
        read_sets(file)


def test_the_digest_of_a_method_changes_with_its_settings() -> None:
    one = Method(("graph",), {"ours": {"candidates": 1}})
    assert one.digest() == one.digest() and len(one.digest()) == 16
    assert replace(one, settings={"ours": {"candidates": 2}}).digest() != one.digest()


def test_a_run_records_what_it_measures_before_it_measures(file: Path, tmp_path: Path, capsys) -> None:
    experiment = replace(
        load_experiment("mapping"), seed_group="rooms", method=Method((), {}), cluster=lambda seed: seed.split("+")[0]
    )
    bench = bench_of(experiment, {"out": tmp_path})
    trials = [Trial("ours", "lasting", "office-2+0")]
    met = seeds_met(experiment, bench, trials, kept=False, file=file)
    assert (met["set"], met["kind"]) == ("second", "reporting") and met["method"] == Method((), {}).digest()
    assert seeds_met(experiment, bench, [Trial("ours", "lasting", "office-40")], kept=False, file=file) == {}
    assert seeds_met(experiment, replace(bench, quick=True), trials, kept=False, file=file) == {}
    assert seeds_met(experiment, replace(bench, tuning=True), trials, kept=False, file=file) == {}
    other = replace(experiment, method=Method((), {"ours": 1}))
    assert seeds_met(other, bench, trials, kept=False, file=file)["kind"] == "tuning"
    assert "tuning seeds from now on" in capsys.readouterr().err
    assert seeds_met(other, bench, trials, kept=True, file=file)["method"] == Method((), {"ours": 1}).digest()


def test_published_figures_are_of_the_first_method_that_met_their_seeds() -> None:
    """A method that was changed after figures of a set were seen may not be reported on it."""
    sets = {found.name: found for found in read_sets()}
    for path in sorted(RESULTS.glob("*.json")):
        told = json.loads(path.read_text(encoding="utf-8"))
        if met := told.get("seeds"):
            found: SeedSet = sets[met["set"]]
            experiment = met.get("experiment", told["experiment"])  # some publish a part under a name of its own
            assert met["method"] == found.met_first(experiment), f"{path.name}: draw new seeds in {FILE.name}"
            assert found.kind == "reporting" and met["method"] != UNRECORDED, f"{path.name}: {found.name} is tuned on"
            assert met["first_used"] == str(found.first_used)


def test_sets_of_one_group_share_no_seed_and_leave_out_the_tuning_seeds() -> None:
    sets = read_sets()
    for group in {found.group for found in sets}:
        seeds = [seed for found in sets if found.group == group for seed in found.seeds]
        assert len(seeds) == len(set(seeds)), group
    of_group = set(newest("rooms").seeds)
    for name, missing in (("mapping", set(INDEPENDENT)), ("scene", set())):
        experiment = load_experiment(name)
        assert experiment.method is not None and experiment.seed_group == "rooms"
        rooms = {experiment.cluster(seed) for seed in experiment.reporting}
        assert rooms == of_group - missing and not rooms & set(experiment.tuning)
