"""Artifacts in S3, as a server in this process speaks it: what the tests of folders and memory hold, over HTTP."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from scenewright.schemas.errors import MachineFailure
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.batch.session import run_batch
from scenewright.stages.engine.batch.storage import check_storage, send, stored_digest

from tests.unit.batch.batches import batch_of, program_command

BUCKET = "rooms"


@pytest.fixture
def s3(monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """A server with one bucket, and the environment that a worker finds it by."""
    s3fs = pytest.importorskip("s3fs", reason="needs the extra 'storage'")
    server = pytest.importorskip("moto.server", reason="needs moto").ThreadedMotoServer(port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    settings = {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "key",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    files = s3fs.S3FileSystem(use_listings_cache=False)
    if not files.exists(BUCKET):  # what such servers keep outlives them, in this process
        files.mkdir(BUCKET)
    yield files
    server.stop()
    s3fs.S3FileSystem.clear_instance_cache()


def test_a_batch_keeps_its_artifacts_in_s3_and_finds_them_again(tmp_path: Path, s3) -> None:
    out = tmp_path / "out"
    batch = batch_of(
        tmp_path, {"a": "write", "b": "exit 3"}, f'[storage]\nurl = "s3://{BUCKET}/kitchens"\nkeep = false\n'
    )
    assert run_batch(batch, out, command=program_command).counts() == {"done": 1, "bad input": 1}
    assert s3.exists(f"{BUCKET}/kitchens/a/sequence/data.txt") and not s3.exists(f"{BUCKET}/kitchens/b")
    assert not (out / "a" / "sequence").exists() and (out / "a" / "batch.log").is_file()
    assert run_batch(batch, out, retry="none", command=program_command).ran == ()
    s3.rm_file(f"{BUCKET}/kitchens/a/sequence/{MANIFEST_NAME}")
    assert {result.job for result in run_batch(batch, out, command=program_command).ran} == {"a", "b"}
    assert s3.exists(f"{BUCKET}/kitchens/a/sequence/{MANIFEST_NAME}"), "what has no manifest is made again"


def test_what_is_torn_in_s3_is_no_artifact(tmp_path: Path, s3) -> None:
    run_batch(batch_of(tmp_path, {"a": "write"}), tmp_path / "out", command=program_command)
    url = f"s3://{BUCKET}/torn/a"
    send(tmp_path / "out" / "a", ["sequence"], url, 10.0)
    assert stored_digest(url, "sequence", 10.0) is not None
    s3.pipe_file(f"{BUCKET}/torn/a/sequence/data.txt", b"")
    assert stored_digest(url, "sequence", 10.0) is None


def test_a_server_that_is_not_there_is_said_in_one_line(s3, monkeypatch: pytest.MonkeyPatch) -> None:
    check_storage(f"s3://{BUCKET}/kitchens", 10.0)
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:1")
    type(s3).clear_instance_cache()
    with pytest.raises(MachineFailure, match=f"s3://{BUCKET}/nowhere") as raised:
        check_storage(f"s3://{BUCKET}/nowhere", 2.0)
    assert "\n" not in str(raised.value)
