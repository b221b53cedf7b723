"""Migrations: a kind of our own at version 3, with artifacts of versions 1 and 2 on disk."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import pytest
import scenewright.schemas.artifact as artifact_module
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.schemas.migrations import MIGRATIONS, migration
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.engine.migration import migrate
from scenewright.stages.engine.reading import open_artifact
from scenewright.stages.engine.verification import verify


class Third(Model):
    """Version 3 of the payload."""

    length_metres: float
    name: str


@pytest.fixture
def kind() -> Iterator[type[Artifact]]:
    class Sample(Artifact):
        kind: ClassVar[str] = "test_sample"
        schema_version: ClassVar[int] = 3
        info = Document(Third, "payload.json")

    @migration("test_sample", 1)
    def to_second(old: Path, new: Path) -> None:
        (new / "payload.json").write_text(
            (old / "payload.json").read_text().replace('"length_mm": 1500', '"length_metres": 1.5')
        )

    @migration("test_sample", 2)
    def to_third(old: Path, new: Path) -> None:
        (new / "payload.json").write_text((old / "payload.json").read_text().replace("}", ', "name": "unknown"}'))

    yield Sample
    for table, keys in (
        (artifact_module.KINDS, ["test_sample"]),
        (MIGRATIONS, [("test_sample", 1), ("test_sample", 2)]),
    ):
        for key in keys:
            table.pop(key)


def write(root: Path, version: int, payload: str) -> Path:
    root.mkdir()
    (root / "payload.json").write_text(payload)
    records = record_files(root, ())
    Manifest(
        kind="test_sample",
        schema_version=version,
        stage="sample",
        key="k",
        content_digest=content_digest(records),
        files=records,
    ).write(root / MANIFEST_NAME)
    return root


def test_all_hops_into_a_new_folder(tmp_path: Path, kind: type[Artifact]) -> None:
    old = write(tmp_path / "old", 1, '{"length_mm": 1500}')
    with pytest.raises(BadInput) as caught:
        open_artifact(old)
    assert f"scenewright migrate {old} --out {old}-v3" in str(caught.value)
    manifest = migrate(old, tmp_path / "new")
    assert manifest.schema_version == 3
    assert Third.read(tmp_path / "new" / "payload.json") == Third(length_metres=1.5, name="unknown")
    assert verify(tmp_path / "new")[0].problems == ()
    assert open_artifact(tmp_path / "new", kind).manifest is not None
    assert '"length_mm"' in (old / "payload.json").read_text()


def test_what_cannot_be_migrated_is_refused(tmp_path: Path, kind: type[Artifact]) -> None:
    with pytest.raises(UsageError, match="nothing to do"):
        migrate(write(tmp_path / "current", 3, '{"length_metres": 1, "name": "x"}'), tmp_path / "a")
    with pytest.raises(BadInput, match="newer"):
        migrate(write(tmp_path / "newer", 4, "{}"), tmp_path / "b")
    with pytest.raises(BadInput, match="no migration"):
        migrate(write(tmp_path / "ancient", 0, "{}"), tmp_path / "c")
    with pytest.raises(BadInput):  # the payload is not what version 2 says
        migrate(write(tmp_path / "broken", 2, '{"nonsense": 1}'), tmp_path / "d")
    assert not [name for name in "abcd" if (tmp_path / name).exists()]
