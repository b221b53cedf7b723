"""Mesh files that cannot be: one line, no memory taken for what is only claimed, nothing read outside of the file."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.entity_meshes import load_entity_mesh
from scenewright.stages.kit.formats.mesh_files import read_mesh

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
CUBE = trimesh.creation.box((1.0, 2.0, 3.0))


def ply(
    vertices: str = "0 0 0\n1 0 0\n0 1 0\n", faces: str = "3 0 1 2\n", counts: tuple[str, str] = ("3", "1")
) -> bytes:
    return (
        f"ply\nformat ascii 1.0\nelement vertex {counts[0]}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {counts[1]}\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}"
    ).encode()


def stl(triangles: int, claimed: int) -> bytes:
    return bytes(80) + struct.pack("<I", claimed) + bytes(50 * triangles)


def glb(**changes: object) -> bytes:
    """A GLB of one triangle; `changes` replace parts of its description."""
    binary = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes() + np.array([0, 1, 2, 0], "<u2").tobytes()
    tree: dict = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 8},
        ],
        "buffers": [{"byteLength": 44}],
    } | changes
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I", len(text)) + b"JSON" + text + struct.pack("<I", len(binary)) + b"BIN\0" + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def accessor(**changes: object) -> list[dict]:
    index = {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}
    return [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"} | changes, index]


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

BAD = {
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


@pytest.mark.parametrize("name", GOOD)
def test_the_yardsticks_are_read(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(GOOD[name])
    mesh = read_mesh(tmp_path / name)
    assert len(mesh.faces) in (1, 12) and len(mesh.vertices) >= 3


@pytest.mark.parametrize("name", BAD)
def test_meshes_that_cannot_be(tmp_path: Path, name: str) -> None:
    data, complaint = BAD[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(BadInput, match=complaint) as caught:
        read_mesh(tmp_path / name)
    assert name in str(caught.value) and "\n" not in str(caught.value) and len(str(caught.value)) < 400
    if name.endswith(".ply"):
        with pytest.raises(BadInput):
            load_entity_mesh(tmp_path / name)


def test_missing_and_not_a_file(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="missing"):
        read_mesh(tmp_path / "none.ply")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(BadInput, match="a folder, not a regular file"):
        read_mesh(tmp_path / "folder.ply")
    with pytest.raises(BadInput, match="null"):
        read_mesh(tmp_path / "a\0b.ply")


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
