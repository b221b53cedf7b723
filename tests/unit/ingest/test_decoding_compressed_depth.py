"""Compressed depth of ROS: PNG and RVL, as stored and as quantised inverse depth."""

from __future__ import annotations

import struct
import time

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from scenewright.stages.ingest.messages.compressed_depth import decode_compressed_depth, decode_rvl
from scenewright.stages.ingest.messages.pixels import depth_pixels, depth_unit
from scenewright.stages.ingest.messages.records import ImageRecord
from scenewright.stages.ingest.source import Unusable

from tests.unit.ingest.rvl_writing import compressed_depth, encode_png, encode_rvl


def _record(encoding: str, data: bytes) -> ImageRecord:
    return ImageRecord(1, "f", encoding, True, 0, 0, 0, False, data)


def _room(height: int = 48, width: int = 64) -> np.ndarray:
    """Return smooth depth with holes [mm]."""
    y, x = np.mgrid[:height, :width]
    depth = (1500 + 8 * x + 5 * y + 30 * np.sin(x / 5)).astype(np.uint16)
    depth[10:20, 5:15] = 0
    depth[-1, -7:] = 0
    return depth


def test_rvl_of_the_smallest_image_by_hand() -> None:
    """No zero, one other, difference +1 -> 2: pieces 0, 1, 2 from the top of the word."""
    assert encode_rvl(np.array([[1]], np.uint16)) == struct.pack("<II", 1, 1) + struct.pack("<I", 0x01200000)
    assert decode_rvl(struct.pack("<III", 1, 1, 0x01200000)).tolist() == [[1]]


def test_rvl_numbers_of_several_pieces_by_hand() -> None:
    """Two zeros, one other of 1000 = 0b11111010000 doubled: groups of three bits from the lowest, 8 = more follow."""
    folded = 2000
    groups = [folded & 7, folded >> 3 & 7, folded >> 6 & 7, folded >> 9 & 7]
    pieces = [2, 1, *(group | 8 for group in groups[:3]), groups[3], 0, 0]
    word = sum(piece << (28 - 4 * i) for i, piece in enumerate(pieces))
    assert decode_rvl(struct.pack("<III", 3, 1, word)).tolist() == [[0, 0, 1000]]


@settings(max_examples=100, deadline=None)
@given(
    arrays.arrays(
        np.uint16,
        st.tuples(st.integers(1, 20), st.integers(1, 20)),
        elements=st.one_of(st.just(0), st.integers(0, 65535), st.sampled_from([1, 65535])),
        fill=st.sampled_from([0, 1, 65535]),
    )
)
def test_rvl_gives_back_any_image(image: np.ndarray) -> None:
    np.testing.assert_array_equal(decode_rvl(encode_rvl(image)), image)


@pytest.mark.parametrize("value", [0, 1, 65535])
def test_rvl_of_constant_images(value: int) -> None:
    image = np.full((480, 640), value, np.uint16)
    np.testing.assert_array_equal(decode_rvl(encode_rvl(image)), image)


def test_rvl_of_noise_and_of_runs() -> None:
    random = np.random.default_rng(5)
    noise = random.integers(0, 65536, (60, 80)).astype(np.uint16)
    runs = np.repeat(random.integers(0, 2, 600) * random.integers(1, 9000, 600), 8).reshape(60, 80).astype(np.uint16)
    for image in (noise, runs, _room()):
        np.testing.assert_array_equal(decode_rvl(encode_rvl(image)), image)


@pytest.mark.parametrize("codec", ["png", "rvl"])
@pytest.mark.parametrize("encoding", ["16UC1; compressedDepth {}", "mono16; compressedDepth {}"])
def test_millimetres_come_back_as_they_were(codec: str, encoding: str) -> None:
    record = _record(encoding.format(codec), compressed_depth(_room(), codec))
    depth = depth_pixels(record)
    assert depth.dtype == np.uint16 and depth_unit(record) == 1000
    np.testing.assert_array_equal(depth, _room())


