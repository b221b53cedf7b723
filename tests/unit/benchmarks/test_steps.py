"""Running the product's steps from an experiment."""

from __future__ import annotations

import shutil
from pathlib import Path

from scenewright.schemas.sequence import Sequence
from scenewright.stages.engine.reading import read_manifest

from benchmarks.steps import opened


def test_artifacts_of_older_versions_are_opened(tmp_path: Path) -> None:
    older = tmp_path / "sequence"
    shutil.copytree(Path(__file__).parents[2] / "golden" / "v2" / "sequence", older)
    sequence = opened(Sequence, older)
    assert read_manifest(sequence.root).schema_version == Sequence.schema_version
    assert opened(Sequence, older).root == sequence.root
    assert read_manifest(older).schema_version == 2
