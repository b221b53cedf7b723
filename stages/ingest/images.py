"""Checks and decoding of the colour and depth images of a log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.parameters import DepthBits
from scenewright.stages.ingest.source import Unusable
from scenewright.stages.kit.formats.exif import TRANSPOSED, orientation_of, turned
from scenewright.stages.kit.formats.foxglove import JPEG_START, PNG_START, decode_color, depth_to_millimetres
from scenewright.stages.kit.formats.image_headers import image_size, may_be_decoded

INVALID_DEPTH = 65535
"""16-bit depth that some cameras write for "nothing measured" [stored units]."""
STORED: dict[DepthBits, Callable[[np.ndarray], np.ndarray]] = {
    "as-is": lambda image: image,
    "swapped": lambda image: image.byteswap(),
    "rotated": lambda image: (image >> np.uint16(3)) | (image << np.uint16(13)),
}
"""How the 16 bits of depth are stored -> what makes numbers of them. SUN3D rotates them by three."""


@dataclass(frozen=True)
class DepthForm:
    """How depth images hold depth."""

    units_per_metre: float = 1000.0
    bits: DepthBits = "as-is"
    """Of 16-bit images; float ones are what they are."""


def usable_color(data: bytes, camera: Camera, *, decoded: bool = False) -> np.ndarray | bytes:
    """Return colour of the camera's size: JPEG and 8-bit PNG bytes as they are, anything else, and all where it is
    wanted `decoded`, as (H, W, 3) uint8 RGB.

    A picture of another size and the same aspect ratio is resized. Raises Unusable.
    """
    image = decode_as_calibrated(data, (camera.width, camera.height))
    if image is None:
        raise Unusable("undecodable_color", f"{len(data)} bytes")
    return data if not decoded and is_kept(data, image, camera) else fitted_color(image, camera)


def is_kept(data: bytes, image: np.ndarray, camera: Camera) -> bool:
    """Whether the bytes of an `image` (H, W, 3) as it was decoded are, as they are, a picture of the camera."""
    if orientation_of(data) in TRANSPOSED and image_size(data) != (image.shape[1], image.shape[0]):
        return False
    return image.shape[:2] == (camera.height, camera.width) and _is_plain(data)


def decode_as_calibrated(data: bytes, size: tuple[int, int]) -> np.ndarray | None:
    """Return the picture in some bytes, (H, W, 3) uint8 RGB, None when it cannot be decoded.

    Calibrations are of the pixels as they are stored. Only where pictures of `size` (width, height) have another shape,
    and the EXIF orientation gives it that shape, the calibration is of the picture as it is looked at: it is turned.
    """
    image = decode_color(data)
    if image is None or (orientation := orientation_of(data)) not in TRANSPOSED:
        return image
    stored, looked_at = (image.shape[1], image.shape[0]), (image.shape[0], image.shape[1])
    return turned(image, orientation) if same_shape(looked_at, size) and not same_shape(stored, size) else image


def same_shape(first: tuple[int, int], second: tuple[int, int]) -> bool:
    """Whether two sizes are of one shape, to a pixel."""
    return abs(first[0] * second[1] - first[1] * second[0]) <= max(*first, *second)


def _is_plain(data: bytes) -> bool:
    """Whether every viewer shows these bytes as the same picture: JPEG, or PNG of 8-bit RGB (header, colour type 2)."""
    return data.startswith(JPEG_START) or (data.startswith(PNG_START) and data[24:26] == b"\x08\x02")


def fitted_color(image: np.ndarray, camera: Camera) -> np.ndarray:
    """Return an RGB image (H, W, 3) at the camera's size. Raises Unusable when the aspect ratio differs."""
    height, width = image.shape[:2]
    if (height, width) == (camera.height, camera.width):
        return np.ascontiguousarray(image)
    if not camera.width * camera.height or abs(width * camera.height - height * camera.width) > max(
        camera.height, camera.width
    ):
        raise Unusable("size_mismatch", f"colour {width}x{height}, depth {camera.width}x{camera.height}")
    shrinks = width > camera.width
    size = (camera.width, camera.height)
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)


def decode_image(data: bytes) -> np.ndarray | None:
    """Decode image bytes without any conversion; None when that is impossible, or when they declare too many pixels."""
    if not may_be_decoded(data):
        return None
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None


def usable_depth(data: bytes, camera: Camera, form: DepthForm) -> np.ndarray:
    """Decode a 16-bit depth image (PNG, PGM, TIFF) to (H, W) uint16 [mm]. Raises Unusable."""
    image = decode_image(data)
    if image is None:
        raise Unusable("undecodable_depth", f"{len(data)} bytes")
    if image.dtype == np.uint8:
        raise Unusable("depth_not_16_bit", "8-bit image, probably a picture of depth made for people")
    return depth_millimetres(image, camera, form)


def depth_roughness(depth: np.ndarray) -> float:
    """Return the mean difference of neighbours in a row of a depth image (H, W) uint16, as a share of the larger.

    Of real sensors it is 0.001 to 0.01; bytes in the wrong order make 10 to 80 times that of it. 0 without neighbours.
    """
    left, right = depth[:, :-1].astype(np.float32), depth[:, 1:].astype(np.float32)
    valid = (left > 0) & (right > 0)
    left, right = left[valid], right[valid]
    return float((np.abs(left - right) / np.maximum(left, right)).mean()) if len(left) else 0.0


def depth_millimetres(image: np.ndarray, camera: Camera, form: DepthForm) -> np.ndarray:
    """Return (H, W) uint16 [mm] of a depth image, (H, W) uint16 or float, of some form.

    0, 65535 (of 16-bit images), NaN, infinite and negative depth become 0. Raises Unusable for another size, for
    several channels, and when no pixel is valid.
    """
    if image.ndim != 2 or image.dtype not in (np.uint16, np.float32, np.float64):
        raise Unusable("depth_not_16_bit", f"depth image of shape {image.shape}, {image.dtype}")
    if image.shape != (camera.height, camera.width):
        raise Unusable(
            "size_mismatch", f"depth {image.shape[1]}x{image.shape[0]}, camera {camera.width}x{camera.height}"
        )
    units = form.units_per_metre
    if image.dtype == np.uint16:
        image = STORED[form.bits](np.where(image == INVALID_DEPTH, np.uint16(0), image))
        millimetres = image if units == 1000 else depth_to_millimetres(image / np.float32(units))
    else:
        millimetres = depth_to_millimetres(image / np.float32(units))
    if not millimetres.any():
        raise Unusable("no_valid_depth", "all pixels are invalid")
    return millimetres
