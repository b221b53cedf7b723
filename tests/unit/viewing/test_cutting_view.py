"""What the viewer shows of cutting: the artifacts that are kept for good."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.cli.viewing.view import view_artifact

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "v1"
EXPECTED = {
    "cutting_demonstrations": {"/demonstrations", "/world/sheet"},
    "cutting_model": {"/grammar"},
    "cutting_plan": {"/plan", "/world/fragments/0", "/world/fragments/2"},
    "cutting_trial": {"/trial", "/world/fragments/0", "/world/fragments/2", "/world/board"},
    "cutting_evaluation": {"/methods"},
}


@pytest.mark.parametrize("kind", EXPECTED)
def test_every_kind_is_drawn(tmp_path: Path, kind: str) -> None:
    pytest.importorskip("rerun", reason="the viewer is an extra: pip install rerun-sdk")
    from rerun.chunk import RrdReader

    view_artifact(GOLDEN / kind, tmp_path / "x.rrd")
    assert EXPECTED[kind] <= {chunk.entity_path for chunk in RrdReader(str(tmp_path / "x.rrd")).stream()}
