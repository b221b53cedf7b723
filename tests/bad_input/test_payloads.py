"""Payload files that cannot be: one line each, and no memory for what is only claimed. What is odd is read."""

from __future__ import annotations

import contextlib
import os
import resource
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.formats.masks import (
    PanopticReader,
    decode_panoptic_png,
    encode_panoptic_png,
    write_panoptic_zip,
)
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.numpy_files import read_array, read_arrays
from scenewright.stages.kit.formats.trajectories import read_tum

from tests.bad_input.damages import flipped
from tests.bad_input.payload_bytes import accessor, glb, header, image, npy, npz, patched, ply, png_of_size, saved, stl


def first_image(path: Path) -> np.ndarray:
    """Return the image of frame 0."""
    with PanopticReader(path) as reader:
        return reader.read(0)


READERS: dict[str, Callable[[Path], object]] = {
    ".npz": lambda path: read_arrays(path, "a"),
    ".npy": read_array,
    ".zip": first_image,
    ".tum": read_tum,
    **dict.fromkeys((".ply", ".obj", ".stl", ".glb", ".dae"), read_mesh),
}
"""The door of each format."""
IDS = np.arange(12, dtype=np.int32).reshape(3, 4)
NAME = "000000.png"
CUBE = trimesh.creation.box((1.0, 2.0, 3.0))
TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


PANOPTIC = saved(lambda buffer: write_panoptic_zip(buffer, [(0, IDS), (1, IDS)]))


def in_zip(picture: bytes, name: str = NAME) -> bytes:
    """Return a zip of masks with one picture."""
    return npz(picture, name)


