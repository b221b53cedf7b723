"""What runs again."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from scenewright.stages.engine.batch.resuming import missing_jobs, reason_to_run
from scenewright.stages.engine.reading import read_manifest

from tests.unit.batch.batches import job, result


@pytest.mark.parametrize(
    ("outcome", "failed", "none", "every"),
    [
        ("done", False, False, True),
        ("crash", True, False, True),
        ("not ok", True, False, True),
        ("interrupted", True, True, True),
    ],
)
def test_retry(outcome: str, failed: bool, none: bool, every: bool) -> None:
    one, before = job("a"), result("a", outcome)
    runs = [reason_to_run(one, before, retry) is not None for retry in ("failed", "none", "all")]
    assert runs == [failed, none, every]
    assert all(reason_to_run(one, None, retry) for retry in ("failed", "none", "all"))


def test_a_changed_scene_runs_again_whatever_came_of_it() -> None:
    changed = job("a", fingerprint="other")
    assert "changed" in (reason_to_run(changed, result("a"), "none") or "")
    assert missing_jobs([changed, job("b")], {"a": result("a"), "b": result("b")}, "failed") == {
        "a": "its values, pipeline or inputs have changed"
    }


def test_the_last_artifact_has_to_be_whole_and_the_same(tmp_path: Path) -> None:
    golden = Path(__file__).resolve().parents[2] / "golden" / "v1" / "plan"
    shutil.copytree(golden, tmp_path / "sequence")
    digest = read_manifest(tmp_path / "sequence").content_digest
    one, before = job("a", folder=str(tmp_path)), result("a", artifacts={"sequence": digest})
    assert reason_to_run(one, before, "failed") is None
    assert reason_to_run(one, result("a", artifacts={"sequence": "0" * 64}), "failed")
    payload = next(path for path in (tmp_path / "sequence").iterdir() if path.name != "manifest.json")
    payload.write_bytes(payload.read_bytes() + b"x")
    assert "sequence is gone or has changed" in (reason_to_run(one, before, "failed") or "")
    shutil.rmtree(tmp_path / "sequence")
    assert reason_to_run(one, before, "failed")
