"""The summaries say what happened: explained outcomes apart from crashes, reasons counted, figures by parameter set."""

from __future__ import annotations

import csv
import io
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from scenewright.stages.engine.batch.summary import (
    cost_table,
    count_table,
    group_table,
    reason_table,
    without_particulars,
)
from scenewright.stages.engine.batch.summary_files import summary_texts, write_summary

from tests.unit.batch.batches import job, result

JOBS = [job(name) for name in ("a", "b", "c", "d", "e", "f")]
LATEST = {
    "a": result("a", measures={"evaluation/map/pq": 0.5}, outcomes={"plan": "infeasible"}),
    "b": result("b", "bad input", reason="/data/b/log.mcap: 3 of 120 frames", failed_step="sequence"),
    "c": result("c", "bad input", reason="/data/c/log.mcap: 7 of 90 frames", failed_step="sequence"),
    "d": result("d", "crash", reason="died of <SIGSEGV> | & co", failed_step="cad", exit_code=139),
    "e": result("e", "time limit", reason="ran longer than 20.0 s"),
}


def test_counts_and_reasons() -> None:
    counts = {row[1]: (row[0], row[2]) for row in count_table(JOBS, LATEST).rows}
    assert counts == {
        "done": ("done", 1),
        "bad input": ("explained", 2),
        "time limit": ("explained", 1),
        "crash": ("crashed", 1),
        "not run": ("", 1),
    }
    rows = reason_table(JOBS, LATEST).rows
    assert [row[:4] for row in rows] == [
        ("crashed", "crash", "cad", 1),
        ("explained", "bad input", "sequence", 2),
        ("explained", "time limit", "", 1),
    ]
    assert rows[1][4:] == ("/data/b/log.mcap: 3 of 120 frames", "b")
    assert without_particulars("/a/b c.txt: 3.5 of 12") == "PATH c.txt: # of #"


def test_seeds_of_a_scene_are_no_independent_scenes() -> None:
    values = {("x", 1): 0.0, ("x", 2): 1.0, ("y", 1): 0.9, ("y", 2): 1.1, ("z", 1): 2.0}
    jobs = [job(f"{s}-{n}", scene=s, parameters="fine", seed=n) for s, n in values]
    jobs += [job("w", scene="w", parameters="fine")]
    latest = {f"{s}-{n}": result(f"{s}-{n}", measures={"m": value}) for (s, n), value in values.items()}
    latest["w"] = result("w", "crash", measures={"m": 100.0})
    (row,) = group_table(jobs, latest).rows
    name, parameters, mean, low, high, median, scenes, of, runs = row
    assert (name, parameters, scenes, of, runs) == ("m", "fine", 3, 4, 5)
    assert mean == pytest.approx(np.mean([0.5, 1.0, 2.0])) and median == pytest.approx(1.0)
    assert 0.5 <= low <= mean <= high <= 2.0
    assert group_table(jobs, latest) == group_table(jobs, latest), "the same figures each time"
    (alone,) = group_table(jobs[:1], latest).rows
    assert alone[3:5] == (None, None), "one scene has no interval"


def test_what_scenes_cost() -> None:
    jobs = [job(name, parameters="fine") for name in "abcd"]
    took = {"processor_seconds": 30.0, "artifact_bytes": 2_000_000, "peak_memory_bytes": 10**9}
    latest = {
        "a": result("a", **took),
        "b": result("b", **{**took, "processor_seconds": 60.0, "artifact_bytes": 4_000_000}),
        "c": result("c", "crash", **took),
        "d": result("d", attempts=2, lost=("gone",), **took),
    }
    (row,) = cost_table(jobs, latest).rows
    assert row == ("fine", 2, 45.0, 45.0, 60.0, 3.0, 1000.0, pytest.approx(45 * 1e5 / 3600), pytest.approx(0.3))
    assert cost_table(JOBS, LATEST).rows == (), "results of before say nothing of it"


class _Checker(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.links: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list) -> None:
        if tag not in ("meta", "!doctype"):
            self.open.append(tag)
        self.links += [value for name, value in attrs if name in ("href", "src")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def test_the_three_files_say_the_same(tmp_path: Path) -> None:
    write_summary(tmp_path, "Batch rooms: <tiny>", JOBS, LATEST)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["summary.csv", "summary.html", "summary.md"]
    rows = list(csv.DictReader(io.StringIO((tmp_path / "summary.csv").read_text())))
    assert [row["outcome"] for row in rows] == ["done", "bad input", "bad input", "crash", "time limit", "not run"]
    assert rows[0]["evaluation/map/pq"] == "0.5" and rows[3]["reason"] == "died of <SIGSEGV> | & co"
    assert rows[3]["exit_code"] == "139" and rows[5]["exit_code"] == ""
    markdown = (tmp_path / "summary.md").read_text()
    assert "died of <SIGSEGV> \\| & co" in markdown and "infeasible" in markdown and "evaluation/map/pq" in markdown
    page = _Checker()
    page.feed((tmp_path / "summary.html").read_text())
    assert page.open == [] and "died of <SIGSEGV> | & co" in page.text and "Batch rooms: <tiny>" in page.text
    assert page.links == [f"{name}/batch.log" for name in "abcde"], "self-contained: links lead to the logs only"


def test_names_that_are_markup_stay_text() -> None:
    odd = job("<script>x", scene="<script>x")
    page = summary_texts("t", [odd], {odd.name: result("<script>x", "crash", reason="a\nb")})["summary.html"]
    assert "<script>" not in page
