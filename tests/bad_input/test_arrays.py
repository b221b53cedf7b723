"""NPZ and panoptic zip payloads that cannot be: refused before memory is taken for what is only claimed."""

from __future__ import annotations

import contextlib
import io
import resource
import struct
import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.masks import (
    PanopticReader,
    decode_panoptic_png,
    encode_panoptic_png,
    write_panoptic_zip,
)
from scenewright.stages.kit.formats.numpy_files import read_array, read_arrays

from tests.bad_input.damages import flipped

FILES = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def npy(header: str, data: bytes = b"", version: tuple[int, int] = (1, 0)) -> bytes:
    text = header.encode("latin1") + b"\n"
    length = struct.pack("<H" if version == (1, 0) else "<I", len(text))
    return b"\x93NUMPY" + bytes(version) + length + text + data


def header(shape: str = "(4,)", kind: str = "<f8", fortran: str = "False") -> str:
    return f"{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}"


def npz(path: Path, data: bytes, name: str = "a.npy", how: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", how) as archive:
        archive.writestr(name, data)
    return path


def objects() -> bytes:
    # The start of a pickled stream is enough: reading it at all would raise.
    return npy(header("(1,)", "|O"), b"\x80\x04c__builtin__\nexec\n.")


BAD_ARRAYS = {
    "objects": (objects(), "expected plain numbers"),
    "objects in a record": (
        npy("{'descr': [('a', '|O')], 'fortran_order': False, 'shape': (1,), }", bytes(8)),
        "expected plain numbers",
    ),
    "records": (npy("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,), }", bytes(8)), "expected plain"),
    "times": (npy(header("(1,)", "<M8[s]"), bytes(8)), "expected plain numbers"),
    "huge shape": (npy(header("(200000, 200000)"), bytes(32)), "needs 320000000000 bytes"),
    "huge product": (npy(header("(4294967296, 4294967296, 4294967296)"), bytes(32)), "needs"),
    "negative shape": (npy(header("(-4,)"), bytes(32)), "shape"),
    "shape of text": (npy(header("('4',)"), bytes(32)), "no array header"),
    "many axes": (npy(header("(1,1,1,1,1,1,1,1,4)"), bytes(32)), "shape"),
    "too short": (npy(header(), bytes(31)), "needs 32"),
    "too long": (npy(header(), bytes(33)), "needs 32"),
    "no magic": (b"NUMPY" + bytes(100), "no array header"),
    "empty": (b"", "no array header|cannot come"),
    "version 9": (npy(header(), bytes(32), (9, 0)), "no array header"),
    "calls in the header": (npy("__import__('os').system('true')"), "no array header"),
    "deep header": (npy("(" * 5000), "no array header"),
    "long header": (npy(header() + " " * 20_000, bytes(32)), "no array header"),
    "unknown kind": (npy(header(kind="<q99")), "no array header"),
    "half a header": (npy(header())[:20], "no array header"),
}


@pytest.mark.parametrize("case", BAD_ARRAYS)
def test_arrays_that_cannot_be(tmp_path: Path, case: str) -> None:
    data, complaint = BAD_ARRAYS[case]
    for how in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        with pytest.raises(BadInput, match=complaint) as caught:
            read_arrays(npz(tmp_path / "x.npz", data, how=how), "a")
        assert "x.npz" in str(caught.value) and "\n" not in str(caught.value)


@FILES
@given(
    arrays(
        st.sampled_from([np.float16, np.float32, np.float64, np.int8, np.int32, np.uint64, np.bool_]),
        array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5),
        elements={"allow_nan": False},
    ),
    st.booleans(),
    st.booleans(),
)
def test_what_numpy_writes_is_read(tmp_path: Path, array: np.ndarray, packed: bool, fortran: bool) -> None:
    ordered = np.asfortranarray(array) if fortran and array.ndim else array
    (np.savez_compressed if packed else np.savez)(tmp_path / "x.npz", a=ordered, b=array)
    a, b = read_arrays(tmp_path / "x.npz", "a", "b")
    for found in (a, b):
        assert found.dtype == array.dtype and found.shape == array.shape and np.array_equal(found, array)


def test_archives_that_cannot_be(tmp_path: Path) -> None:
    good = io.BytesIO()
    np.savez(good, a=np.arange(4.0))
    path = tmp_path / "x.npz"
    for data, complaint in ((b"", "zip"), (b"PK", "zip"), (good.getvalue()[:-30], "zip"), (bytes(1000), "zip")):
        path.write_bytes(data)
        with pytest.raises(BadInput, match=complaint):
            read_arrays(path, "a")
    path.write_bytes(good.getvalue())
    with pytest.raises(BadInput, match="has no array 'b'"):
        read_arrays(path, "b")
    with pytest.raises(BadInput, match="missing"):
        read_arrays(tmp_path / "none.npz", "a")
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("a.npy", b"another")
    with pytest.raises(BadInput, match="more than once"):
        read_arrays(path, "a")


def test_a_flipped_byte_is_refused_or_carries_nothing(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, a=np.arange(40.0))
    for place in range(30, len(buffer.getvalue()), 3):
        (tmp_path / "x.npz").write_bytes(flipped(buffer.getvalue(), place, 0x55))
        with contextlib.suppress(BadInput):
            (found,) = read_arrays(tmp_path / "x.npz", "a")
            assert np.array_equal(found, np.arange(40.0)), place


# --- panoptic.zip -------------------------------------------------------------------------------------------------


