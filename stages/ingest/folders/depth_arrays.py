"""Depth and disparity kept as float arrays: NumPy `.npy`, Portable Float Map `.pfm`, COLMAP's dense `.bin` maps.

What a file declares is held against its size before anything is allocated.
"""

from __future__ import annotations

import io
import re

import numpy as np
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE

ARRAY_SUFFIXES = (".npy", ".pfm", ".bin")
PFM = re.compile(rb"Pf\s+(\d{1,6})\s+(\d{1,6})\s+(-?[0-9.eE+-]{1,20})\s")
COLMAP = re.compile(rb"(\d{1,6})&(\d{1,6})&1&")
NPY_HEADER = 4096
"""Bytes of an .npy file within which its header ends."""


def depth_array(data: bytes, suffix: str) -> np.ndarray:
    """Return the (H, W) array in the bytes of a file with one of ARRAY_SUFFIXES, float32, float64 or uint16, in the
    file's own unit. Raises Unusable."""
    reader = {".npy": _npy, ".pfm": _pfm, ".bin": _colmap}[suffix]
    return reader(data)


def _npy(data: bytes) -> np.ndarray:
    stream = io.BytesIO(data[:NPY_HEADER])
    try:
        version = np.lib.format.read_magic(stream)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[
            version
        ]
        shape, fortran_order, kind = read_header(stream)
    except Exception as error:  # numpy parses the header as a Python literal and raises whatever that stumbles over
        raise Unusable("undecodable_depth", f"no .npy array ({error})"[:200]) from None
    shape = tuple(size for size in shape if size != 1) if len(shape) == 3 else shape
    if kind not in (np.dtype("<f4"), np.dtype("<f8"), np.dtype("<u2"), np.dtype("<f2")):
        raise Unusable("depth_not_16_bit", f"array of type {kind}")
    image = _pixels(data[stream.tell() :], shape, kind)
    if fortran_order:
        image = image.reshape(shape[::-1]).T
    return image.astype(np.float32) if kind == np.dtype("<f2") else image


def _pfm(data: bytes) -> np.ndarray:
    match = PFM.match(data)
    if match is None:
        raise Unusable("undecodable_depth", "no grey Portable Float Map")
    try:
        big_endian = float(match[3]) > 0
    except ValueError:
        raise Unusable("undecodable_depth", "the scale of the Portable Float Map is not a number") from None
    image = _pixels(data[match.end() :], (int(match[2]), int(match[1])), np.dtype(">f4" if big_endian else "<f4"))
    return np.flipud(image).astype(np.float32)  # rows go from the bottom up


def _colmap(data: bytes) -> np.ndarray:
    match = COLMAP.match(data)
    if match is None:
        raise Unusable("undecodable_depth", "no COLMAP depth map of one channel")
    return _pixels(data[match.end() :], (int(match[2]), int(match[1])), np.dtype("<f4"))


def _pixels(data: bytes, shape: tuple[int, ...], kind: np.dtype) -> np.ndarray:
    if len(shape) != 2 or not 0 < shape[0] * shape[1] <= LARGEST_IMAGE:
        raise Unusable("undecodable_depth", f"array of shape {shape}")
    needed = shape[0] * shape[1] * kind.itemsize
    if len(data) < needed:
        raise Unusable("undecodable_depth", f"{len(data)} bytes for {shape[1]}x{shape[0]} pixels of {kind}")
    return np.frombuffer(data[:needed], kind).reshape(shape)
