"""The declared size of an image is what a decoder finds; a lying header is refused before decoding."""

from __future__ import annotations

import io
import struct

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE, image_size, may_be_decoded


def _encoded(suffix: str, shape: tuple[int, ...], kind: type = np.uint8) -> bytes:
    return cv2.imencode(suffix, np.full(shape, 7, kind))[1].tobytes()


KINDS = {
    "png": _encoded(".png", (37, 53, 3)),
    "png 16 bit": _encoded(".png", (37, 53), np.uint16),
    "jpeg": _encoded(".jpg", (37, 53, 3)),
    "pgm 16 bit": _encoded(".pgm", (37, 53), np.uint16),
    "ppm": _encoded(".ppm", (37, 53, 3)),
    "tiff": _encoded(".tiff", (37, 53), np.uint16),
    "bmp": _encoded(".bmp", (37, 53, 3)),
    "webp": _encoded(".webp", (37, 53, 3)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_size_of_every_kind(kind: str) -> None:
    assert image_size(KINDS[kind]) == (53, 37) and may_be_decoded(KINDS[kind])


@pytest.mark.parametrize(
    "options",
    [
        {"format": "JPEG", "progressive": True},
        {"format": "JPEG", "exif": b"Exif\0\0" + bytes(500)},
        {"format": "TIFF", "compression": "tiff_lzw"},
        {"format": "TIFF", "big_tiff": True},
        {"format": "WEBP", "lossless": True},
        {"format": "WEBP", "exif": b"Exif\0\0" + bytes(50)},
        {"format": "PNG"},
    ],
    ids=str,
)
def test_against_another_encoder(options: dict) -> None:
    stream = io.BytesIO()
    Image.new("RGB", (53, 37), (9, 8, 7)).save(stream, **options)
    assert image_size(stream.getvalue()) == (53, 37)


def test_pnm_comments_and_big_endian_tiff() -> None:
    assert image_size(b"P5\n# 12 13\n 53 # wide\n37\n65535\n") == (53, 37)
    entries = struct.pack(">HHIHH", 256, 3, 1, 53, 0) + struct.pack(">HHII", 257, 4, 1, 37)
    assert image_size(b"MM\0*" + struct.pack(">IH", 8, 2) + entries) == (53, 37)


def test_lying_headers_are_refused() -> None:
    png = bytearray(KINDS["png"])
    png[16:24] = struct.pack(">II", 60_000, 60_000)
    assert image_size(png) == (60_000, 60_000) and not may_be_decoded(png)
    png[16:24] = struct.pack(">II", 0, 37)
    assert not may_be_decoded(png)
    png[16:24] = struct.pack(">II", LARGEST_IMAGE, 1)
    assert not may_be_decoded(png)  # its few bytes cannot unpack to that
    black = cv2.imencode(".png", np.zeros((4000, 5000), np.uint8))[1].tobytes()
    assert len(black) < 100_000 and may_be_decoded(black) and not may_be_decoded(black[:-20])
    long_chunk = bytearray(KINDS["png"])
    place = long_chunk.find(b"IDAT") - 4
    long_chunk[place : place + 4] = b"\xff\0\0\x34"  # four gigabytes, which a decoder would reserve
    assert not may_be_decoded(long_chunk)
    assert not may_be_decoded(b"P5 99999 99999 65535\n")
    jpeg = bytearray(KINDS["jpeg"])
    place = jpeg.find(b"\xff\xc0")
    jpeg[place + 5 : place + 9] = b"\xff\xff\xff\xff"
    assert image_size(jpeg) == (65535, 65535) and not may_be_decoded(jpeg)


@pytest.mark.parametrize("kind", KINDS)
def test_cut_headers_and_flipped_bytes_end_quietly(kind: str) -> None:
    data = KINDS[kind]
    for end in range(min(len(data), 400)):
        assert image_size(data[:end]) in (None, (53, 37), (53, 3), (5, 37), (5, 3))
    for place in range(min(len(data), 200)):
        damaged = bytearray(data)
        damaged[place] ^= 0xFF
        image_size(damaged)


@given(st.binary(max_size=300), st.sampled_from([b"", *(data[:12] for data in KINDS.values())]))
def test_any_bytes(tail: bytes, start: bytes) -> None:
    size = image_size(start + tail)
    assert size is None or (size[0] >= 0 and size[1] >= 0)
