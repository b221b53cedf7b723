"""Depth as ROS compresses it (compressed_depth_image_transport): a header of 12 bytes, then PNG or RVL.

Header, little-endian: int32 kind, float32 A, float32 B. Depth of encoding 16UC1 is stored as it is [mm]; of 32FC1 as
inverse depth v in 16 bits: depth = A / (v - B) [m], v = 0 where there is none. RVL (Wilson, "Fast lossless depth image
compression", 2017): uint32 columns and rows, then 32-bit words of eight 4-bit pieces, most significant first. Numbers
are cut into groups of three bits, the lowest first; the fourth bit says that more follow. In turn: how many pixels are
zero, how many are not, and for each of these its difference from the last one that was not zero, signs folded in.
"""

from __future__ import annotations

import struct

import numpy as np
from scenewright.stages.ingest.images import decode_image
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.formats.foxglove import PNG_START
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE, may_be_decoded

_HEADER = struct.Struct("<iff")
_RVL_SIZE = struct.Struct("<II")
_TRUNCATED, _OVERRUN, _WRONG_VALUE = -1, -2, -3
"""Codes that the compiled decoder returns in place of a count of words."""
_RVL_FAULTS = {
    _TRUNCATED: "the RVL stream ends too early",
    _OVERRUN: "the RVL stream holds more pixels than its header says",
    _WRONG_VALUE: "the RVL stream holds values that are no depth",
}


def is_compressed_depth(encoding: str, data: bytes) -> bool:
    """Whether a compressed image is of this kind, by its `format` or by a PNG after the header."""
    return "compresseddepth" in encoding.lower() or data[_HEADER.size :].startswith(PNG_START)


def decode_compressed_depth(encoding: str, data: bytes) -> np.ndarray:
    """Return depth (H, W): uint16 [mm], or float32 [m] with NaN = invalid, of a message with this `format`.

    Raises Unusable("undecodable_depth") for anything broken, ("depth_not_16_bit") for an 8-bit PNG.
    """
    if len(data) < _HEADER.size:
        raise Unusable("undecodable_depth", f"{len(data)} bytes")
    _, a, b = _HEADER.unpack_from(data)
    body = data[_HEADER.size :]
    stored = decode_rvl(body) if "rvl" in encoding.lower() else _decode_png(body)
    if stored_as(encoding, data) == "16UC1":
        return stored
    if not (np.isfinite(a) and np.isfinite(b) and a > 0):
        raise Unusable("undecodable_depth", f"quantisation A = {a}, B = {b}")
    values = stored.astype(np.float32)
    values -= np.float32(b)
    with np.errstate(divide="ignore", over="ignore"):  # in place: the image may be a large one
        np.divide(np.float32(a), values, out=values)
    values[stored == 0] = np.nan
    return values


def stored_as(encoding: str, data: bytes) -> str:
    """Return `16UC1` or `32FC1`: what the depth was before it was compressed, by the `format`, else by the header."""
    name = encoding.partition(";")[0].strip()
    if name in ("16UC1", "mono16"):
        return "16UC1"
    if name == "32FC1":
        return "32FC1"
    quantised = len(data) >= _HEADER.size and _HEADER.unpack_from(data)[1] != 0
    return "32FC1" if quantised else "16UC1"


def _decode_png(body: bytes) -> np.ndarray:
    if not body.startswith(PNG_START) or not may_be_decoded(body):
        raise Unusable("undecodable_depth", "no PNG of a sensible size after the header of compressed depth")
    image = decode_image(body)
    if image is None:
        raise Unusable("undecodable_depth", f"PNG of {len(body)} bytes")
    if image.dtype != np.uint16 or image.ndim != 2:
        raise Unusable("depth_not_16_bit", f"PNG of shape {image.shape}, {image.dtype}")
    return image


def decode_rvl(body: bytes) -> np.ndarray:
    """Return the (H, W) uint16 of an RVL image with its size in front. Raises Unusable("undecodable_depth")."""
    if len(body) < _RVL_SIZE.size:
        raise Unusable("undecodable_depth", f"{len(body)} bytes of RVL")
    width, height = _RVL_SIZE.unpack_from(body)
    if not 0 < width * height <= LARGEST_IMAGE:
        raise Unusable("undecodable_depth", f"RVL image of {width}x{height}")
    whole_bytes = (len(body) - _RVL_SIZE.size) // 4 * 4
    words = np.frombuffer(body, "<u4", count=whole_bytes // 4, offset=_RVL_SIZE.size).astype(np.int64)
    pixels = np.zeros(height * width, np.uint16)
    fault = _unpack_rvl(words, pixels)
    if fault:
        raise Unusable("undecodable_depth", _RVL_FAULTS[fault])
    return pixels.reshape(height, width)


@compiled
def _number(words: np.ndarray, nibble: int) -> tuple[int, int]:
    """Return the number at a piece, and the next piece; the number is negative when there is none."""
    value, shift = 0, 0
    while True:
        word = nibble >> 3
        if word >= len(words):
            return _TRUNCATED, nibble
        piece = int(words[word] >> (28 - 4 * (nibble & 7))) & 15
        nibble += 1
        value |= (piece & 7) << shift
        if piece < 8:
            return value, nibble
        shift += 3
        if shift > 30:
            return _WRONG_VALUE, nibble


@compiled
def _unpack_rvl(words: np.ndarray, pixels: np.ndarray) -> int:
    """Fill `pixels` (N,) uint16, zeros so far, from RVL words (M,) int64. Return 0, or the fault."""
    position, nibble, last = 0, 0, 0
    while position < len(pixels):
        zeros, nibble = _number(words, nibble)
        if zeros < 0:
            return zeros
        position += zeros
        nonzeros, nibble = _number(words, nibble)
        if nonzeros < 0:
            return nonzeros
        if position + nonzeros > len(pixels):
            return _OVERRUN
        for _ in range(nonzeros):
            folded, nibble = _number(words, nibble)
            if folded < 0:
                return folded
            last += (folded >> 1) ^ -(folded & 1)
            if last <= 0 or last > 65535:
                return _WRONG_VALUE
            pixels[position] = last
            position += 1
    return 0
