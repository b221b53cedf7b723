"""Image messages become the pixels that were recorded, whatever their encoding."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from scenewright.stages.ingest.messages.pixels import (
    color_pixels,
    depth_pixels,
    depth_unit,
    label_pixels,
    role_of,
    why_other,
)
from scenewright.stages.ingest.messages.records import ImageRecord
from scenewright.stages.ingest.source import Unusable

COLOR = np.random.default_rng(3).integers(0, 256, (6, 8, 3)).astype(np.uint8)
"""RGB."""
SMOOTH = np.dstack([*np.mgrid[40:200:4, 30:222:4], np.full((40, 48), 90)]).astype(np.uint8)
"""RGB that survives JPEG and colour subsampling."""
MILLIMETRES = np.random.default_rng(4).integers(0, 65536, (6, 8)).astype(np.uint16)


def raw(image: np.ndarray, encoding: str, *, padding: int = 0, big_endian: bool = False, **changes: Any) -> ImageRecord:
    """Return a raw image; `image` is (H, W, ...) or for planar encodings whatever has the right bytes."""
    height, width = image.shape[:2]
    if big_endian:
        image = image.astype(image.dtype.newbyteorder(">"))
    rows = np.ascontiguousarray(image).view(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=170)
    fields = {"width": width, "height": height, "step": rows.shape[1], "data": rows.tobytes()} | changes
    return ImageRecord(
        stamp=1,
        frame_id="f",
        encoding=encoding,
        compressed=False,
        big_endian=big_endian,
        **fields,  # type: ignore
    )


def compressed(data: bytes, encoding: str = "jpeg") -> ImageRecord:
    return ImageRecord(1, "f", encoding, True, 0, 0, 0, False, data)


def encoded(image: np.ndarray, suffix: str = ".png") -> bytes:
    """Return an RGB, grey or RGBA image as an ordinary file."""
    if image.ndim == 3:
        image = image[..., [2, 1, 0, 3][: image.shape[2]]]
    return cv2.imencode(suffix, image)[1].tobytes()


# --- raw colour ------------------------------------------------------------------------------------------------

ALPHA = np.full((6, 8, 1), 7, np.uint8)


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "stored"),
    [
        ("rgb8", COLOR),
        ("bgr8", COLOR[..., ::-1]),
        ("8UC3", COLOR[..., ::-1]),
        ("RGB8", COLOR),
        ("rgba8", np.dstack([COLOR, ALPHA])),
        ("bgra8", np.dstack([COLOR[..., ::-1], ALPHA])),
        ("8UC4", np.dstack([COLOR[..., ::-1], ALPHA])),
        ("rgb16", COLOR.astype(np.uint16) * 256 + 13),
        ("bgr16", COLOR[..., ::-1].astype(np.uint16) * 256 + 13),
    ],
)
def test_packed_colors(encoding: str, stored: np.ndarray, padding: int) -> None:
    np.testing.assert_array_equal(color_pixels(raw(stored, encoding, padding=padding)), COLOR)
    np.testing.assert_array_equal(color_pixels(raw(stored, encoding, padding=padding, big_endian=True)), COLOR)


@pytest.mark.parametrize(
    ("encoding", "stored"),
    [("mono8", COLOR[..., 0]), ("8UC1", COLOR[..., 0]), ("mono16", COLOR[..., 0].astype(np.uint16) * 256 + 99)],
)
def test_grey_becomes_three_equal_channels(encoding: str, stored: np.ndarray) -> None:
    for big_endian in (False, True):
        image = color_pixels(raw(stored, encoding, big_endian=big_endian, padding=3))
        np.testing.assert_array_equal(image, np.repeat(COLOR[..., :1], 3, axis=2))


def test_a_step_of_zero_means_rows_without_padding() -> None:
    np.testing.assert_array_equal(color_pixels(raw(COLOR, "rgb8", step=0)), COLOR)


def test_the_last_row_need_not_be_padded() -> None:
    record = raw(COLOR, "rgb8", padding=5)
    np.testing.assert_array_equal(color_pixels(raw(COLOR, "rgb8", step=record.step, data=record.data[:-5])), COLOR)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_mosaics(pattern: str) -> None:
    """A mosaic of one colour gives that colour; its letters are the first row, then the second, from the left."""
    for color in ((200, 100, 30), (10, 220, 90), (90, 20, 250)):
        values = [color["rgb".index(letter)] for letter in pattern]
        mosaic = np.tile(np.array(values, np.uint8).reshape(2, 2), (8, 10))
        image = color_pixels(raw(mosaic, f"bayer_{pattern}8", padding=2))
        assert isinstance(image, np.ndarray) and image.shape == (16, 20, 3)
        np.testing.assert_array_equal(image[2:-2, 2:-2], np.broadcast_to(np.array(color, np.uint8), (12, 16, 3)))


def _bt601(color: np.ndarray) -> np.ndarray:
    """Return Y, U, V of RGB in the limited range of ITU-R BT.601, written out."""
    r, g, b = (color[..., i].astype(float) for i in range(3))
    y = 16 + (65.481 * r + 128.553 * g + 24.966 * b) / 255
    u = 128 + (-37.797 * r - 74.203 * g + 112.0 * b) / 255
    v = 128 + (112.0 * r - 93.786 * g - 18.214 * b) / 255
    return np.rint(np.stack([y, u, v], axis=-1)).astype(np.uint8)


@pytest.mark.parametrize("encoding", ["yuv422", "uyvy", "yuv422_yuy2", "yuyv", "yuy2", "nv12", "nv21"])
def test_brightness_and_color_planes(encoding: str) -> None:
    blocks = np.array([[[200, 40, 60], [30, 180, 90]], [[20, 60, 210], [128, 128, 128]]], np.uint8)
    color = np.repeat(np.repeat(blocks, 4, axis=0), 6, axis=1)
    yuv = _bt601(color)
    height, width = color.shape[:2]
    y, u, v = yuv[..., 0], yuv[:, ::2, 1], yuv[:, ::2, 2]
    if encoding.startswith("nv"):
        chroma = np.stack([u[::2], v[::2]] if encoding == "nv12" else [v[::2], u[::2]], axis=-1).reshape(-1, width)
        record = raw(np.vstack([y, chroma]), encoding, padding=4, height=height)
    else:
        quads = np.stack([y[:, ::2], u, y[:, 1::2], v], axis=-1)
        if encoding in ("yuv422", "uyvy"):
            quads = np.stack([u, y[:, ::2], v, y[:, 1::2]], axis=-1)
        record = raw(quads.reshape(height, width, 2), encoding, padding=4)
    image = color_pixels(record)
    assert isinstance(image, np.ndarray)
    assert np.abs(image.astype(int) - color).max() <= 3


# --- raw depth and labels --------------------------------------------------------------------------------------


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("encoding", ["16UC1", "mono16"])
def test_depth_in_millimetres(encoding: str, big_endian: bool) -> None:
    record = raw(MILLIMETRES, encoding, padding=6, big_endian=big_endian)
    depth = depth_pixels(record)
    assert depth.dtype == np.uint16 and depth.dtype.isnative and depth_unit(record) == 1000
    np.testing.assert_array_equal(depth, MILLIMETRES)


@pytest.mark.parametrize("big_endian", [False, True])
def test_depth_in_metres(big_endian: bool) -> None:
    metres = MILLIMETRES.astype(np.float32) / 1000
    metres[0] = np.nan, np.inf, -np.inf, 0, -1, 1e30, 1, 2
    record = raw(metres, "32FC1", padding=8, big_endian=big_endian)
    depth = depth_pixels(record)
    assert depth.dtype == np.float32 and depth.dtype.isnative and depth_unit(record) == 1
    np.testing.assert_array_equal(depth, metres)


@pytest.mark.parametrize("encoding", ["mono8", "8UC1", "rgb8", "bgr8"])
def test_8_bit_depth_is_refused(encoding: str) -> None:
    with pytest.raises(Unusable, match="depth_not_16_bit"):
        depth_pixels(raw(COLOR if "8UC1" not in encoding else COLOR[..., 0], encoding))
    with pytest.raises(Unusable, match="depth_not_16_bit"):
        depth_pixels(compressed(encoded(COLOR[..., 0]), "png"))
    with pytest.raises(Unusable, match="depth_not_16_bit"):
        depth_pixels(compressed(encoded(COLOR, ".jpg")))


@pytest.mark.parametrize(
    ("encoding", "dtype"), [("mono8", "u1"), ("8UC1", "u1"), ("mono16", "u2"), ("16UC1", "u2"), ("32SC1", "i4")]
)
def test_labels(encoding: str, dtype: str) -> None:
    labels = (MILLIMETRES % 200).astype(dtype)
    image = label_pixels(raw(labels, encoding, padding=3 * np.dtype(dtype).itemsize))
    assert image.dtype == np.uint16
    np.testing.assert_array_equal(image, labels)


@pytest.mark.parametrize("value", [-1, 70000])
def test_labels_beyond_16_bits(value: int) -> None:
    with pytest.raises(Unusable, match="undecodable_labels"):
        label_pixels(raw(np.full((2, 2), value, np.int32), "32SC1"))


def test_compressed_depth_and_labels() -> None:
    record = compressed(encoded(MILLIMETRES), "16UC1; png compressed ")
    np.testing.assert_array_equal(depth_pixels(record), MILLIMETRES)
    assert depth_unit(record) == 1000
    np.testing.assert_array_equal(label_pixels(record), MILLIMETRES)
    np.testing.assert_array_equal(label_pixels(compressed(encoded(COLOR[..., 0]), "png")), COLOR[..., 0])
    for data in (encoded(COLOR), encoded(COLOR, ".jpg"), b"", b"\x89PNG"):
        with pytest.raises(Unusable, match="undecodable_labels"):
            label_pixels(compressed(data, "png"))


# --- compressed colour -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "encoding", ["jpeg", "jpg", "rgb8; jpeg compressed bgr8", "bgr8; jpeg compressed bgr8", "rgb8; jpeg compressed", ""]
)
def test_ordinary_jpeg_is_kept_as_it_is(encoding: str) -> None:
    data = encoded(SMOOTH, ".jpg")
    assert color_pixels(compressed(data, encoding)) == data
    grey = encoded(SMOOTH[..., 0], ".jpg")
    assert color_pixels(compressed(grey, "mono8; jpeg compressed ")) == grey


def test_ordinary_png_is_kept_as_it_is() -> None:
    data = encoded(COLOR)
    assert color_pixels(compressed(data, "bgr8; png compressed bgr8")) == data


@pytest.mark.parametrize("stored", [COLOR[..., 0], np.dstack([COLOR, ALPHA]), COLOR.astype(np.uint16) * 257])
def test_other_png_becomes_rgb(stored: np.ndarray) -> None:
    image = color_pixels(compressed(encoded(stored), "png"))
    expected = COLOR if stored.ndim == 3 else np.repeat(COLOR[..., :1], 3, axis=2)
    np.testing.assert_array_equal(image, expected)


@pytest.mark.parametrize("encoding", ["rgb8; png compressed rgb8", "bgr8; png compressed rgb8"])
def test_files_that_were_written_with_red_and_blue_exchanged(encoding: str) -> None:
    """What the publisher called rgb went into an encoder that takes bgr: the file shows red as blue."""
    data = cv2.imencode(".png", COLOR)[1].tobytes()
    np.testing.assert_array_equal(color_pixels(compressed(data, encoding)), COLOR)


def test_jpeg_with_red_and_blue_exchanged() -> None:
    data = cv2.imencode(".jpg", SMOOTH)[1].tobytes()
    image = color_pixels(compressed(data, "rgb8; jpeg compressed rgb8"))
    assert isinstance(image, np.ndarray) and np.abs(image.astype(int) - SMOOTH).max() < 12


def test_webp_becomes_rgb() -> None:
    data = cv2.imencode(".webp", COLOR[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 101])[1].tobytes()
    np.testing.assert_array_equal(color_pixels(compressed(data, "webp")), COLOR)


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_an_image_cut_anywhere_is_noticed(suffix: str) -> None:
    """Decoders fill up a cut JPEG with grey and say nothing."""
    whole = encoded(SMOOTH, suffix)
    assert color_pixels(compressed(whole)) == whole
    for cut in (*range(0, len(whole) - 2, 53), len(whole) - 1, len(whole) - 2):
        with pytest.raises(Unusable) as caught:
            color_pixels(compressed(whole[:cut]))
        assert caught.value.reason == "undecodable_color"
    with pytest.raises(Unusable, match="truncated"):
        color_pixels(compressed(whole[: len(whole) * 3 // 4]))


def test_bytes_after_the_end_do_no_harm() -> None:
    for suffix in (".jpg", ".png"):
        data = encoded(SMOOTH, suffix) + b"\0\0\0"
        assert color_pixels(compressed(data)) == data


def test_a_thumbnail_within_a_cut_jpeg_is_no_end() -> None:
    whole = encoded(SMOOTH, ".jpg")
    thumbnail = b"\xff\xe1" + struct.pack(">H", 2 + len(whole)) + whole
    assert color_pixels(compressed(whole[:2] + thumbnail + whole[2:])) == whole[:2] + thumbnail + whole[2:]
    with pytest.raises(Unusable, match="truncated"):
        color_pixels(compressed(whole[:2] + thumbnail + whole[2:-30]))


def test_a_flipped_byte_in_a_png_is_found() -> None:
    whole = encoded(SMOOTH)
    for place in range(8, len(whole), 37):
        data = bytearray(whole)
        data[place] ^= 4
        with pytest.raises(Unusable, match="undecodable_color"):
            color_pixels(compressed(bytes(data), "png"))


def _png_header(width: int, height: int) -> bytes:
    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")


@pytest.mark.parametrize("size", [(60000, 60000), (2**31 - 1, 2), (0, 5)])
def test_png_that_claims_an_absurd_size(size: tuple[int, int]) -> None:
    record = compressed(_png_header(*size), "png")
    for read, reason in ((color_pixels, "color"), (depth_pixels, "depth"), (label_pixels, "labels")):
        with pytest.raises(Unusable, match=f"undecodable_{reason}.*claims {size[0]}x{size[1]}"):
            read(record)


def test_jpeg_that_claims_an_absurd_size() -> None:
    data = bytearray(encoded(SMOOTH, ".jpg"))
    place = data.index(b"\xff\xc0")
    data[place + 5 : place + 9] = struct.pack(">HH", 65500, 65500)
    with pytest.raises(Unusable, match="claims 65500x65500"):
        color_pixels(compressed(bytes(data)))


# --- lies ------------------------------------------------------------------------------------------------------

LIES: dict[str, Callable[[int], dict[str, Any]]] = {
    "no width": lambda row: {"width": 0},
    "no height": lambda row: {"height": 0},
    "nothing": lambda row: {"width": 0, "height": 0, "step": 0, "data": b""},
    "step too short": lambda row: {"step": row - 1},
    "step too long": lambda row: {"step": row + 1},
    "largest step": lambda row: {"step": 2**32 - 1},
    "too high": lambda row: {"height": 7},
    "too wide": lambda row: {"width": 9},
    "no data": lambda row: {"data": b""},
    "a byte too few": lambda row: {"data": bytes(6 * row - 1)},
    "largest size": lambda row: {"width": 2**32 - 1, "height": 2**32 - 1, "step": 0},
    "large size": lambda row: {"width": 2**16, "height": 2**16, "step": 1},
}


@pytest.mark.parametrize("lie", sorted(LIES))
def test_raw_images_that_lie_about_their_size(lie: str) -> None:
    with pytest.raises(Unusable, match="undecodable_color"):
        color_pixels(raw(COLOR, "rgb8", **LIES[lie](24)))
    with pytest.raises(Unusable, match="undecodable_depth"):
        depth_pixels(raw(MILLIMETRES, "16UC1", **LIES[lie](16)))


@pytest.mark.parametrize("encoding", ["nv12", "nv21"])
def test_planes_of_odd_size(encoding: str) -> None:
    with pytest.raises(Unusable, match="odd size"):
        color_pixels(raw(np.zeros((9, 7), np.uint8), encoding, height=6))


@pytest.mark.parametrize("shape", [(1, 1), (1, 2), (2, 1), (2, 2), (3, 1)])
@pytest.mark.parametrize("encoding", ["bayer_rggb8", "uyvy", "yuyv", "nv12", "rgb8"])
def test_tiny_images_decode_or_are_unusable(shape: tuple[int, int], encoding: str) -> None:
    record = raw(np.zeros((*shape, 3), np.uint8), encoding)
    try:
        image = color_pixels(record)
    except Unusable as error:
        assert error.reason == "undecodable_color"
    else:
        assert isinstance(image, np.ndarray) and image.shape == (*shape, 3)


@pytest.mark.parametrize("encoding", ["", "bayer_rggb16", "TYPE_32FC1", "rgb8 ", "x" * 10_000])
def test_unknown_encodings(encoding: str) -> None:
    record = raw(COLOR, encoding)
    for read in (color_pixels, depth_pixels, label_pixels):
        with pytest.raises(Unusable, match="unknown_encoding") as caught:
            read(record)
        assert len(str(caught.value)) < 120
    assert role_of(record, "/camera/color") == "other" and "unknown encoding" in why_other(record, "/camera/color")


def test_video_in_a_compressed_image() -> None:
    with pytest.raises(Unusable, match="unknown_encoding"):
        color_pixels(compressed(b"\0\0\0\1\x67", "h264"))
    assert role_of(compressed(b"\0\0\0\1\x67", "h264"), "/camera/color") == "other"


# --- roles -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("encoding", "topic", "role"),
    [
        ("rgb8", "/camera/color/image_raw", "color"),
        ("bgr8", "/anything", "color"),
        ("bayer_grbg8", "/camera/image_raw", "color"),
        ("nv12", "/camera/image_raw", "color"),
        ("mono8", "/stereo/left/image_rect", "color"),
        ("mono8", "/camera/infra1/image_rect_raw", "color"),
        ("mono8", "/camera/depth/image_raw", "depth"),  # and refused there, as depth of 8 bits
        ("16UC1", "/camera/depth/image_rect_raw", "depth"),
        ("16UC1", "/anything", "depth"),
        ("16UC1", "/camera/aligned_depth_to_color/image_raw", "depth"),
        ("16UC1", "/k4a/depth_to_rgb/image_raw", "depth"),
        ("16UC1", "/k4a/depth2rgb/image", "depth"),
        ("16UC1", "/camera/ir/image_raw", "other"),
        ("32FC1", "/camera/depth_registered/image", "depth"),
        ("32FC1", "/anything", "depth"),
        ("32FC1", "/stereo/disparity/image", "other"),
        ("mono16", "/camera/deviation", "other"),
        ("mono16", "/camera/depth", "depth"),
        ("mono16", "/device_0/sensor_0/Depth_0/image/data", "depth"),
        ("mono16", "/camera/ir/image_raw", "color"),
        ("rgb8", "/depth_camera/image_raw", "color"),
        ("rgb8", "/depth_camera/color/image_raw", "color"),
        ("16UC1", "/depth_camera/image_raw", "depth"),
        ("rgb8", "/camera/depth/image_rect_raw", "other"),
        ("rgb8", "/camera/depth/color_colorized", "other"),
        ("mono16", "/camera/labels", "labels"),
        ("mono8", "/segmentation/instances", "labels"),
        ("32SC1", "/semantic/image", "labels"),
        ("rgb8", "/segmentation/masks", "other"),
        ("rgb8", "/segmentation/color/overlay", "other"),
        ("32SC1", "/camera/image", "other"),
    ],
)
def test_roles_of_raw_images(encoding: str, topic: str, role: str) -> None:
    record = raw(COLOR, encoding)
    assert role_of(record, topic) == role
    assert bool(why_other(record, topic)) == (role == "other")


DEPTH_PNG, GREY_PNG, COLOR_PNG, JPEG = (
    encoded(MILLIMETRES),
    encoded(COLOR[..., 0]),
    encoded(COLOR),
    encoded(COLOR, ".jpg"),
)


@pytest.mark.parametrize(
    ("data", "encoding", "topic", "role"),
    [
        (JPEG, "jpeg", "/camera/image/compressed", "color"),
        (JPEG, "rgb8; jpeg compressed bgr8", "/camera/color/image_raw/compressed", "color"),
        (JPEG, "jpeg", "/camera/depth/image_raw/compressed", "other"),
        (JPEG, "jpeg", "/depth_camera/image/compressed", "color"),
        (COLOR_PNG, "png", "/camera/image", "color"),
        (COLOR_PNG, "png", "/camera/depth/image", "other"),
        (DEPTH_PNG, "png", "/camera/depth/image", "depth"),
        (GREY_PNG, "png", "/camera/depth/image", "depth"),  # and refused there, as depth of 8 bits
        (DEPTH_PNG, "16UC1; png compressed ", "/anything", "depth"),
        (bytes(12) + DEPTH_PNG, "16UC1; compressedDepth png", "/anything", "depth"),
        (bytes(12) + DEPTH_PNG, "png", "/anything", "depth"),
        (b"", "32FC1; compressedDepth rvl", "/anything", "depth"),
        (GREY_PNG, "png", "/camera/instances", "labels"),
        (JPEG, "jpeg", "/camera/instances", "other"),
        (DEPTH_PNG, "png", "/stereo/disparity", "other"),
    ],
)
def test_roles_of_compressed_images(data: bytes, encoding: str, topic: str, role: str) -> None:
    record = compressed(data, encoding)
    assert role_of(record, topic) == role
    assert bool(why_other(record, topic)) == (role == "other")
