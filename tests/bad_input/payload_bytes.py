"""Bytes of payload files, true and false: arrays, archives, pictures and meshes."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable

import cv2
import numpy as np


def npy(header: str, data: bytes = b"", version: tuple[int, int] = (1, 0)) -> bytes:
    text = header.encode("latin1") + b"\n"
    length = struct.pack("<H" if version == (1, 0) else "<I", len(text))
    return b"\x93NUMPY" + bytes(version) + length + text + data


def header(shape: str = "(4,)", kind: str = "<f8", fortran: str = "False") -> str:
    return f"{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': {shape}, }}"


def npz(data: bytes, name: str = "a.npy", how: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return an archive of one entry."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", how) as archive:
        archive.writestr(name, data)
    return buffer.getvalue()


def saved(save: Callable[..., None], *arrays: np.ndarray, **named: np.ndarray) -> bytes:
    """Return what a function of NumPy writes."""
    buffer = io.BytesIO()
    save(buffer, *arrays, **named)
    return buffer.getvalue()


def image(suffix: str, *shape: int, kind: type = np.uint8) -> bytes:
    """Return a black picture."""
    return cv2.imencode(suffix, np.zeros(shape, kind))[1].tobytes()


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
