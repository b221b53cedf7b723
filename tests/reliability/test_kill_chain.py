"""The harness that interrupts steps, and the whole experiment (slow)."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.stages.engine.runner import run_stage

from tests.contract.probe_step import PROBE, ProbeParameters
from tests.reliability.kill_chain import (
    SIGNALS,
    SLOW,
    STEPS,
    digest_on_disk,
    older_version,
    phase_of,
    plan_of,
    run_experiment,
    state_on_disk,
    table_of,
)


def test_the_plan_covers_every_step_signal_and_phase() -> None:
    plan = plan_of(200, 1, STEPS)
    assert len(plan) == 200 and plan == plan_of(200, 1, STEPS) != plan_of(200, 2, STEPS)
    counts = {step: sum(entry[0] == step for entry in plan) for step in STEPS}
    assert min(counts.values()) >= 8 and all(counts[step] < counts["sequence"] for step in SLOW)
    for step in STEPS:
        own = [entry for entry in plan if entry[0] == step]
        assert {entry[2] for entry in own} == set(SIGNALS), step
        assert any(entry[1] > 1 for entry in own) and any(entry[1] < 1 for entry in own), step
        assert {entry[3] for entry in own} == {True, False}, step


def test_the_harness_tells_what_lies_on_the_disk(tmp_path: Path) -> None:
    """A harness that could not see damage would find none."""
    run_stage(PROBE, {}, tmp_path / "clean", ProbeParameters())
    clean = Manifest.read(tmp_path / "clean" / MANIFEST_NAME).content_digest
    out = tmp_path / "work" / "a"
    out.parent.mkdir()
    assert state_on_disk(out, clean, None) == ("nothing", "") and phase_of(out, None) == "before work"
    older = older_version(tmp_path / "clean", out)
    assert older != clean and state_on_disk(out, clean, older) == ("previous", "")
    kept = tmp_path / "kept.json"
    kept.write_bytes((out / MANIFEST_NAME).read_bytes())
    assert phase_of(out, kept) == "before work"
    partial = out.parent / ".a.partial-1-01234567"
    partial.mkdir()
    assert phase_of(out, kept) == "during work" and state_on_disk(out, clean, older) == ("previous", "partial")
    (partial / "timings.json").write_text("{}")
    assert phase_of(out, kept) == "committing"
    partial.joinpath("timings.json").unlink()
    partial.rmdir()
    run_stage(PROBE, {}, out, ProbeParameters())
    assert phase_of(out, kept) == "after" and state_on_disk(out, clean, older) == ("new", "")
    (out / "file-0.txt").write_text("z" * (out / "file-0.txt").stat().st_size)
    assert digest_on_disk(out) == "damaged" and state_on_disk(out, clean, older)[0] == "damaged"


@pytest.mark.slow
def test_twenty_interruptions(tmp_path: Path) -> None:
    trials = run_experiment(20, 1, tmp_path)
    assert [trial for trial in trials if trial.problems] == []
    assert "| all |" in table_of(trials)
