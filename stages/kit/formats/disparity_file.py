"""Disparity and confidence of a sequence's frames: an MCAP file beside `frames.mcap`, the same bytes for the same maps.

Topics of a camera called `camera`: `/camera/disparity` RawImage 32FC1 [px, NaN unknown] and `/camera/confidence`
RawImage mono8 (255 is 1), at the stamps of the frames.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import build_file_descriptor_set
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats import foxglove
from scenewright.stages.kit.formats.frame_streams import CAMERA_NAME
from scenewright.stages.kit.formats.indexed_mcap import IndexedMcap, Location
from scenewright.stages.kit.stereo.disparity_map import DisparityMap

ENCODINGS = {"disparity": "32FC1", "confidence": "mono8"}
_TOPIC = re.compile(rf"/({CAMERA_NAME.pattern})/({'|'.join(ENCODINGS)})")
_AGAIN = "make the disparity again"


class DisparityWriter:
    """Writes maps in time order. Used as a context manager; a file that was left by an exception stays unfinished."""

    def __init__(self, path: Path, cameras: Iterable[str]) -> None:
        self._file = Path(path).open("wb")  # noqa: SIM115 (closed in __exit__)
        self._writer = McapWriter(self._file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="scenewright")
        schema = self._writer.register_schema(
            name=RawImage.DESCRIPTOR.full_name,
            encoding="protobuf",
            data=build_file_descriptor_set(RawImage).SerializeToString(deterministic=True),
        )
        self._channels = {
            (name, stream): self._writer.register_channel(f"/{name}/{stream}", "protobuf", schema)
            for name in cameras
            for stream in ENCODINGS
        }
        self._count = 0

    def __enter__(self) -> DisparityWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._writer.finish()
        self._file.close()

    def write(self, stamp: int, camera_name: str, disparity_map: DisparityMap) -> None:
        """Append the map of the frame at `stamp` [ns] of a camera."""
        bytes_of_confidence = np.rint(255 * np.clip(disparity_map.confidence, 0, 1)).astype(np.uint8)
        for stream, pixels in (
            ("disparity", disparity_map.disparity.astype(np.float32)),
            ("confidence", bytes_of_confidence),
        ):
            message = foxglove.raw_message(stamp, pixels, ENCODINGS[stream], camera_name)
            data = message.SerializeToString(deterministic=True)
            channel = self._channels[camera_name, stream]
            self._writer.add_message(channel, stamp, data, publish_time=stamp, sequence=self._count)
        self._count += 1


class DisparityReader:
    """Reads maps that DisparityWriter wrote. Raises BadInput for a torn or damaged file, or one of another layout."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._log = IndexedMcap(self.path)
        try:
            self._places = self._index()
        except BaseException:
            self._log.close()
            raise

    def __enter__(self) -> DisparityReader:
        return self

    def __exit__(self, *_: object) -> None:
        self._log.close()

    def __len__(self) -> int:
        return len(self._places)

    @property
    def stamps(self) -> list[int]:
        """Stamps [ns] of the maps, in order."""
        return sorted(self._places)

    def read(self, stamp: int) -> DisparityMap:
        """Return the map of the frame at `stamp` [ns]. Raises KeyError for another stamp, BadInput when it cannot be
        decoded."""
        places = self._places[stamp]
        disparity, confidence = (self._pixels(stream, places) for stream in ENCODINGS)
        if disparity.shape != confidence.shape:
            raise BadInput(f"{self.path}: disparity and confidence at {stamp} differ in size", hint=_AGAIN)
        return DisparityMap(disparity.astype(np.float32), confidence.astype(np.float32) / 255.0)

    def _index(self) -> dict[int, dict[str, Location]]:
        places: dict[int, dict[str, Location]] = {}
        for channel in self._log.channels.values():
            match = _TOPIC.fullmatch(channel.topic)
            schema = self._log.schemas.get(channel.schema_id)
            if match is None or schema is None or schema.name != RawImage.DESCRIPTOR.full_name:
                raise BadInput(f"{self.path}: topic {channel.topic} is no disparity or confidence", hint=_AGAIN)
            for stamp, location in self._log.indexed(channel.id):
                places.setdefault(stamp, {})[match[2]] = location
        return places

    def _pixels(self, stream: str, places: dict[str, Location]) -> np.ndarray:
        if stream not in places:
            raise BadInput(f"{self.path}: a map without {stream}", hint=_AGAIN)
        try:
            message: Any = RawImage.FromString(self._log.fetch(places[stream]))
            if message.encoding != ENCODINGS[stream]:
                raise ValueError(f"its encoding is {message.encoding!r:.40}")
            return foxglove.raw_array(message)
        except (DecodeError, ValueError) as error:
            raise BadInput(f"{self.path}: a {stream} cannot be read: {error}", hint=_AGAIN) from None
