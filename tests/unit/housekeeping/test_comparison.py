"""`diff`: what is the same, what is not, and why."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.cli.main import run
from scenewright.schemas.errors import BadInput
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.comparison import Change, Figure, compare

from tests.unit.housekeeping.artifacts import make_artifact, make_evaluation, snapshot

FINITE = st.floats(-1e6, 1e6, allow_nan=False)


def two_runs(tmp_path: Path) -> tuple[Path, Path]:
    first, second = tmp_path / "first", tmp_path / "second"
    for root, text, voxel, pq, commit in ((first, "a", 0.02, 0.5, "c1"), (second, "b", 0.04, 0.6, "c2")):
        made = {"git_commit": commit, "seconds": 2.0, "peak_memory_bytes": 2**20}
        make_artifact(root / "up", files={"same.txt": "x", "timings.json": text}, provenance={"started": "1", **made})
        make_artifact(
            root / "map",
            files={"same.txt": "x", "mesh.ply": text, f"only-{text}.txt": text},
            inputs={"sequence": root / "up"},
            parameters={"voxel_size": voxel, "every": 1},
            summary={"entities": 3 if text == "a" else 4},
            key=text,
            provenance={"started": "2", **made},
        )
        make_evaluation(
            root / "evaluation",
            {"map/pq": pq, "map/ap": 0.25, "map/none": None},
            inputs={"panoptic_map": root / "map"},
            provenance={"started": "3", **made},
        )
    make_artifact(first / "zz_old", provenance={"started": "4"})
    return first, second


def test_runs_side_by_side(tmp_path: Path) -> None:
    found = {item.name: item for item in compare(*two_runs(tmp_path))}
    assert list(found) == ["up", "map", "evaluation", "zz_old"]  # as they were made
    assert [item.status for item in found.values()] == ["same", "different", "different", "only in first"]
    assert found["up"].changes == (Change("version", "git_commit", "c1", "c2"),)
    assert found["up"].files.count == 0  # timings are in no digest
    changed = found["map"]
    assert Change("parameter", "voxel_size", 0.02, 0.04) in changed.changes
    assert Change("summary", "entities", 3, 4) in changed.changes
    assert not [change for change in changed.changes if change.group == "input"]  # the same content was read
    assert (changed.files.changed, changed.files.removed, changed.files.added) == (
        ("mesh.ply",),
        ("only-a.txt",),
        ("only-b.txt",),
    )
    assert {figure.name for figure in changed.costs} == {"bytes", "seconds", "peak_memory_bytes"}
    evaluation = found["evaluation"]
    assert [change.name for change in evaluation.changes if change.group == "input"] == ["panoptic_map"]
    assert [(m.name, m.before, m.after) for m in evaluation.measures] == [("map/pq", 0.5, 0.6)]
    assert evaluation.equal_measures == 2
    assert evaluation.measures[0].relative == pytest.approx(0.2)


def test_a_run_is_the_same_as_itself_and_nothing_is_written(tmp_path: Path) -> None:
    first, _ = two_runs(tmp_path)
    before = snapshot(tmp_path)
    assert all(item.status == "same" and not item.changes for item in compare(first, first))
    assert snapshot(tmp_path) == before


@given(FINITE, FINITE)
def test_swapping_the_runs_turns_the_change(before: float, after: float) -> None:
    there, back = Figure("x", before, after), Figure("x", after, before)
    assert there.change == -back.change
    if there.relative is not None:
        assert there.before + there.relative * abs(there.before) == pytest.approx(after, abs=1e-6)
    else:
        assert abs(before) < 1e-300


def test_what_is_torn_is_named_and_the_rest_compared(tmp_path: Path) -> None:
    first, second = two_runs(tmp_path)
    (second / "map" / MANIFEST_NAME).write_text("{")
    (second / "evaluation" / "metrics.json").write_text("{")
    found = {item.name: item for item in compare(first, second)}
    assert found["map"].status == "unreadable" and "manifest.json" in found["map"].changes[0].after
    assert [change.group for change in found["evaluation"].changes][-1] == "problem"
    assert found["up"].status == "same"


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = two_runs(tmp_path)
    assert run(["diff", str(first), str(second)]) == 0
    text = capsys.readouterr().out
    assert "everywhere: version git_commit: c1 -> c2" in text and text.count("git_commit") == 1
    assert "parameter voxel_size: 0.02 -> 0.04" in text
    assert "measure map/pq: 0.5 -> 0.6  (+0.1, +20.0 %)" in text
    assert run(["diff", str(first), str(second), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["counts"] == {"different": 2, "only in first": 1, "same": 1}
    assert run(["diff", str(first / "map"), str(second / "map")]) == 0
    assert "only-b.txt" in capsys.readouterr().out


@pytest.mark.parametrize("pair", [("first", "nowhere"), ("first", "first/map"), ("first", "empty")])
def test_what_cannot_be_compared_is_bad_input(tmp_path: Path, pair: tuple[str, str]) -> None:
    two_runs(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput):
        compare(tmp_path / pair[0], tmp_path / pair[1])
