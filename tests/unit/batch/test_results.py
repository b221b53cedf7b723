"""results.jsonl: whole lines only, whatever moment a kill comes at."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenewright.schemas.base import LARGEST_NUMBER
from scenewright.schemas.errors import BadInput, MachineFailure
from scenewright.stages.engine.batch.results import ResultsFile, SceneResult, latest_by_job, parse_line, read_results

from tests.unit.batch.batches import result


def test_a_line_torn_anywhere_is_left_out_and_repaired(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    first, second = result("a").as_line(), result("bü", "crash", reason="x" * 300).as_line()
    for cut in range(0, len(second), 5):
        path.write_bytes(first + second[:cut])
        assert [r.job for r in read_results(path)] == ["a"]
        with ResultsFile(path) as results:
            assert results.repaired == cut
            results.append(result("c"))
        assert [r.job for r in read_results(path)] == ["a", "c"]
        assert path.read_bytes() == first + result("c").as_line()
    path.write_bytes(second[:40])
    with ResultsFile(path) as results:
        assert results.repaired == 40 and path.read_bytes() == b""


def test_a_long_torn_line_is_cut_off_too(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    path.write_bytes(result("a").as_line() + b"x" * 200_000)
    with ResultsFile(path) as results:
        assert results.repaired == 200_000
    assert [r.job for r in read_results(path)] == ["a"]


def test_damage_elsewhere_is_named(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    path.write_bytes(result("a").as_line() + b"garbage\n" + result("b").as_line())
    with pytest.raises(BadInput, match="results.jsonl, line 2"):
        read_results(path)


def test_the_last_result_of_a_scene_counts() -> None:
    assert latest_by_job([result("a", "crash"), result("b"), result("a")])["a"].outcome == "done"


def test_a_full_disk_is_one_line_and_leaves_whole_lines(tmp_path: Path) -> None:
    with pytest.raises(MachineFailure):
        ResultsFile(Path("/proc/nowhere/results.jsonl"))
    path = tmp_path / "results.jsonl"
    path.symlink_to("/dev/full")
    with pytest.raises(MachineFailure), ResultsFile(path) as results:
        results.append(result("a"))


@given(st.binary(max_size=200))
def test_any_line_is_a_result_or_bad_input(line: bytes) -> None:
    try:
        parse_line(line, "line 1")
    except BadInput as error:
        assert str(error).startswith("line 1")


@given(st.text(max_size=50), st.dictionaries(st.text(max_size=8), st.floats(-LARGEST_NUMBER, LARGEST_NUMBER)))
def test_results_survive_the_round_trip(reason: str, measures: dict[str, float]) -> None:
    one = result("a", "crash", reason=reason, measures=measures)
    line = one.as_line()
    assert line.count(b"\n") == 1 and SceneResult.model_validate_json(line) == one
