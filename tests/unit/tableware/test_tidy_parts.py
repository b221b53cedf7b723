"""The parts of `make tidy` are gathered; trials that were seen are counted by whose fault they failed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.gather import gather
from benchmarks.tidy.records import Run
from benchmarks.tidy.seen import SeenRun, metrics, read_seen, table
from benchmarks.tidy.tables import table as fast_table
from schemas.errors import BadInput


def test_parts_are_gathered_and_must_agree(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no part"):
        gather("tidy", tmp_path)
    for part, figures in (("fast", {"a/time": 1.0}), ("seen", {"b/time": 2.0})):
        (tmp_path / part).mkdir()
        (tmp_path / part / "metrics.json").write_text(json.dumps(figures))
        (tmp_path / part / "table.md").write_text(f"# {part}\n")
    assert gather("tidy", tmp_path) == ({"a/time": 1.0, "b/time": 2.0}, "# fast\n\n# seen\n")
    (tmp_path / "seen" / "metrics.json").write_text('{"a/time": 2.0}')
    with pytest.raises(BadInput, match="a/time is 2.0 here and 1.0"):
        gather("tidy", tmp_path)


def test_failures_are_counted_by_whose_fault_they_are(tmp_path: Path) -> None:
    runs = [
        SeenRun(arm="pull", case="tier1/fast/seen", seed=seed, time=90.0, objects_per_trip=2.0, dropped=0, left=0,
                failure=failure, images=9)
        for seed, failure in enumerate(("", "perception", "policy", ""))
    ]  # fmt: skip
    log = tmp_path / "runs.jsonl"
    log.write_text("".join(run.model_dump_json() + "\n" for run in runs) + '{"arm": "pu')
    assert read_seen(log) == runs and log.read_text().endswith("}\n")
    figures = metrics(runs)
    at = "pull/tier1/fast/seen"
    assert figures[f"{at}/failure_rate"] == 0.5 and figures[f"{at}/trials"] == 4.0
    assert figures[f"{at}/failures_perception"] == figures[f"{at}/failures_policy"] == 1.0
    assert "| tier1 | `pull` | 4 | 90.0 [90.0, 90.0] | 2.00 | 1 | 1 | 9.0 |" in table(runs)


def test_the_fast_table_holds_the_thesis_beside_ours() -> None:
    runs = [
        Run(arm=arm, case=case, seed=seed, draws=4, time=time, time_first=time, objects_per_trip=2.0, trips=6.0,
            pulls=0.0, stacks=0.0, failed=0.25, failed_first=False)
        for arm, time in (("random", 120.0), ("stack", 110.0), ("pull", 100.0), ("ours", 90.0))
        for case in ("tier1/fast", "tier1/fast/delay3", "tier1/fast/delay5")
        for seed in (0, 1)
    ]  # fmt: skip
    text = fast_table(runs)
    assert "| tier1 | 120.0 [120.0, 120.0] / 2.00 / 25.0 % |" in text and "111.3 / 2.0 / 2 of 3" in text
    assert "| tier1 | 5 s | 120.0 (1.00) | 110.0 (1.09) | 100.0 (1.20) | 90.0 (1.33) |" in text
    assert "| tier1 | `ours` | 100.0 % | 100.0 % | - | - | 10.0 % | 10.0 % |" in text
