"""Arrays out of NPZ and NPY files that nobody vouches for: sizes are checked first, objects are refused."""

from __future__ import annotations

import math
import os
import zipfile
from pathlib import Path
from typing import IO

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.formats.zip_files import find_entry, zip_errors

LARGEST_ARRAY = 8 * 2**30
"""Largest array [bytes]. A map of ten million voxel blocks does not fit; nothing that the steps write comes near."""
LARGEST_HEADER = 10_000
"""Largest header of a .npy file [bytes]: numpy's own default."""
PIECE = 1 << 24
"""Bytes of an array that are read at a time; by eye."""
PLAIN_KINDS = "biufUS"


def read_arrays(
    path: Path, *names: str, shapes: tuple[str, ...] = (), hint: str = "make the artifact again"
) -> tuple[np.ndarray, ...]:
    """Return the named arrays of an NPZ file. `shapes`, one for each, say what is expected of numbers: `B 3`, `B 512`
    are arrays with the same, whatever, number of rows.

    Raises BadInput when the file is missing, is no NPZ, lacks an array, has it twice or in another shape, or when an
    entry is encrypted, damaged, holds objects, or declares another size than it has (numpy would reserve memory for it
    first).
    """
    path = Path(path)
    with opened(path, hint=hint) as file, zip_errors(path, hint), zipfile.ZipFile(file) as archive:
        arrays = tuple(_read_entry(archive, f"{name}.npy") for name in names)
        _check_shapes(names, arrays, shapes)
    return arrays


def read_all_arrays(path: Path, hint: str = "make the artifact again") -> dict[str, np.ndarray]:
    """Return every array of an NPZ file by name. Raises BadInput as `read_arrays` does."""
    path = Path(path)
    with opened(path, hint=hint) as file, zip_errors(path, hint), zipfile.ZipFile(file) as archive:
        return {name.removesuffix(".npy"): _read_entry(archive, name) for name in archive.namelist()}


def read_array(path: Path, hint: str = "make the artifact again") -> np.ndarray:
    """Return the array of an NPY file. Raises BadInput as `read_arrays` does."""
    path = Path(path)
    with opened(path, hint=hint) as file:
        size = os.fstat(file.fileno()).st_size
        try:
            return _read_stream(file, path.name, min(size, LARGEST_ARRAY))
        except OSError as error:
            raise BadInput(f"{path}: {error.strerror or error}", hint=hint) from None
        except BadInput as error:
            raise BadInput(f"{path}: {error}", hint=hint) from None


def _check_shapes(names: tuple[str, ...], arrays: tuple[np.ndarray, ...], shapes: tuple[str, ...]) -> None:
    """Raise BadInput for the first array that has another shape, or holds no numbers."""
    sizes: dict[str, int] = {}
    for name, array, shape in zip(names, arrays, shapes, strict=bool(shapes)):
        axes = shape.split()
        fits = (
            array.ndim == len(axes)
            and array.dtype.kind in "biuf"
            and all(
                length == (int(axis) if axis.isdigit() else sizes.setdefault(axis, length))
                for axis, length in zip(axes, array.shape, strict=True)
            )
        )
        if not fits:
            expected = ", ".join(f"{axis} = {sizes[axis]}" if axis in sizes else axis for axis in axes)
            raise BadInput(f"{name}: shape {array.shape} of {array.dtype}, expected ({expected}) numbers")


def _read_entry(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    try:
        entry = find_entry(archive, name, LARGEST_ARRAY)
    except KeyError:
        raise BadInput(f"has no array {name.removesuffix('.npy')!r}") from None
    with archive.open(entry) as file:
        return _read_stream(file, name, entry.file_size)


def _read_stream(file: IO[bytes], name: str, size: int) -> np.ndarray:
    shape, fortran_order, kind = _read_header(file, name)
    expected = math.prod(shape) * kind.itemsize
    if expected > size:
        raise BadInput(f"{name}: shape {shape} of {kind} needs {expected} bytes, there are {size}")
    data = bytearray()  # grows with what is really there
    while len(data) < expected and (piece := file.read(min(PIECE, expected - len(data)))):
        data += piece
    if len(data) != expected or file.read(1):
        raise BadInput(f"{name}: {len(data)} bytes or more, shape {shape} of {kind} needs {expected}")
    return np.frombuffer(data, dtype=kind).reshape(shape, order="F" if fortran_order else "C")


def _read_header(file: IO[bytes], name: str) -> tuple[tuple[int, ...], bool, np.dtype]:
    readers = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    try:
        version = np.lib.format.read_magic(file)
        shape, fortran_order, kind = readers[version](file, max_header_size=LARGEST_HEADER)
    except Exception as error:  # numpy parses the header as a Python literal and raises whatever that stumbles over
        reason = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{name}: no array header: {reason:.80}") from None
    if kind.hasobject or kind.kind not in PLAIN_KINDS or kind.subdtype is not None:
        raise BadInput(f"{name}: holds {kind}, expected plain numbers or text")
    if len(shape) > 8 or any(length < 0 for length in shape):
        raise BadInput(f"{name}: shape {shape}")
    return shape, bool(fortran_order), kind
