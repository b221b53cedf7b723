"""Read and write safetensors files: a length, a JSON header, raw little-endian numbers. Nothing in them is executed.

Format: github.com/huggingface/safetensors, "Format". Files are checked before a byte is used: offsets must be inside
the file, follow one another without holes, and agree with shapes and types.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content, json_of

TYPES: dict[str, str] = {
    "F64": "<f8",
    "F32": "<f4",
    "F16": "<f2",
    "I64": "<i8",
    "I32": "<i4",
    "I16": "<i2",
    "I8": "<i1",
    "U64": "<u8",
    "U32": "<u4",
    "U16": "<u2",
    "U8": "|u1",
    "BOOL": "|b1",
}
"""Types that are read; bfloat16 has no numpy type."""
LARGEST_FILE = 64 * 2**30
"""Largest file [bytes]: more than any network that is read here."""
LARGEST_HEADER = 100_000_000
"""Largest header [bytes]: the format's own limit."""
METADATA = "__metadata__"
_BROKEN = "the file is damaged or not a safetensors file; fetch or train it again"


def write_safetensors(path: Path, tensors: Mapping[str, np.ndarray], metadata: Mapping[str, str]) -> None:
    """Write arrays and text. The same content gives the same bytes: names are sorted, the header is padded to 8 bytes.

    Raises ValueError for an array of a type that the format lacks.
    """
    header: dict[str, Any] = {METADATA: dict(sorted(metadata.items()))} if metadata else {}
    names = {np.dtype(text): name for name, text in TYPES.items()}
    offset, chunks = 0, []
    for name in sorted(tensors):
        array = np.asarray(tensors[name], order="C")
        kind = array.dtype.newbyteorder("<")
        if kind not in names:
            raise ValueError(f"{name}: safetensors has no type for {array.dtype}")
        data = array.astype(kind, copy=False).tobytes()
        header[name] = {"dtype": names[kind], "shape": list(array.shape), "data_offsets": [offset, offset + len(data)]}
        offset += len(data)
        chunks.append(data)
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with Path(path).open("wb") as file:
        file.write(len(text).to_bytes(8, "little") + text)
        file.writelines(chunks)


def read_safetensors(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return (arrays, metadata) of a file. Raises BadInput for one that is not whole or not of this format."""
    path = Path(path)
    data = file_content(path, LARGEST_FILE, hint="give a .safetensors file")
    length = int.from_bytes(data[:8], "little")
    if len(data) < 8 or length > min(len(data) - 8, LARGEST_HEADER):
        raise BadInput(f"{path}: the header is not whole ({len(data)} bytes in the file)", hint=_BROKEN)
    header = json_of(data[8 : 8 + length], f"{path}: the header", hint=_BROKEN)
    if not isinstance(header, dict):
        raise BadInput(f"{path}: the header is not a table of tensors", hint=_BROKEN)
    metadata = header.pop(METADATA, {})
    if not isinstance(metadata, dict) or not all(isinstance(value, str) for value in metadata.values()):
        raise BadInput(f"{path}: the metadata is not a table of texts", hint=_BROKEN)
    body = memoryview(data)[8 + length :]
    spans = [(_span(path, name, entry, len(body)), name) for name, entry in header.items()]
    expected = 0
    for (start, end, _, _), name in sorted(spans):
        if start != expected:
            raise BadInput(f"{path}: tensor {name!r} does not follow the one before it", hint=_BROKEN)
        expected = end
    if expected != len(body):
        raise BadInput(f"{path}: {len(body) - expected} bytes belong to no tensor", hint=_BROKEN)
    arrays = {
        name: np.frombuffer(body[start:end], dtype=kind).reshape(shape).copy()
        for (start, end, kind, shape), name in spans
    }
    return arrays, metadata


def _span(path: Path, name: str, entry: Any, size: int) -> tuple[int, int, str, tuple[int, ...]]:
    """Return (start, end, numpy type, shape) of a header entry, checked against the size of the body."""
    try:
        kind, shape, (start, end) = TYPES[entry["dtype"]], tuple(entry["shape"]), entry["data_offsets"]
        are_counts = all(type(number) is int and number >= 0 for number in (*shape, start, end))
        fits = are_counts and start <= end <= size and end - start == math.prod(shape) * np.dtype(kind).itemsize
    except (KeyError, TypeError, ValueError):
        fits = False
    if not fits:
        raise BadInput(f"{path}: tensor {name!r} has a type, shape or place that the file does not hold", hint=_BROKEN)
    return start, end, kind, shape
