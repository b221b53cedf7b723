"""safetensors: what is written is read, by us and by the format's own library; damage is refused in one line."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors

KINDS = st.sampled_from(["f4", "f2", "i8", "i4", "u1", "?"])
ARRAYS = KINDS.flatmap(lambda kind: arrays(kind, array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4)))
TENSORS = st.dictionaries(st.text(min_size=1, max_size=6).filter(lambda t: t != "__metadata__"), ARRAYS, max_size=4)


def same(first: np.ndarray, second: np.ndarray) -> bool:
    return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()


@settings(max_examples=40, deadline=None)
@given(TENSORS, st.dictionaries(st.text(max_size=4), st.text(max_size=8), max_size=3))
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, tensors: dict[str, np.ndarray], metadata: dict[str, str]
) -> None:
    path = tmp_path_factory.mktemp("tensors") / "a.safetensors"
    write_safetensors(path, tensors, metadata)
    found, said = read_safetensors(path)
    assert said == metadata and found.keys() == tensors.keys()
    assert all(same(found[name], tensors[name]) for name in tensors)
    first = path.read_bytes()
    write_safetensors(path, dict(reversed(tensors.items())), metadata)
    assert path.read_bytes() == first


def test_the_library_of_the_format_agrees(tmp_path: Path) -> None:
    library = pytest.importorskip("safetensors.numpy")
    random = np.random.default_rng(0)
    tensors = {"b": random.standard_normal((3, 4)).astype(np.float32), "a": np.arange(5), "c": np.float16([1, 2])}
    write_safetensors(tmp_path / "ours", tensors, {"who": "us"})
    theirs = library.load_file(tmp_path / "ours")
    assert all(same(theirs[name], tensors[name]) for name in tensors)
    library.save_file(tensors, tmp_path / "theirs", metadata={"who": "them"})
    found, metadata = read_safetensors(tmp_path / "theirs")
    assert metadata == {"who": "them"} and all(same(found[name], tensors[name]) for name in tensors)


def header(entry: object) -> bytes:
    text = json.dumps(entry).encode()
    return len(text).to_bytes(8, "little") + text


ENTRY = {"dtype": "F32", "shape": [2], "data_offsets": [0, 8]}


@pytest.mark.parametrize(
    ("data", "what"),
    [
        (b"", "not whole"),
        (b"\x00" * 7, "not whole"),
        ((1 << 40).to_bytes(8, "little") + b"{}", "not whole"),
        ((4).to_bytes(8, "little") + b"oops", "no JSON"),
        ((200_000).to_bytes(8, "little") + b"[" * 200_000, "nested too deeply"),
        (header([]), "not a table"),
        (header({"__metadata__": {"a": 1}}), "metadata"),
        (header({"a": ENTRY}) + b"1234", "'a'"),
        (header({"a": ENTRY}) + b"123456789", "belong to no tensor"),
        (header({"a": ENTRY, "b": ENTRY}) + b"12345678", "'b' does not follow"),
        (header({"a": {**ENTRY, "dtype": "BF16"}}) + b"12345678", "'a'"),
        (header({"a": {**ENTRY, "shape": [-2]}}) + b"12345678", "'a'"),
        (header({"a": {**ENTRY, "shape": [True, 2]}}) + b"12345678", "'a'"),
        (header({"a": {**ENTRY, "shape": "2"}}) + b"12345678", "'a'"),
        (header({"a": {**ENTRY, "shape": [1 << 62, 1 << 62, 0]}}) + b"12345678", "'a'"),
        (header({"a": {**ENTRY, "data_offsets": [0]}}) + b"12345678", "'a'"),
        (header({"a": None}) + b"12345678", "'a'"),
    ],
)
def test_damage_is_named(tmp_path: Path, data: bytes, what: str) -> None:
    path = tmp_path / "a.safetensors"
    path.write_bytes(data)
    with pytest.raises(BadInput) as error:
        read_safetensors(path)
    assert what in error.value.message and "a.safetensors" in error.value.message and error.value.hint


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"none\.safetensors"):
        read_safetensors(tmp_path / "none.safetensors")


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 400), st.integers(0, 255))
def test_any_changed_byte_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, place: int, value: int) -> None:
    path = tmp_path_factory.mktemp("torn") / "a.safetensors"
    write_safetensors(path, {"a": np.arange(6.0), "b": np.ones((2, 2), np.float32)}, {"k": "v"})
    data = bytearray(path.read_bytes())
    data[place % len(data)] = value
    path.write_bytes(bytes(data))
    with contextlib.suppress(BadInput):
        read_safetensors(path)
