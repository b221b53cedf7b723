"""The board: intervals, records of programs alone, rooms that nobody can have tuned on, figures out of records."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scipy import stats

from benchmarks.board import checking, publishing
from benchmarks.board.figures import Version, others_figures, rooms_figures, value_of, versions_figures
from benchmarks.board.generator.lacking import without_styles
from benchmarks.board.generator.spoil import DepthFaults, drawn_faults
from benchmarks.board.inputs import LADDER, PUBLIC, RUNGS, Rung, error_seed
from benchmarks.board.looks import note_look, read_looks
from benchmarks.board.method import Method
from benchmarks.board.others import SYSTEMS
from benchmarks.board.quick import NOT_RUN, quick_table, quick_units
from benchmarks.board.reconstruct import ARMS
from benchmarks.board.records import Line, Trial, key_of, line_text, read_lines, write_lines
from benchmarks.board.rooms import REFERENCE, REFERENCE_COMMIT, SEALED_RECIPES, sealed_seed
from benchmarks.board.shards import all_shards
from benchmarks.board.statistics import over_rooms, paired
from benchmarks.command import parser_of
from benchmarks.discovery import load_experiment
from benchmarks.tabulation import Figure


def line(room: str = "office-1", arm: str = "ours", part: str = "sealed", **told: object) -> Line:
    values = {
        "trial": Trial(part=part, case="everything", seed=room, arm=arm),
        "key": "0" * 16,
        "commit": "abc",
        "committed": "2026-11-29T00:00:00+00:00",
        "digest": "d" * 16,
        "clean": True,
        "board": "abc",
        "judge": "j" * 16,
        "day": "2026-11-29",
        "figures": {"found": 0.5},
    }
    return Line.model_validate(values | told)


def test_an_interval_over_rooms_is_that_of_students_t() -> None:
    values = np.random.default_rng(3).normal(0.4, 0.1, 8)
    spread = over_rooms(list(values))
    low, high = stats.ttest_1samp(values, 0.0).confidence_interval(0.95)
    assert spread is not None and (spread.low, spread.high) == pytest.approx((low, high))


def test_an_interval_covers_what_it_says() -> None:
    random, covered = np.random.default_rng(5), 0
    for _ in range(400):
        spread = over_rooms(list(random.normal(0.0, 1.0, 6)))
        assert spread is not None and spread.low is not None and spread.high is not None
        covered += spread.low <= 0.0 <= spread.high
    assert 370 <= covered <= 392


def test_few_rooms_have_no_interval_and_none_is_without_width() -> None:
    few, same, alike = over_rooms([0.1, 0.9, 0.5, 0.3]), over_rooms([0.0] * 6, share=True), over_rooms([0.5] * 6)
    assert few is not None and few.low is None and few.rooms == 4
    assert same is not None and same.low == 0.0 and same.high is not None and same.high > 0.3
    assert alike is not None and alike.low is None
    assert over_rooms([]) is None


def test_the_least_difference_is_seen_four_times_of_five() -> None:
    random, seen = np.random.default_rng(7), 0
    least = np.mean([s.least_seen for _ in range(200) if (s := over_rooms(list(random.normal(0, 1, 12)))) is not None])
    for _ in range(400):
        spread = over_rooms(list(random.normal(least, 1, 12)))
        assert spread is not None and spread.low is not None
        seen += spread.low > 0
    assert 0.72 <= seen / 400 <= 0.88


def test_pairs_leave_out_rooms_in_which_one_is_undefined() -> None:
    spread = paired([0.5, None, 0.7], [0.4, 0.2, 0.5])
    assert spread is not None and spread.rooms == 2 and spread.mean == pytest.approx(0.15)


def test_records_come_back_as_they_were_written(tmp_path: Path) -> None:
    lines = [line("room-2"), line("room-1", seconds={"fuse": 3.5}, facts={"failed": "x"})]
    write_lines(tmp_path / "a.jsonl", lines)
    assert read_lines(tmp_path / "a.jsonl") == sorted(lines, key=lambda one: one.trial.seed)


@pytest.mark.parametrize("damage", ['"extra":1,', " ", '"board":"x",'])
def test_a_record_that_no_program_writes_is_refused(tmp_path: Path, damage: str) -> None:
    text = line_text(line())
    (tmp_path / "a.jsonl").write_text(text[:1] + damage + text[1:])
    with pytest.raises(BadInput, match=r"a\.jsonl:1"):
        read_lines(tmp_path / "a.jsonl")


@pytest.mark.parametrize("told", [{"clean": False}, {"commit": "other"}])
def test_a_record_of_no_committed_checkout_is_not_published(tmp_path: Path, told: dict) -> None:
    write_lines(tmp_path / "abc" / "sealed-1.jsonl", [line(**told)])
    with pytest.raises(BadInput, match="not of that commit"):
        publishing.read_versions(tmp_path)


def test_the_reference_beside_a_method_is_of_its_own_commit(tmp_path: Path) -> None:
    beside = line(arm=REFERENCE, commit=f"{REFERENCE_COMMIT}24")
    write_lines(tmp_path / "abc" / "sealed-1.jsonl", [line(), beside])
    assert [len(version.lines) for version in publishing.read_versions(tmp_path)] == [2]
    write_lines(tmp_path / "abc" / "sealed-1.jsonl", [line(arm=REFERENCE)])
    with pytest.raises(BadInput, match="not of that commit"):
        publishing.read_versions(tmp_path)


def test_keys_change_with_method_arm_and_judge() -> None:
    trial = Trial(part="public", case="perfect", seed="office-1", arm="ours")
    keys = {key_of(trial, *told) for told in (("m", "a", "j"), ("n", "a", "j"), ("m", "b", "j"), ("m", "a", "k"))}
    assert len(keys) == 4


def test_whoever_changes_the_method_gets_other_rooms() -> None:
    first, second = ({sealed_seed(digest, k, 0) for k in range(12)} for digest in ("a" * 16, "b" * 16))
    assert len(first) == len(second) == len(SEALED_RECIPES) and not first & second
    assert sealed_seed("a", 3, 0) == sealed_seed("a", 3, 0) != sealed_seed("a", 3, 1)


def test_the_digest_of_a_method_leaves_out_the_generator(monkeypatch: pytest.MonkeyPatch) -> None:
    method = Method()
    assert len(method.digest) == 16
    monkeypatch.setattr("benchmarks.board.method.STEPS", ("segment",))
    assert Method().digest != method.digest


def test_each_rung_takes_away_one_more_thing() -> None:
    given = [vars(rung) | {"title": ""} for rung in RUNGS.values()]
    for lower, upper in zip(given[1:], given[2:], strict=False):
        assert [name for name in lower if lower[name] != upper[name]] in (
            ["bent"],
            ["estimated"],
            ["lacking"],
            ["rescaled"],
        )
    assert Rung("").recording == "plain" and set(LADDER) < set(PUBLIC) and len(set(PUBLIC)) == 16


def test_every_unit_is_in_one_shard() -> None:
    units = [(unit.part, unit.name) for shard in all_shards().values() for unit in shard]
    assert len(units) == len(set(units))
    assert {name for part, name in units if part == "public"} == set(PUBLIC)


def test_arms_differ_by_what_their_file_says() -> None:
    assert not any((ARMS["ours"].segment, ARMS["ours"].fuse, ARMS["ours"].graph, ARMS["ours"].cad))
    assert ARMS["thesis"].graph == ("--method", "thesis")


def test_looks_are_written_before_and_counted(tmp_path: Path) -> None:
    first, again = note_look("d" * 16, "abc", tmp_path), note_look("d" * 16, "abc", tmp_path)
    note_look("e" * 16, "abc", tmp_path)
    assert first == again and [look.digest[0] for look in read_looks(tmp_path)] == ["d", "e"]
    first.write_text('{"digest": 3}')
    with pytest.raises(BadInput, match="looks are written"):
        read_looks(tmp_path)


def test_a_bent_plane_and_a_shifted_picture() -> None:
    camera = SimpleNamespace(width=64, height=48, cx=31.5, cy=23.5)
    depth = np.full((48, 64), 2.0, np.float32)
    depth[0, 0] = 0.0
    bent = DepthFaults(0.01, 0.01, (0.0, 0.0)).depth(depth, camera)
    assert bent[0, 0] == 0.0 and bent[24, 32] == pytest.approx(2.02, abs=1e-3)
    assert bent[47, 63] == pytest.approx(1.01 / (0.5 - 0.01), abs=1e-3)
    moved = DepthFaults(0.0, 0.0, (-20.0, 10.0)).shifted(np.ones((48, 64), np.uint8))
    assert moved[:1].sum() == 0 and moved[:, -2:].sum() == 0 and moved[1:, :-2].all()
    assert drawn_faults(error_seed("office-1")) == drawn_faults(error_seed("office-1")) != drawn_faults(7)


def test_a_library_lacks_the_styles_of_the_room_where_it_has_others() -> None:
    def model(class_name: str, style: str | None) -> dict:
        return {"class_name": class_name, "recipe": {} if style is None else {"style": style}}

    library = [model("chair", "a"), model("chair", "b"), model("lamp", "a"), model("cup", None)]
    kept = without_styles(library, [model("chair", "a"), model("lamp", "a"), model("cup", None)])
    assert kept == [model("chair", "b"), model("lamp", "a"), model("cup", None)]


def test_an_arm_without_a_scene_has_found_nothing() -> None:
    failed = line(figures={"failed": 1.0})
    assert value_of(failed, "functional") == 0.0 and value_of(failed, "at_rest_of_true") == 0.0
    assert value_of(failed, "functional_of_found") is None and value_of(failed, "edit_distance") is None


def test_figures_are_means_over_rooms_and_differences_are_paired() -> None:
    rooms = [f"room-{k}" for k in range(6)]
    ours = [line(room, figures={"found": 0.5 + 0.01 * k}) for k, room in enumerate(rooms)]
    thesis = [line(room, "thesis", figures={"found": 0.3 + 0.01 * k}) for k, room in enumerate(rooms)]
    figures = rooms_figures([*ours, *thesis])
    assert figures["ours/sealed/everything/found"].value == pytest.approx(0.525)
    less = figures["ours less thesis/sealed/everything/found"]
    assert less.value == pytest.approx(0.2) and less.cases == 6


def test_other_systems_keep_the_intervals_of_their_experiments() -> None:
    told = {"success": 0.5, "success low": 0.4, "success high": 0.6, "success cases": 40.0, "calls": 3.0}
    robot = line().model_copy(
        update={"trial": Trial(part="others", case="told robot", seed="mixed", arm="ours"), "figures": told}
    )
    assert others_figures([robot, line()]) == {"ours/others/told robot/success": Figure(0.5, 0.4, 0.6, 40, "")}
    assert not rooms_figures([robot])


def test_every_system_names_an_arm_case_and_figure_that_its_experiment_has() -> None:
    for name, system in SYSTEMS.items():
        experiment = load_experiment(system.experiment)
        asked = parser_of(experiment).parse_args(["--out", "x", "--quick", *system.options])
        assert set(asked.arms) <= set(experiment.arms) and set(asked.cases) <= set(experiment.cases), name


def test_versions_are_paired_with_the_first() -> None:
    versions = [
        Version(name, [line(f"room-{k}", part="public", figures={"found": base + 0.05 * k}) for k in range(5)])
        for name, base in (("old", 0.2), ("new", 0.3))
    ]
    figures = versions_figures(versions)
    assert figures["new less old/versions/public/everything/found"].value == pytest.approx(0.1)
    assert figures["old/versions/public/everything/found"].value == pytest.approx(0.3)


def test_a_trial_is_drawn_by_the_commit_and_every_digit_counts() -> None:
    def record(room: str, value: float = 0.5) -> Line:
        trial = Trial(part="public", case=checking.CHEAPEST, seed=room, arm="ours")
        return line().model_copy(update={"trial": trial, "figures": {"found": value}})

    lines = [record(f"room-{k}") for k in range(3)]
    assert checking.drawn([line(), *lines], "0a") is lines[10 % 3] and checking.drawn([line()], "0a") is None
    assert not checking.differing(lines[0], lines[1])
    assert checking.differing(lines[0], record("room-0", 0.500001)) == ["found: 0.5 in the record, 0.500001 now"]


def test_a_quick_run_says_what_it_did_not_run() -> None:
    measured = [line(LADDER[2], part="public", figures={"things_large": 4.0, "found_count_large": 3.0})]
    text = quick_table(measured)
    assert "of ten large things 7.5 are found" in text and text.count(NOT_RUN) > 10
    units = {(unit.part, unit.name.split()[0]) for unit in quick_units()}
    assert ("public", LADDER[2]) in units and not any(part == "sealed" for part, _ in units)


def test_the_published_file_is_what_the_records_say() -> None:
    versions = publishing.read_versions()
    if not versions:
        pytest.skip("nothing is measured yet")
    content = publishing.published(versions, read_looks())
    assert publishing.PUBLISHED.read_text(encoding="utf-8") == publishing.text_of(content)
    assert json.loads(publishing.text_of(content))["experiment"] == "board"


def test_a_part_shows_the_newest_version_that_measured_it() -> None:
    def version(commit: str, *parts: str) -> Version:
        lines = [
            line().model_copy(update={"trial": Trial(part=part, case="errors", seed="a", arm="ours")}) for part in parts
        ]
        return Version(commit, lines)

    versions = [version("0a", "public", "sealed"), version("0b", "public"), version("0c", "real")]
    assert publishing.newest_of_parts(versions) == {"public": "0b", "sealed": "0a", "real": "0c"}