# The start of a pickled stream is enough: reading it at all would raise.
PICKLED = npy(header("(1,)", "|O"), b"\x80\x04c__builtin__\nexec\n.")
ARRAYS = {
    "objects": (PICKLED, "expected plain numbers"),
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
"""Of one array within an archive."""
PANOPTIC_ZIPS = {
    "encrypted": (patched(PANOPTIC, NAME, flags=1), "encrypted"),
    "lying size": (patched(PANOPTIC, NAME, size=2**31), "claims 2147483648 bytes"),
    "lying packed size": (patched(PANOPTIC, NAME, packed=2**31, size=2**31), "claims"),
    "wrong checksum": (patched(PANOPTIC, NAME, crc=1), "frame 0 is damaged"),
    "unknown compression": (patched(PANOPTIC, NAME, method=77), "not supported"),
    "deflated, but it is not": (patched(PANOPTIC, NAME, method=8), "decompressing"),
    "truncated": (PANOPTIC[: len(PANOPTIC) // 2], "not a zip"),
    "a bomb of a size": (in_zip(png_of_size(60_000, 60_000)), "60000x60000 pixels"),
    "no size": (in_zip(png_of_size(0, 0)), "0x0 pixels"),
    "cut picture": (in_zip(encode_panoptic_png(IDS)[:50]), "50 bytes cannot hold"),
    "grey": (in_zip(image(".png", 4, 4)), "not a COCO panoptic PNG"),
    "sixteen bits": (in_zip(image(".png", 4, 4, 3, kind=np.uint16)), "not a COCO"),
    "transparent": (in_zip(image(".png", 4, 4, 4)), "not a COCO"),
    "a JPEG": (in_zip(image(".jpg", 4, 4, 3)), "not a COCO"),
    "words": (in_zip(b"no picture"), "not a COCO"),
    "nothing": (in_zip(b""), "not a COCO"),
}
TUM = [
    ("1 2 3", "3 columns, expected 8"),
    ("1 0 0 0 0 0 0 0", "norm 0"),
    ("1 0 0 0 0 0 0 2", "norm 2"),
    ("1 0 0 0 0 0 0 one", "'one' is not a number"),
    ("nan 0 0 0 0 0 0 1", "time is not finite"),
    ("1 nan 0 0 0 0 0 1", "not finite"),
    ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1", "line 2: time 1.0 s is not after"),
    ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1", "line 2"),
]
MESHES = {
    "empty.ply": (b"", "no PLY header"),
    "empty.stl": (b"", "shorter than its header"),
    "empty.obj": (b"", "no triangles"),
    "empty.glb": (b"", "no GLB header"),
    "no faces.ply": (ply(faces="", counts=("3", "0")), "no triangles|points"),
    "nothing.ply": (ply("", "", ("0", "0")), "no triangles"),
    "points.obj": (b"v 0 0 0\nv 1 0 0\n", "no triangles|points|cannot be read"),
    "nan.ply": (ply("0 0 0\nnan 0 0\n0 1 0\n"), "not finite"),
    "infinity.obj": (b"v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
    "words.ply": (ply("0 0 0\none 0 0\n0 1 0\n"), "cannot be read"),
    "bad index.ply": (ply(faces="3 0 1 9\n"), "names a vertex|cannot be read"),
    "negative index.ply": (ply(faces="3 0 1 -1\n"), "names a vertex|cannot be read"),
    "bad index.obj": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "names a vertex|cannot be read"),
    "count lie.ply": (ply(counts=("4000000000", "1")), "declares"),
    "face count lie.ply": (ply(counts=("3", "4000000000")), "declares"),
    "negative count.ply": (ply(counts=("-3", "1")), "declares"),
    "count of letters.ply": (ply(counts=("x", "1")), "declares"),
    "endless count.ply": (ply(counts=("9" * 500, "1")), "declares"),
    "count lie.stl": (stl(2, 4_000_000_000), "declares 4000000000 triangles"),
    "short count.stl": (stl(2, 1), "declares 1 triangles"),
    "torn.stl": (stl(2, 2)[:-7], "declares 2 triangles"),
    "torn.glb": (glb()[:-9], "the file has"),
    "count lie.glb": (glb(accessors=accessor(count=40_000_000_000)), "needs"),
    "zeros of nothing.glb": (glb(accessors=accessor(bufferView=None, count=10**10)), "GLB description"),
    "no buffer.glb": (glb(bufferViews=[]), "GLB description"),
    "view outside.glb": (glb(bufferViews=[{"byteOffset": 10**9, "byteLength": 99}] * 2), "buffer view ends"),
    "other file.glb": (glb(buffers=[{"byteLength": 44, "uri": "../../secret"}]), "names another file"),
    "web.glb": (glb(images=[{"uri": "https://example.org/x.png"}]), "names another file"),
    "nonsense.glb": (b"glTF" + struct.pack("<II", 2, 28) + struct.pack("<I", 8) + b"JSON" + b"[[[[[[[[", "description"),
    "deep.glb": (
        b"glTF" + struct.pack("<III", 2, 100_020, 100_000) + b"JSON" + b"[" * 100_000,
        "description is broken",
    ),
    "zero bytes.obj": (b"v 0 0 0\0", "zero bytes"),
    "zip.ply": (b"PK\3\4" + bytes(100), "no PLY header"),
    "a.dae": (b"<x/>", "not a mesh format"),
}
WHOLE_NPZ, WHOLE_NPY = saved(np.savez, a=np.arange(4.0)), saved(np.save, np.arange(6.0).reshape(2, 3))
BAD: dict[str, tuple[bytes, str]] = {
    **{
        f"{case}, {word}.npz": (npz(data, how=how), words)
        for case, (data, words) in ARRAYS.items()
        for word, how in (("stored", zipfile.ZIP_STORED), ("packed", zipfile.ZIP_DEFLATED))
    },
    "half a zip.npz": (b"PK", "zip"),
    "no end.npz": (WHOLE_NPZ[:-30], "zip"),
    "zeros.npz": (bytes(1000), "zip"),
    "another name.npz": (saved(np.savez, b=np.arange(4.0)), "has no array 'a'"),
    "cut.npy": (WHOLE_NPY[:-1], "there are|needs"),
    "longer.npy": (WHOLE_NPY + b"x", "or more"),
    "nothing.npy": (b"", "no array header"),
    "objects.npy": (PICKLED, "holds object"),
    **{f"{case}.zip": row for case, row in PANOPTIC_ZIPS.items()},
    **{f"line {number}.tum": (text.encode(), words) for number, (text, words) in enumerate(TUM)},
    **MESHES,
}
"""File name -> (its bytes, words of the refusal); the suffix says which door it meets."""


@pytest.mark.parametrize("name", BAD)
def test_payloads_that_cannot_be(tmp_path: Path, name: str) -> None:
    data, words = BAD[name]
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(BadInput, match=words) as caught:
        READERS[path.suffix](path)
    assert name in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 500
    if path.suffix == ".ply":
        with pytest.raises(BadInput):
            load_entity_mesh(path)


@pytest.mark.parametrize("suffix", sorted(READERS.keys() - {".dae"}))
def test_paths_that_are_no_files(tmp_path: Path, suffix: str) -> None:
    (tmp_path / f"folder{suffix}").mkdir()
    os.mkfifo(tmp_path / f"pipe{suffix}")
    for name, words in (("none", "missing"), ("folder", "a folder, not"), ("pipe", "a pipe, not"), ("a\0b", "null")):
        with pytest.raises(BadInput, match=words):
            READERS[suffix](tmp_path / f"{name}{suffix}")


def test_an_entry_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    path.write_bytes(WHOLE_NPZ)
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(path, "a") as archive:
        archive.writestr("a.npy", b"another")
    with pytest.raises(BadInput, match="more than once"):
        read_arrays(path, "a")


def test_a_refused_array_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as refusal:
        read_array(tmp_path / "none.npy", "save it again")
    assert str(tmp_path / "none.npy") in refusal.value.message and refusal.value.hint == "save it again"


def test_a_flipped_byte_is_refused_or_carries_nothing(tmp_path: Path) -> None:
    whole = saved(np.savez_compressed, a=np.arange(40.0))
    for place in range(30, len(whole), 3):
        (tmp_path / "x.npz").write_bytes(flipped(whole, place, 0x55))
        with contextlib.suppress(BadInput):
            (found,) = read_arrays(tmp_path / "x.npz", "a")
            assert np.array_equal(found, np.arange(40.0)), place


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
    path.write_bytes(in_zip(encode_panoptic_png(IDS), name))
    with PanopticReader(path) as reader:
        assert reader.frame_indices() == []
        with pytest.raises(BadInput, match="no image for frame 0"):
            reader.read(0)
    assert [entry.name for entry in tmp_path.rglob("*")] == ["in", "panoptic.zip"]


def test_a_bomb_takes_no_memory(tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(BadInput):
        decode_panoptic_png(png_of_size(30_000, 30_000))
    (tmp_path / "x.npz").write_bytes(npz(npy(header("(40000, 1000000)"), bytes(10**6))))
    with pytest.raises(BadInput):
        read_arrays(tmp_path / "x.npz", "a")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kB; they claim 2.7 and 320 GB


# --- read --------------------------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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


def test_a_bare_array_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.npy").write_bytes(WHOLE_NPY)
    np.testing.assert_array_equal(read_array(tmp_path / "a.npy"), np.arange(6.0).reshape(2, 3))


GOOD = {
    "a.ply": ply(),
    "a.glb": glb(),
    "a.stl": CUBE.export(file_type="stl"),
    "b.ply": CUBE.export(file_type="ply"),
    "a.obj": TRIANGLE,
    "unicode \u53f0 name.obj": TRIANGLE,
    "ascii.stl": CUBE.export(file_type="stl_ascii").encode(),
    "b.glb": trimesh.Scene(CUBE).export(file_type="glb"),
}


@pytest.mark.parametrize("name", GOOD)
def test_the_yardsticks_are_read(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(GOOD[name])
    mesh = read_mesh(tmp_path / name)
    assert len(mesh.faces) in (1, 12) and len(mesh.vertices) >= 3


def test_materials_are_not_followed(tmp_path: Path) -> None:
    """An OBJ names a material file: whatever stands there, it is not opened."""
    secret = tmp_path / "secret.mtl"
    secret.write_text("newmtl m\nKd 1 0 0\nmap_Kd /etc/passwd\n")
    secret.chmod(0o000)
    folder = tmp_path / "model"
    folder.mkdir()
    for reference in ("../secret.mtl", "/etc/passwd", "https://example.org/a.mtl", "a b.mtl"):
        (folder / "a.obj").write_text(f"mtllib {reference}\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        assert len(read_mesh(folder / "a.obj").faces) == 1


def test_odd_shapes_are_shapes(tmp_path: Path) -> None:
    """Non-manifold, zero area, a thousand times too large: meshes all the same. What to make of them is the steps'."""
    for name, vertices, faces in (
        ("zero area", "0 0 0\n0 0 0\n0 0 0\n", "3 0 1 2\n"),
        ("three faces on an edge", "0 0 0\n1 0 0\n0 1 0\n", "3 0 1 2\n3 1 0 2\n3 0 1 2\n"),
        ("large", "0 0 0\n1000000 0 0\n0 1000000 0\n", "3 0 1 2\n"),
    ):
        path = tmp_path / f"{name}.ply"
        path.write_bytes(ply(vertices, faces, ("3", str(faces.count("\n")))))
        mesh = read_mesh(path)
        assert len(mesh.vertices) == 3 and len(mesh.faces) == faces.count("\n")