def patched(data: bytes, name: str, **fields: int) -> bytes:
    """Return a zip with fields of one entry overwritten, in its local header and in the directory."""
    local = {"flags": (6, "<H"), "method": (8, "<H"), "crc": (14, "<I"), "packed": (18, "<I"), "size": (22, "<I")}
    central = {"flags": (8, "<H"), "method": (10, "<H"), "crc": (16, "<I"), "packed": (20, "<I"), "size": (24, "<I")}
    changed = bytearray(data)
    for signature, offsets, name_at in ((b"PK\3\4", local, 30), (b"PK\1\2", central, 46)):
        start = data.find(signature)
        while start >= 0 and data[start + name_at : start + name_at + len(name)] != name.encode():
            start = data.find(signature, start + 1)
        for field, value in fields.items():
            offset, kind = offsets[field]
            struct.pack_into(kind, changed, start + offset, value)
    return bytes(changed)


def png_of_size(width: int, height: int) -> bytes:
    """A PNG that claims a size and packs zeros."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(bytes(3000))) + chunk(b"IEND", b"")


IDS = np.arange(12, dtype=np.int32).reshape(3, 4)
NAME = "000000.png"


def test_panoptic_zips_that_cannot_be(tmp_path: Path) -> None:
    path = tmp_path / "panoptic.zip"
    write_panoptic_zip(path, [(0, IDS), (1, IDS)])
    good = path.read_bytes()
    cases = {
        "encrypted": (patched(good, NAME, flags=1), "encrypted"),
        "lying size": (patched(good, NAME, size=2**31), "claims 2147483648 bytes"),
        "lying packed size": (patched(good, NAME, packed=2**31, size=2**31), "claims"),
        "wrong checksum": (patched(good, NAME, crc=1), "frame 0 is damaged"),
        "unknown compression": (patched(good, NAME, method=77), "panoptic.zip"),
        "deflated, but it is not": (patched(good, NAME, method=8), "panoptic.zip"),
        "truncated": (good[: len(good) // 2], "not a zip"),
        "a bomb of a size": (_with(png_of_size(60_000, 60_000)), "60000x60000 pixels"),
        "no size": (_with(png_of_size(0, 0)), "0x0 pixels"),
        "cut picture": (_with(encode_panoptic_png(IDS)[:50]), "50 bytes cannot hold"),
        "grey": (_with(cv2.imencode(".png", np.zeros((4, 4), np.uint8))[1].tobytes()), "not a COCO panoptic PNG"),
        "sixteen bits": (_with(cv2.imencode(".png", np.zeros((4, 4, 3), np.uint16))[1].tobytes()), "not a COCO"),
        "transparent": (_with(cv2.imencode(".png", np.zeros((4, 4, 4), np.uint8))[1].tobytes()), "not a COCO"),
        "a JPEG": (_with(cv2.imencode(".jpg", np.zeros((4, 4, 3), np.uint8))[1].tobytes()), "not a COCO"),
        "words": (_with(b"no picture"), "not a COCO"),
        "nothing": (_with(b""), "not a COCO"),
    }
    with pytest.raises(BadInput, match="missing"):
        PanopticReader(tmp_path / "none.zip")
    for case, (data, complaint) in cases.items():
        path.write_bytes(data)
        with pytest.raises(BadInput, match=complaint), PanopticReader(path) as reader:
            reader.read(0)
            pytest.fail(case)


def _with(picture: bytes, name: str = NAME) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, picture)
    return buffer.getvalue()


@pytest.mark.parametrize(
    "name",
    [
        "../../etc/evil.png",
        "/tmp/evil.png",
        "\u0663\u0663\u0663\u0663\u0663\u0663.png",
        "1e5.png",
        "-00001.png",
        "9" * 5000 + ".png",
        "000000.png.png",
        "000000.PNG",
        "con.png",
    ],
)
def test_names_in_the_archive_lead_nowhere(tmp_path: Path, name: str) -> None:
    """Nothing is unpacked: entries whose names are not ours are not frames."""
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "panoptic.zip"
    path.write_bytes(_with(encode_panoptic_png(IDS), name))
    with PanopticReader(path) as reader:
        assert reader.frame_indices() == []
        with pytest.raises(BadInput, match="no image for frame 0"):
            reader.read(0)
    assert [entry.name for entry in tmp_path.rglob("*")] == ["in", "panoptic.zip"]


def test_a_bomb_takes_no_memory(tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    data = png_of_size(30_000, 30_000)
    with pytest.raises(BadInput):
        decode_panoptic_png(data)
    with pytest.raises(BadInput):
        read_arrays(npz(tmp_path / "x.npz", npy(header("(40000, 1000000)"), bytes(10**6))), "a")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kB; they claim 2.7 and 320 GB


def test_a_bare_array_is_read_and_refused_alike(tmp_path: Path) -> None:
    path = tmp_path / "depth.npy"
    np.save(path, np.arange(6.0).reshape(2, 3))
    np.testing.assert_array_equal(read_array(path), np.arange(6.0).reshape(2, 3))
    whole = path.read_bytes()
    for damaged, said in ((whole[:-1], "there are|needs"), (whole + b"x", "or more"), (b"", "no array header")):
        path.write_bytes(damaged)
        with pytest.raises(BadInput, match=said) as refusal:
            read_array(path, "save it again")
        assert str(path) in refusal.value.message and refusal.value.hint == "save it again"
    np.save(path, np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(BadInput, match="holds object"):
        read_array(path)
    with pytest.raises(BadInput, match="file is missing"):
        read_array(tmp_path / "none.npy")
