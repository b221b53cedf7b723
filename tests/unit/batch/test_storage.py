"""Artifacts of scenes in storage behind fsspec: whole or not there, found again by the next batch, never waited for
without end."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from fsspec import register_implementation
from fsspec.implementations.memory import MemoryFileSystem
from scenewright.schemas.errors import MachineFailure, UsageError
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.batch.session import run_batch
from scenewright.stages.engine.batch.storage import check_storage, send, stored_digest

from tests.unit.batch.batches import batch_of, program_command


class LateFileSystem(MemoryFileSystem):
    """Answers after a minute."""

    protocol = "late"
    cachable = False

    def _late(self, *_: Any, **__: Any) -> Any:
        time.sleep(60)

    makedirs = cat_file = put_file = pipe_file = _late


register_implementation("late", LateFileSystem, clobber=True)


def stored_in(url: str, keep: bool = False) -> str:
    return f'[storage]\nurl = "{url}"\nkeep = {"true" if keep else "false"}\n'


def test_artifacts_go_to_the_storage_and_are_found_there(tmp_path: Path) -> None:
    store, out = tmp_path / "store", tmp_path / "out"
    batch = batch_of(tmp_path, {"a": "write", "b": "exit 3"}, stored_in(f"file://{store}"))
    end = run_batch(batch, out, command=program_command)
    assert end.counts() == {"done": 1, "bad input": 1}
    assert (store / "a" / "sequence" / "data.txt").is_file() and not (out / "a" / "sequence").exists()
    assert (out / "a" / "batch.log").is_file() and not (store / "b").exists()
    assert [result.job for result in run_batch(batch, out, retry="none", command=program_command).ran] == []
    (store / "a" / "sequence" / "data.txt").write_text("torn")
    again = run_batch(batch, out, command=program_command).ran
    assert {result.job for result in again} == {"a", "b"}, "what is not whole there is made again"
    assert (store / "a" / "sequence" / "data.txt").read_text() != "torn"


def test_the_manifest_comes_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    batch = batch_of(tmp_path, {"a": "write"})
    run_batch(batch, tmp_path / "out", command=program_command)
    url, folder = "memory://last/a", tmp_path / "out" / "a"
    whole = MemoryFileSystem.put_file

    def full(self: Any, source: str, target: str, **options: Any) -> None:
        if target.endswith(MANIFEST_NAME):
            raise OSError(28, "No space left on device")
        whole(self, source, target, **options)

    monkeypatch.setattr(MemoryFileSystem, "put_file", full)
    with pytest.raises(MachineFailure, match="No space left"):
        send(folder, ["sequence"], url, 10.0)
    assert MemoryFileSystem().exists("/last/a/sequence/data.txt") and stored_digest(url, "sequence", 10.0) is None
    monkeypatch.setattr(MemoryFileSystem, "put_file", whole)
    send(folder, ["sequence"], url, 10.0)
    assert stored_digest(url, "sequence", 10.0) is not None


def test_a_storage_that_is_not_there_stops_the_batch_before_its_first_scene(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    for url, error in (
        (f"file://{tmp_path}/file/rooms", MachineFailure),
        ("nonsense://rooms", UsageError),
        ("late://rooms", MachineFailure),
    ):
        began = time.monotonic()
        with pytest.raises(error, match=url.replace("/", "/")):
            check_storage(url, 0.5)
        assert time.monotonic() - began < 30
    batch = batch_of(tmp_path, {"a": "write"}, stored_in(f"file://{tmp_path}/file/rooms"))
    with pytest.raises(MachineFailure):
        run_batch(batch, tmp_path / "out", command=program_command)
    assert not (tmp_path / "out" / "a").exists()


def test_a_storage_that_goes_away_costs_no_artifact(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, out = tmp_path / "store", tmp_path / "out"
    batch = batch_of(tmp_path, {"a": "write"}, stored_in(f"file://{store}"))
    monkeypatch.setattr(
        "scenewright.stages.engine.batch.session.check_storage", lambda url, timeout: store.write_text("no folder")
    )
    (result,) = run_batch(batch, out, command=program_command).ran
    assert result.outcome == "machine failure" and str(store) in result.reason and result.exit_code == 6
    assert (out / "a" / "sequence" / "data.txt").is_file()
    store.unlink()
    monkeypatch.undo()
    assert [result.outcome for result in run_batch(batch, out, command=program_command).ran] == ["done"]
