"""COCO panoptic PNGs, packed into one zip: the colour of a pixel is its segment id, id = R + 256 G + 65536 B."""

from __future__ import annotations

import contextlib
import re
import struct
import zipfile
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.formats.image_headers import LARGEST_IMAGE, may_be_decoded
from scenewright.stages.kit.formats.zip_files import find_entry, zip_errors

LARGEST_ID = (1 << 24) - 1
"""Largest id of a panoptic picture: 24 bits."""
REMAKE = "run `scenewright segment` again"
PNG_BEGINNING = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
LARGEST_FILE = 4 * LARGEST_IMAGE
"""Largest panoptic picture in the archive [bytes]; a bound."""
FRAME_NAME = re.compile(r"(\d{6,9})\.png", re.ASCII)
PNG_OPTIONS = (cv2.IMWRITE_PNG_COMPRESSION, 3, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP)
"""One filter for all rows, a third of the time of trying five: rows of labels are mostly those above."""
FIXED_TIMESTAMP = (1980, 1, 1, 0, 0, 0)
"""Every zip entry bears the earliest date the format knows, so that the same images give the same bytes."""


def encode_panoptic_png(ids: np.ndarray) -> bytes:
    """Return the PNG of an id image (H, W) of integers in 0 .. 2^24 - 1, as COCO panoptic writes it (R first).

    Raises ValueError for another shape or for ids that do not fit.
    """
    if ids.ndim != 2 or ids.size == 0:
        raise ValueError(f"an id image has shape (H, W), not {ids.shape}")
    if int(ids.min()) < 0 or int(ids.max()) > LARGEST_ID:
        raise ValueError(f"panoptic ids lie in 0..{LARGEST_ID}, not {ids.min()}..{ids.max()}")
    red_green_blue = np.ascontiguousarray(ids, dtype="<u4").view(np.uint8).reshape(*ids.shape, 4)[..., :3]
    done, data = cv2.imencode(".png", red_green_blue[..., ::-1], PNG_OPTIONS)
    if not done:
        raise ValueError("the PNG encoder refused the image")
    return data.tobytes()


def decode_panoptic_png(data: bytes) -> np.ndarray:
    """Return the id image (H, W) int32 of a COCO panoptic PNG.

    Raises BadInput when it is no 8-bit colour PNG, or larger than any image that is read.
    """
    if not data.startswith(PNG_BEGINNING) or len(data) < 33:
        raise BadInput("not a COCO panoptic PNG", hint="ids are R + 256 G + 65536 B")
    if not may_be_decoded(data):
        width, height = struct.unpack_from(">II", data, 16)
        raise BadInput(f"panoptic PNG declares {width}x{height} pixels, which {len(data)} bytes cannot hold")
    try:
        image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise BadInput(f"panoptic PNG cannot be decoded: {error.err}") from None
    if image is None or image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8:
        raise BadInput("not a COCO panoptic PNG (8 bits, three channels)", hint="ids are R + 256 G + 65536 B")
    # Widen before multiplying: 256 * uint8 overflows.
    wide = image.astype(np.int32)
    return wide[..., 2] + 256 * wide[..., 1] + 65536 * wide[..., 0]


def panoptic_name(frame_index: int) -> str:
    """Return the name of a frame's image within the zip."""
    return f"{frame_index:06d}.png"


def write_panoptic_zip(path: Path, images: Iterable[tuple[int, np.ndarray | bytes]]) -> None:
    """Write pairs (frame index, id image (H, W)) as PNGs into a stored (not deflated) zip with fixed timestamps.

    An image may be a PNG already (encode_panoptic_png).
    The same images in the same order give the same bytes. Raises ValueError when a frame comes twice.
    """
    written: set[int] = set()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for frame_index, image in images:
            if frame_index in written:
                raise ValueError(f"frame {frame_index} comes twice")
            written.add(frame_index)
            entry = zipfile.ZipInfo(panoptic_name(frame_index), date_time=FIXED_TIMESTAMP)
            entry.external_attr = 0o644 << 16
            entry.create_system = 3
            archive.writestr(entry, image if isinstance(image, bytes) else encode_panoptic_png(image))


class PanopticReader:
    """Random access to the images of a panoptic zip. Opening a missing or broken file raises BadInput."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        with contextlib.ExitStack() as stack:
            file = stack.enter_context(opened(self.path, hint=REMAKE))
            with zip_errors(self.path, REMAKE):
                self._archive = stack.enter_context(zipfile.ZipFile(file))
            self._files = stack.pop_all()

    def __enter__(self) -> PanopticReader:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._files.close()

    def frame_indices(self) -> list[int]:
        """Return the indices of the frames that have an image, ascending."""
        matches = {FRAME_NAME.fullmatch(name) for name in self._archive.namelist()}
        return sorted(int(match[1]) for match in matches if match)

    def read(self, frame_index: int) -> np.ndarray:
        """Return the ids (H, W) int32 of a frame; 0 is void.

        Raises BadInput when the frame has no image or two, its checksum is wrong, or it is no panoptic PNG.
        """
        with zip_errors(self.path, REMAKE):
            try:
                entry = find_entry(self._archive, panoptic_name(frame_index), LARGEST_FILE)
            except KeyError:
                raise BadInput(f"has no image for frame {frame_index}") from None
            try:
                data = self._archive.read(entry)
            except zipfile.BadZipFile as error:
                raise BadInput(f"frame {frame_index} is damaged: {error}") from None
            return decode_panoptic_png(data)
