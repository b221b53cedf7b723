"""Artifacts of every past schema version stay readable, or migrate: tiny ones are kept here for good."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.schemas.kinds import KINDS
from scenewright.stages.engine.migration import migrate
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.engine.verification import verify

FOLDER = Path(__file__).resolve().parent
GOLDEN = sorted(path.parent for path in FOLDER.glob("v*/*/manifest.json"))


@pytest.mark.parametrize("root", GOLDEN, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_golden_artifacts_are_sound_and_readable(root: Path, tmp_path: Path) -> None:
    version = int(root.parent.name.removeprefix("v"))
    kind = KINDS[root.name]
    if version < kind.schema_version:
        migrate(root, tmp_path / "current")
        root = tmp_path / "current"
    for finding in verify(root):
        assert finding.problems == ()
    artifact = open_artifact(root, kind)
    optional = {name: model for name, model in kind.optional_json_files.items() if artifact.path(name).exists()}
    for name, model in (kind.json_files | optional).items():
        parsed = model.read(artifact.path(name))
        parsed.write(tmp_path / "again.json")
        assert model.read(tmp_path / "again.json") == parsed


def test_every_kind_that_a_step_makes_has_one_of_every_version() -> None:
    expected = {
        (f"v{version}", name)
        for name, kind in KINDS.items()
        if not name.startswith("test_")
        for version in range(1, kind.schema_version + 1)
    }
    assert expected <= {(root.parent.name, root.name) for root in GOLDEN}
