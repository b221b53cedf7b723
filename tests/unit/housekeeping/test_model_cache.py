"""The cache of weight files: copies whole or not at all, found by name, damage noticed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from scenewright.cli.main import run
from scenewright.schemas.errors import BadInput, MachineFailure, MissingDependency
from scenewright.stages.engine import model_cache
from scenewright.stages.engine.known_models import KnownModel
from scenewright.stages.engine.model_cache import add_model, cache_folder, cached_models, resolve_weights

WEIGHTS = b"weights of a tiny network"
KNOWN = KnownModel(
    name="tiny",
    purpose="tests",
    file="tiny_net.onnx",
    source="nowhere",
    licence="none",
    sha256=hashlib.sha256(WEIGHTS).hexdigest(),
)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(model_cache.ENVIRONMENT, str(tmp_path / "cache"))
    monkeypatch.setattr(model_cache, "known_models", lambda: (KNOWN,))
    return tmp_path / "cache"


def file(tmp_path: Path, name: str = "tiny_net.onnx", data: bytes = WEIGHTS) -> Path:
    (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
    (tmp_path / name).write_bytes(data)
    return tmp_path / name


def test_added_and_found_by_every_name(tmp_path: Path, cache: Path) -> None:
    added = add_model(file(tmp_path))
    assert added.path == cache / f"{KNOWN.sha256[:16]}-tiny_net.onnx" and added.path.read_bytes() == WEIGHTS
    assert added.known == KNOWN and added.bytes == len(WEIGHTS)
    for name in ("tiny", "tiny_net", "tiny_net.onnx"):
        assert resolve_weights(Path(name)) == added.path
    assert resolve_weights(tmp_path / "tiny_net.onnx") == tmp_path / "tiny_net.onnx"  # a file wins


def test_adding_again_changes_nothing(tmp_path: Path, cache: Path) -> None:
    first = add_model(file(tmp_path))
    before = first.path.stat().st_mtime_ns
    assert add_model(file(tmp_path)) == first and first.path.stat().st_mtime_ns == before
    assert len(list(cache.iterdir())) == 1


def test_networks_that_nobody_listed_are_welcome(tmp_path: Path) -> None:
    own = add_model(file(tmp_path, "own.onnx", b"own"))
    assert own.known is None and resolve_weights(Path("own")) == own.path


def test_a_known_name_on_other_bytes_is_refused(tmp_path: Path, cache: Path) -> None:
    with pytest.raises(BadInput, match="is not that of tiny"):
        add_model(file(tmp_path, data=b"truncated"))
    assert not cache.exists()


def test_what_is_missing_or_ambiguous_or_damaged(tmp_path: Path, cache: Path) -> None:
    with pytest.raises(MissingDependency, match="models --add tiny_net.onnx"):
        resolve_weights(Path("tiny"))
    with pytest.raises(MissingDependency, match="no such weight file"):
        resolve_weights(Path("nonsense"))
    with pytest.raises(BadInput, match="no such file"):
        add_model(tmp_path / "nowhere.onnx")
    add_model(file(tmp_path, "a/net.onnx", b"one"))
    second = add_model(file(tmp_path, "b/net.onnx", b"two"))
    with pytest.raises(BadInput, match="2 cached models"):
        resolve_weights(Path("net"))
    assert resolve_weights(second.path) == second.path
    added = add_model(file(tmp_path))
    added.path.write_bytes(b"rotten")
    with pytest.raises(BadInput, match="damaged"):
        resolve_weights(Path("tiny"))
    add_model(file(tmp_path))  # adding it again heals it
    assert resolve_weights(Path("tiny")) == added.path


def test_foreign_files_and_half_copies_are_no_models(cache: Path) -> None:
    cache.mkdir()
    for name in ("README.md", f".{KNOWN.sha256[:16]}-tiny_net.onnx.0123abcd", "0123-short.onnx"):
        (cache / name).write_text("x")
    assert cached_models() == ()


def test_a_cache_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(model_cache.ENVIRONMENT, "/proc/nowhere")
    with pytest.raises(MachineFailure, match="SCENEWRIGHT_MODELS"):
        add_model(file(tmp_path))


def test_where_the_cache_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(model_cache.ENVIRONMENT)
    monkeypatch.setenv("XDG_CACHE_HOME", "/xdg")
    assert cache_folder() == Path("/xdg/scenewright/models")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert cache_folder() == Path("/home/somebody/.cache/scenewright/models")


def test_command(tmp_path: Path, cache: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["models", "--add", str(file(tmp_path, "own.onnx", b"own"))]) == 0
    assert capsys.readouterr().out.startswith(str(cache))
    assert run(["models"]) == 0
    assert "1 files" in (text := capsys.readouterr().out) and "own.onnx (not listed" in text
    assert run(["models", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"][0]["name"] == "own.onnx"