@pytest.mark.parametrize("encoding", ["16UC1; compressedDepth", "16UC1; compressedDepth ", "16UC1", "png", ""])
def test_png_is_recognised_where_the_format_says_less(encoding: str) -> None:
    record = _record(encoding, compressed_depth(_room(), "png"))
    np.testing.assert_array_equal(depth_pixels(record), _room())
    assert depth_unit(record) == 1000


@pytest.mark.parametrize("codec", ["png", "rvl"])
@pytest.mark.parametrize("encoding", ["32FC1; compressedDepth {}", "compressedDepth {}"])
def test_metres_come_back_within_the_quantisation(codec: str, encoding: str) -> None:
    """One step of inverse depth at depth z is z^2 / A metres."""
    metres = _room().astype(np.float32) / 1000
    metres[metres == 0] = np.nan
    metres[0, 0] = 12.0  # beyond depth_max: not stored
    record = _record(encoding.format(codec), compressed_depth(metres, codec))
    depth = depth_pixels(record)
    assert depth.dtype == np.float32 and depth_unit(record) == 1
    expected = metres.copy()
    expected[0, 0] = np.nan
    np.testing.assert_array_equal(np.isnan(depth), np.isnan(expected))
    error = np.abs(depth - expected)
    assert np.nanmax(error - expected**2 / (100 * 101)) < 1e-5
    assert 0 < np.nanmax(error) < 2e-3


def _rvl(width: int, height: int, *words: int) -> bytes:
    return struct.pack("<iff", 0, 0, 0) + struct.pack(f"<II{len(words)}I", width, height, *words)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "0 bytes"),
        (b"\0" * 11, "11 bytes"),
        (b"\0" * 15, "3 bytes of RVL"),
        (_rvl(0, 5), "0x5"),
        (_rvl(2**31, 2**31), "2147483648x2147483648"),
        (_rvl(60000, 60000, 0), "60000x60000"),
        (_rvl(640, 480), "ends too early"),
        (_rvl(640, 480, 0), "ends too early"),
        (_rvl(640, 480, 0xFFFFFFFF, 0xFFFFFFFF), "no depth"),
        (_rvl(2, 1, 0x03222222), "more pixels"),
        (_rvl(2, 1, 0x70000000), None),  # seven zeros in two pixels: the rest of a run may not matter
        (_rvl(2, 1, 0x02000000), "no depth"),  # a zero among those that are not
        (_rvl(2, 1, 0x02100000), "no depth"),  # -1
    ],
)
def test_lying_rvl(data: bytes, reason: str | None) -> None:
    with pytest.raises(Unusable) as caught:
        decode_compressed_depth("16UC1; compressedDepth rvl", data)
    assert caught.value.reason == "undecodable_depth"
    assert (reason or "more pixels") in caught.value.detail


@pytest.mark.parametrize("parameters", [(0.0, 1.0), (np.nan, 1.0), (1.0, np.inf), (-5.0, 1.0)])
def test_quantisation_that_makes_no_sense(parameters: tuple[float, float]) -> None:
    data = struct.pack("<iff", 0, *parameters) + encode_png(_room())
    with pytest.raises(Unusable, match="quantisation"):
        decode_compressed_depth("32FC1; compressedDepth png", data)


@pytest.mark.parametrize("image", [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3), np.uint16)])
def test_png_of_the_wrong_kind(image: np.ndarray) -> None:
    with pytest.raises(Unusable, match="depth_not_16_bit"):
        decode_compressed_depth("16UC1; compressedDepth png", struct.pack("<iff", 0, 0, 0) + encode_png(image))


def test_jpeg_after_the_header_is_refused() -> None:
    jpeg = cv2.imencode(".jpg", np.zeros((4, 4), np.uint8))[1].tobytes()
    with pytest.raises(Unusable, match="undecodable_depth"):
        decode_compressed_depth("16UC1; compressedDepth jpeg", bytes(12) + jpeg)


def test_rvl_is_decoded_fast_enough_for_recorded_logs() -> None:
    body = encode_rvl(_room(480, 640))
    decode_rvl(body)
    start = time.process_time()
    for _ in range(10):
        decode_rvl(body)
    assert 10 / (time.process_time() - start) > 100
