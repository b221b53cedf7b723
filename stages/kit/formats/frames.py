"""The frames of a sequence: one MCAP file with Foxglove messages, the same bytes for the same frames.

Topics: `/camera/color` CompressedImage (JPEG), `/camera/depth` RawImage 16UC1 [mm], `/camera/labels` RawImage mono16,
`/camera/calibration` CameraCalibration, `/tf` FrameTransforms world -> camera. All messages of a frame carry the
frame's time as log time and header stamp. Metadata record `scenewright`: what is known of the world frame;
metadata record `labels`: instance -> class name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import build_file_descriptor_set

from schemas.errors import BadInput
from schemas.scene_parts import Camera
from schemas.sequence import LabelEntry
from stages.kit.formats import foxglove
from stages.kit.formats.mcap_log import Location, McapLog
from stages.kit.geometry.transforms import is_rigid

COLOR, DEPTH, LABELS = "/camera/color", "/camera/depth", "/camera/labels"
CALIBRATION, TRANSFORMS = "/camera/calibration", "/tf"
WORLD_FRAME, CAMERA_FRAME = "world", "camera"
WORLD_METADATA, LABELS_METADATA = "scenewright", "labels"
STREAM_TOPICS = {"color": COLOR, "depth": DEPTH, "labels": LABELS}
MESSAGE_TYPES: dict[str, Any] = {
    COLOR: CompressedImage,
    DEPTH: RawImage,
    LABELS: RawImage,
    CALIBRATION: CameraCalibration,
    TRANSFORMS: FrameTransforms,
}


@dataclass(frozen=True)
class Frame:
    """One frame. Streams that the sequence lacks, or that were not asked for, are None."""

    index: int
    time: float
    color: np.ndarray | None
    """(H, W, 3) uint8 RGB."""
    depth: np.ndarray | None
    """(H, W) float32 z-depth [m], 0 = invalid."""
    labels: np.ndarray | None
    """(H, W) uint16 instance ids, 0 = none."""
    world_from_camera: np.ndarray | None
    """(4, 4), OpenCV camera frame."""


class FrameWriter:
    """Writes frames in time order. Used as a context manager; a file that was left by an exception stays unfinished.

    `labels` announces a label stream. `world_up="z"` records that z of the poses' world is up (what our generated
    logs know); `"unknown"` records that it is not known. `registered` records whether colour and depth pixels see the
    same ray. `label_table` says what the labels mean.
    """

    def __init__(
        self,
        path: Path,
        camera: Camera,
        *,
        labels: bool = False,
        world_up: Literal["z", "unknown"] = "z",
        registered: bool = True,
        label_table: Iterable[LabelEntry] = (),
    ) -> None:
        self.camera = camera
        self.frame_count = 0
        self._labels = labels
        self._last_time = -1
        self._file = Path(path).open("wb")  # noqa: SIM115 (closed in __exit__)
        self._writer = McapWriter(self._file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="scenewright")
        topics = [COLOR, DEPTH, LABELS, CALIBRATION, TRANSFORMS] if labels else [COLOR, DEPTH, CALIBRATION, TRANSFORMS]
        schemas: dict[Any, int] = {}
        self._channels: dict[str, int] = {}
        for topic in topics:
            kind = MESSAGE_TYPES[topic]
            if kind not in schemas:
                schemas[kind] = self._writer.register_schema(
                    name=kind.DESCRIPTOR.full_name,
                    encoding="protobuf",
                    data=build_file_descriptor_set(kind).SerializeToString(deterministic=True),
                )
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schemas[kind])
        known = {"world_frame": WORLD_FRAME, "world_up": world_up, "registered": "yes" if registered else "no"}
        self._writer.add_metadata(WORLD_METADATA, known)
        table = {str(entry.instance): entry.class_name for entry in sorted(label_table, key=lambda e: e.instance)}
        if table:
            self._writer.add_metadata(LABELS_METADATA, table)

    def __enter__(self) -> FrameWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._writer.finish()
        self._file.close()

    def write(
        self,
        time: float,
        color: np.ndarray | bytes | None,
        depth: np.ndarray | None,
        world_from_camera: np.ndarray | None = None,
        labels: np.ndarray | None = None,
    ) -> None:
        """Append a frame at `time` [s].

        `color` is (H, W, 3) uint8 RGB, or JPEG bytes that are stored as they are; `depth` is (H, W) float [m]
        (0, NaN, infinite and over 65.534 m are invalid) or uint16 [mm]; `labels` is (H, W) integer < 65536;
        `world_from_camera` is (4, 4) rigid. Raises ValueError for a wrong shape, time or pose.
        """
        stamp = foxglove.nanoseconds(time)
        if stamp <= self._last_time:
            raise ValueError(f"frame at {time} s does not come after the one before ({self._last_time * 1e-9} s)")
        if world_from_camera is not None and not is_rigid(world_from_camera):
            raise ValueError(f"world_from_camera of the frame at {time} s is not rigid")
        self._last_time = stamp
        self._add(CALIBRATION, stamp, foxglove.calibration_message(stamp, self.camera, CAMERA_FRAME))
        if world_from_camera is not None:
            message = foxglove.transforms_message(stamp, WORLD_FRAME, CAMERA_FRAME, np.asarray(world_from_camera))
            self._add(TRANSFORMS, stamp, message)
        if color is not None:
            if not isinstance(color, bytes):
                self._check(color, "colour", (3,), np.uint8)
            jpeg = color if isinstance(color, bytes) else foxglove.encode_jpeg(color)
            self._add(COLOR, stamp, foxglove.color_message(stamp, jpeg, CAMERA_FRAME))
        if depth is not None:
            self._check(depth, "depth", (), None)
            millimetres = depth if depth.dtype == np.uint16 else foxglove.depth_to_millimetres(depth)
            self._add(DEPTH, stamp, foxglove.raw_message(stamp, millimetres, "16UC1", CAMERA_FRAME))
        if labels is not None:
            if not self._labels:
                raise ValueError("labels were not announced: FrameWriter(..., labels=True)")
            self._check(labels, "labels", (), None)
            if labels.size and (labels.min() < 0 or labels.max() > 65535):
                raise ValueError("labels are not within 0..65535")
            self._add(LABELS, stamp, foxglove.raw_message(stamp, labels, "mono16", CAMERA_FRAME))
        self.frame_count += 1

    def _check(self, image: np.ndarray, name: str, channels: tuple[int, ...], kind: Any) -> None:
        expected = (self.camera.height, self.camera.width, *channels)
        if image.shape != expected:
            raise ValueError(f"{name} has shape {image.shape}, expected {expected}")
        if kind is not None and image.dtype != kind:
            raise ValueError(f"{name} is {image.dtype}, expected {np.dtype(kind)}")

    def _add(self, topic: str, stamp: int, message: Any) -> None:
        data = message.SerializeToString(deterministic=True)
        self._writer.add_message(self._channels[topic], stamp, data, publish_time=stamp, sequence=self.frame_count)


class FrameReader:
    """Reads frames that FrameWriter wrote. Raises BadInput for a torn or damaged file, or one of another layout."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._log = McapLog(self.path)
        try:
            self._topics = self._find_topics()
            self._index = self._build_index()
            metadata = dict(self._log.metadata)
            self.world_up: str = metadata.get(WORLD_METADATA, {}).get("world_up", "unknown")
            """`z`, or `unknown`."""
            self.label_table = _label_table(metadata.get(LABELS_METADATA, {}), self.path)
            self._camera: Camera | None = None
        except BaseException:
            self._log.close()
            raise

    def __enter__(self) -> FrameReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._log.close()

    def __len__(self) -> int:
        return len(self._index)

    @property
    def times(self) -> np.ndarray:
        """Times (N,) of all frames [s]."""
        return np.array([stamp * 1e-9 for stamp, _ in self._index])

    @property
    def streams(self) -> tuple[str, ...]:
        """Which of color, depth, labels, pose some frame has."""
        have = {topic for _, places in self._index for topic in places}
        names = [name for name, topic in STREAM_TOPICS.items() if topic in have]
        return (*names, "pose") if TRANSFORMS in have else tuple(names)

    @property
    def camera(self) -> Camera:
        """The camera. Raises BadInput when the file holds no calibration."""
        if self._camera is None:
            for _, places in self._index:
                if CALIBRATION in places:
                    self._camera = _camera_of(self._decode(CALIBRATION, places[CALIBRATION]), self.path)
                    break
            else:
                raise BadInput(f"{self.path}: holds no camera calibration")
        return self._camera

    def frames(self, streams: Iterable[str] = ("color", "depth", "labels"), every: int = 1) -> Iterator[Frame]:
        """Yield every `every`-th frame in time order, decoding only the streams that are asked for."""
        wanted = tuple(streams)
        for index in range(0, len(self._index), every):
            yield self.read(index, wanted)

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return indices (K,) and world_from_camera (K, 4, 4) of the frames that have a pose."""
        found = [(frame.index, frame.world_from_camera) for frame in self.frames(streams=())]
        kept = [(index, pose) for index, pose in found if pose is not None]
        return np.array([i for i, _ in kept], dtype=int), np.array([p for _, p in kept]).reshape(-1, 4, 4)

    def read(self, index: int, streams: Iterable[str] = ("color", "depth", "labels")) -> Frame:
        """Return one frame. Raises IndexError outside of the sequence, BadInput when it cannot be decoded."""
        if not 0 <= index < len(self._index):
            raise IndexError(f"frame {index} of {len(self._index)}")
        stamp, places = self._index[index]
        arrays: dict[str, np.ndarray | None] = {"color": None, "depth": None, "labels": None}
        for stream in streams:
            topic = STREAM_TOPICS[stream]
            if topic in places:
                arrays[stream] = self._array(index, stream, self._decode(topic, places[topic]))
        pose = None
        if TRANSFORMS in places:
            transform = self._decode(TRANSFORMS, places[TRANSFORMS]).transforms[0]
            pose = foxglove.transform_matrix(transform.translation, transform.rotation)
        return Frame(index, stamp * 1e-9, arrays["color"], arrays["depth"], arrays["labels"], pose)

    def encoded_color(self, index: int) -> bytes | None:
        """Return the stored JPEG of a frame, or None when it has no colour."""
        places = self._index[index][1]
        return bytes(self._decode(COLOR, places[COLOR]).data) if COLOR in places else None

    def _array(self, index: int, stream: str, message: Any) -> np.ndarray:
        try:
            if stream == "color":
                image = foxglove.decode_color(message.data)
                if image is None:
                    raise ValueError("image cannot be decoded")
                return image
            pixels = foxglove.raw_array(message)
            return foxglove.millimetres_to_depth(pixels) if stream == "depth" else pixels.astype(np.uint16, copy=False)
        except ValueError as error:
            raise BadInput(f"{self.path}: {stream} of frame {index}: {error}") from None

    def _find_topics(self) -> dict[int, str]:
        topics = {c.id: c.topic for c in self._log.channels.values() if c.topic in MESSAGE_TYPES}
        for channel_id, topic in topics.items():
            schema = self._log.schemas.get(self._log.channels[channel_id].schema_id)
            expected = MESSAGE_TYPES[topic].DESCRIPTOR.full_name
            if schema is None or schema.name != expected:
                raise BadInput(f"{self.path}: topic {topic} is not {expected}", hint="run `scenewright ingest` first")
        return topics

    def _build_index(self) -> list[tuple[int, dict[str, Location]]]:
        frames: dict[int, dict[str, Location]] = {}
        for channel_id, entries in self._log.message_index.items():
            if channel_id in self._topics:
                for stamp, location in entries:
                    frames.setdefault(stamp, {})[self._topics[channel_id]] = location
        return sorted(frames.items())

    def _decode(self, topic: str, location: Location) -> Any:
        try:
            return MESSAGE_TYPES[topic].FromString(self._log.fetch(location).data)
        except DecodeError:
            raise BadInput(f"{self.path}: a message of {topic} cannot be decoded") from None


def _camera_of(message: Any, path: Path) -> Camera:
    if len(message.K) != 9 or message.K[0] <= 0 or message.K[4] <= 0:
        raise BadInput(f"{path}: calibration has no focal lengths (K = {list(message.K)})")
    return Camera(
        width=message.width, height=message.height, fx=message.K[0], fy=message.K[4], cx=message.K[2], cy=message.K[5]
    )


def _label_table(table: dict[str, str], path: Path) -> tuple[LabelEntry, ...]:
    try:
        return tuple(LabelEntry(instance=int(key), class_name=table[key]) for key in sorted(table, key=int))
    except ValueError:
        raise BadInput(f"{path}: metadata record {LABELS_METADATA!r} has a key that is no instance number") from None
