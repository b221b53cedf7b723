"""Writes depth as ROS compresses it: the encoder that the decoder under test is the inverse of."""

from __future__ import annotations

import struct

import cv2
import numpy as np


def encode_rvl(image: np.ndarray) -> bytes:
    """Return the RVL stream of an (H, W) uint16 image, size in front (Wilson 2017)."""
    pieces: list[int] = []

    def put(number: int) -> None:
        while True:
            number, piece = number >> 3, number & 7
            pieces.append(piece | 8 if number else piece)
            if not number:
                return

    flat = image.reshape(-1).astype(int).tolist()
    place, last = 0, 0
    while place < len(flat):
        start = place
        while place < len(flat) and flat[place] == 0:
            place += 1
        put(place - start)
        start = place
        while place < len(flat) and flat[place] != 0:
            place += 1
        put(place - start)
        for value in flat[start:place]:
            difference, last = value - last, value
            put(2 * difference if difference >= 0 else -2 * difference - 1)
    pieces += [0] * (-len(pieces) % 8)
    words = np.array(pieces, np.uint32).reshape(-1, 8) @ (np.uint32(1) << np.arange(28, -1, -4, dtype=np.uint32))
    return struct.pack("<II", image.shape[1], image.shape[0]) + words.astype("<u4").tobytes()


def encode_png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def compressed_depth(image: np.ndarray, codec: str, *, depth_max: float = 10.0, quantisation: float = 100.0) -> bytes:
    """Return a compressedDepth message body of uint16 [mm] or float32 [m] depth; `codec` is `png` or `rvl`."""
    a = b = 0.0
    if image.dtype == np.float32:
        a = quantisation * (quantisation + 1)
        b = 1 - a / depth_max
        with np.errstate(divide="ignore", invalid="ignore"):
            image = np.where(image < depth_max, a / image + b, 0).astype(np.uint16)
    body = encode_png(image) if codec == "png" else encode_rvl(image)
    return struct.pack("<iff", 0, a, b) + body
