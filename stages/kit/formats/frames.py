"""The frames of a sequence: one MCAP file with Foxglove messages, the same bytes for the same frames.

Topics of a camera called `camera`: `/camera/color` CompressedImage (JPEG or PNG), `/camera/depth` RawImage 16UC1 [mm],
`/camera/labels` RawImage mono16, `/camera/calibration` CameraCalibration, and of a rectified stereo pair
`/camera/right` CompressedImage with `/camera/right_calibration`, whose P holds the baseline. Beside them may stand
`/camera/deviation` RawImage mono16, the standard deviation of depth [0.1 mm, 0 unknown], and `/camera/picture`
CompressedImage, the colour at its full size, with `/camera/picture_calibration`. Other cameras have topics under their
own name. `/tf` FrameTransforms world -> camera. All messages of a frame carry the frame's time as log time and header
stamp, which no other frame has.
Metadata record `scenewright`: what is known of the world frame; metadata record `labels`: instance -> class name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from google.protobuf.message import DecodeError
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import build_file_descriptor_set
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import LabelEntry, Sequence
from scenewright.stages.kit.formats import foxglove
from scenewright.stages.kit.formats.exif import without_orientation
from scenewright.stages.kit.formats.frame_streams import (
    CAMERA_FRAME,
    CAMERA_NAME,
    LABELS_METADATA,
    MESSAGE_TYPES,
    PIXEL_STREAMS,
    TOPIC,
    TRANSFORMS,
    WORLD_FRAME,
    WORLD_METADATA,
    camera_of,
    label_table,
)
from scenewright.stages.kit.formats.indexed_mcap import HINT, IndexedMcap, Location
from scenewright.stages.kit.geometry.transforms import is_rigid


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
    camera_name: str = CAMERA_FRAME
    right: np.ndarray | None = None
    """(H, W, 3) uint8 RGB: right eye of a rectified stereo pair."""
    deviation: np.ndarray | None = None
    """(H, W) float32 [m]: standard deviation of depth, 0 = unknown."""
    picture: np.ndarray | None = None
    """(H', W', 3) uint8 RGB: the colour at its full size, of the camera in `FrameReader.picture_cameras`."""


class FrameWriter:
    """Writes frames in time order. Used as a context manager; a file that was left by an exception stays unfinished.

    `camera` is the camera of frames that name none; `cameras` (name -> camera) are those of frames that do, and
    `baselines` (name -> metres) those of stereo pairs. `labels` announces a label stream, `deviation` one of
    the deviation of depth, `picture_cameras` (name -> camera) pictures at their full size. `world_up="z"` records that
    z of the poses' world is up (what our generated logs know); `"unknown"` records that it is not known. `registered`
    records whether colour and depth pixels see the same ray. `label_table` says what the labels mean.
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
        cameras: Mapping[str, Camera] | None = None,
        baselines: Mapping[str, float] | None = None,
        deviation: bool = False,
        picture_cameras: Mapping[str, Camera] | None = None,
    ) -> None:
        self.camera = camera
        self.cameras = dict(cameras) if cameras else {CAMERA_FRAME: camera}
        self.baselines = dict(baselines or {})
        self.picture_cameras = dict(picture_cameras or {})
        for name in self.cameras:
            if not CAMERA_NAME.fullmatch(name):
                raise ValueError(f"camera name {name!r} is not made of letters, digits and underscores")
        self.frame_count = 0
        self._labels, self._deviation = labels, deviation
        self._last_time = -1
        self._file = Path(path).open("wb")  # noqa: SIM115 (closed in __exit__)
        self._writer = McapWriter(self._file, chunk_size=1 << 20, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library="scenewright")
        self._schemas: dict[Any, int] = {}
        self._channels: dict[str, int] = {}
        for name in self.cameras:
            announced = (
                *("color", "depth", *(("labels",) if labels else ()), "calibration"),
                *(("right", "right_calibration") if name in self.baselines else ()),
                *(("deviation",) if deviation else ()),
                *(("picture", "picture_calibration") if name in self.picture_cameras else ()),
            )
            for stream in announced:
                self._register(f"/{name}/{stream}", MESSAGE_TYPES[stream])
        self._register(TRANSFORMS, FrameTransforms)
        metadata = {"world_frame": WORLD_FRAME, "world_up": world_up, "registered": "yes" if registered else "no"}
        self._writer.add_metadata(WORLD_METADATA, metadata)
        table = {str(entry.instance): entry.class_name for entry in sorted(label_table, key=lambda e: e.instance)}
        if table:
            self._writer.add_metadata(LABELS_METADATA, table)

    def __enter__(self) -> FrameWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self._writer.finish()
        self._file.close()

    def _register(self, topic: str, kind: Any) -> None:
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(
                name=kind.DESCRIPTOR.full_name,
                encoding="protobuf",
                data=build_file_descriptor_set(kind).SerializeToString(deterministic=True),
            )
        self._channels[topic] = self._writer.register_channel(topic, "protobuf", self._schemas[kind])

    def write(
        self,
        time: float,
        color: np.ndarray | bytes | None,
        depth: np.ndarray | None,
        world_from_camera: np.ndarray | None = None,
        labels: np.ndarray | None = None,
        *,
        right: np.ndarray | bytes | None = None,
        deviation: np.ndarray | None = None,
        picture: np.ndarray | bytes | None = None,
        camera_name: str | None = None,
    ) -> None:
        """Append a frame at `time` [s] of the camera called `camera_name` (default: the first).

        `color` and `right` are (H, W, 3) uint8 RGB, or JPEG or PNG bytes that are stored as they are, and so is
        `picture`, at its own size; `depth` is (H, W) float [m] (0, NaN, infinite and over 65.534 m are invalid) or
        uint16 [mm]; `labels` is (H, W) integer < 65536; `deviation` is (H, W) float [m] (0 and NaN are unknown, over
        6.5535 m is that much); `world_from_camera` is (4, 4) rigid. Raises ValueError for a wrong shape, time, camera
        or pose.
        """
        name = camera_name or next(iter(self.cameras))
        if name not in self.cameras:
            raise ValueError(f"camera {name!r} was not announced: FrameWriter(..., cameras=...)")
        camera = self.cameras[name]
        stamp = foxglove.nanoseconds(time)
        if stamp <= self._last_time:
            raise ValueError(f"frame at {time} s does not come after the one before ({self._last_time * 1e-9} s)")
        if world_from_camera is not None and not is_rigid(world_from_camera):
            raise ValueError(f"world_from_camera of the frame at {time} s is not rigid")
        messages: list[tuple[str, Any]] = [(f"/{name}/calibration", foxglove.calibration_message(stamp, camera, name))]
        if world_from_camera is not None:
            pose = np.asarray(world_from_camera)
            messages.append((TRANSFORMS, foxglove.transforms_message(stamp, WORLD_FRAME, name, pose)))
        if color is not None:
            messages.append((f"/{name}/color", self._picture(stamp, color, camera, name)))
        if right is not None:
            if name not in self.baselines:
                raise ValueError(f"camera {name!r} has no baseline: FrameWriter(..., baselines=...)")
            calibration = foxglove.calibration_message(stamp, camera, name, baseline=self.baselines[name])
            messages.append((f"/{name}/right_calibration", calibration))
            messages.append((f"/{name}/right", self._picture(stamp, right, camera, name)))
        if depth is not None:
            self._check(depth, camera, "depth", (), None)
            millimetres = depth if depth.dtype == np.uint16 else foxglove.depth_to_millimetres(depth)
            messages.append((f"/{name}/depth", foxglove.raw_message(stamp, millimetres, "16UC1", name)))
        if labels is not None:
            if not self._labels:
                raise ValueError("labels were not announced: FrameWriter(..., labels=True)")
            self._check(labels, camera, "labels", (), None)
            if labels.size and (labels.min() < 0 or labels.max() > 65535):
                raise ValueError("labels are not within 0..65535")
            messages.append((f"/{name}/labels", foxglove.raw_message(stamp, labels, "mono16", name)))
        if deviation is not None:
            if not self._deviation:
                raise ValueError("deviation was not announced: FrameWriter(..., deviation=True)")
            self._check(deviation, camera, "deviation", (), None)
            steps = foxglove.deviation_to_steps(deviation)
            messages.append((f"/{name}/deviation", foxglove.raw_message(stamp, steps, "mono16", name)))
        if picture is not None:
            if name not in self.picture_cameras:
                raise ValueError(f"camera {name!r} has no pictures: FrameWriter(..., picture_cameras=...)")
            full_size = self.picture_cameras[name]
            calibration = foxglove.calibration_message(stamp, full_size, name)
            messages.append((f"/{name}/picture_calibration", calibration))
            messages.append((f"/{name}/picture", self._picture(stamp, picture, full_size, name)))
        for topic, message in messages:  # nothing of a frame that was refused is in the file
            self._add(topic, stamp, message)
        self._last_time = stamp
        self.frame_count += 1

    def _picture(self, stamp: int, picture: np.ndarray | bytes, camera: Camera, name: str) -> CompressedImage:
        if not isinstance(picture, bytes):
            self._check(picture, camera, "colour", (3,), np.uint8)
            picture = foxglove.encode_jpeg(picture)
        return foxglove.color_message(stamp, without_orientation(picture), name)

    @staticmethod
    def _check(image: np.ndarray, camera: Camera, name: str, channels: tuple[int, ...], kind: Any) -> None:
        expected = (camera.height, camera.width, *channels)
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
        self._log = IndexedMcap(self.path)
        try:
            self._topics = self._find_topics()
            self._index = self._build_index()
            metadata = self._log.metadata
            self.world_up: str = metadata.get(WORLD_METADATA, {}).get("world_up", "unknown")
            """`z`, or `unknown`."""
            self.label_table = label_table(metadata.get(LABELS_METADATA, {}), self.path)
            self._cameras: dict[str, Camera] | None = None
            self._picture_cameras: dict[str, Camera] | None = None
            self._baselines: dict[str, float] | None = None
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
    def stamps(self) -> np.ndarray:
        """Times (N,) int64 of all frames [ns]: exact where float seconds are not."""
        return np.array([stamp for stamp, _, _ in self._index], dtype=np.int64)

    @property
    def times(self) -> np.ndarray:
        """Times (N,) of all frames [s]."""
        return np.array([stamp * 1e-9 for stamp, _, _ in self._index])

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Name of the camera of each frame."""
        return tuple(name for _, name, _ in self._index)

    @property
    def streams(self) -> tuple[str, ...]:
        """Which of PIXEL_STREAMS and pose some frame has."""
        have = {stream for _, _, places in self._index for stream in places}
        return tuple(stream for stream in (*PIXEL_STREAMS, "pose") if stream in have)

    @property
    def cameras(self) -> dict[str, Camera]:
        """Every camera by name, in order of first appearance. Raises BadInput when the file holds no calibration."""
        if self._cameras is None:
            cameras = self._calibrated("calibration")
            if not cameras:
                raise BadInput(f"{self.path}: holds no camera calibration", hint=HINT)
            self._cameras = cameras
        return self._cameras

    @property
    def picture_cameras(self) -> dict[str, Camera]:
        """Camera -> the camera of its pictures at their full size, of those that have such pictures."""
        if self._picture_cameras is None:
            self._picture_cameras = self._calibrated("picture_calibration")
        return self._picture_cameras

    def _calibrated(self, stream: str) -> dict[str, Camera]:
        cameras: dict[str, Camera] = {}
        for _, name, places in self._index:
            if name not in cameras and stream in places:
                cameras[name] = camera_of(self._decode(stream, places[stream]), self.path)
        return cameras

    @property
    def camera(self) -> Camera:
        """The camera of the first frame. Raises BadInput when the file holds no calibration."""
        return next(iter(self.cameras.values()))

    @property
    def baselines(self) -> dict[str, float]:
        """Camera -> distance of its right eye along +x [m], of the cameras that are stereo pairs."""
        if self._baselines is None:
            self._baselines = {}
            for _, name, places in self._index:
                if name not in self._baselines and "right_calibration" in places:
                    message = self._decode("right_calibration", places["right_calibration"])
                    if len(message.P) != 12 or not message.P[0] > 0:
                        raise BadInput(f"{self.path}: calibration of the right eye has no projection matrix", hint=HINT)
                    self._baselines[name] = -message.P[3] / message.P[0]
        return self._baselines

    def frames(self, streams: Iterable[str] = ("color", "depth", "labels"), every: int = 1) -> Iterator[Frame]:
        """Yield every `every`-th frame in time order, decoding only the streams that are asked for."""
        streams_to_read = tuple(streams)
        for index in range(0, len(self._index), every):
            yield self.read(index, streams_to_read)

    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """Return indices (K,) and world_from_camera (K, 4, 4) of the frames that have a pose."""
        poses = [(frame.index, frame.world_from_camera) for frame in self.frames(streams=())]
        posed = [(index, pose) for index, pose in poses if pose is not None]
        return np.array([i for i, _ in posed], dtype=int), np.array([p for _, p in posed]).reshape(-1, 4, 4)

    def read(self, index: int, streams: Iterable[str] = ("color", "depth", "labels")) -> Frame:
        """Return one frame with the pixel streams asked for (of PIXEL_STREAMS).

        Raises IndexError outside of the sequence, BadInput when it cannot be decoded.
        """
        if not 0 <= index < len(self._index):
            raise IndexError(f"frame {index} of {len(self._index)}")
        stamp, name, places = self._index[index]
        arrays: dict[str, np.ndarray | None] = dict.fromkeys(PIXEL_STREAMS)
        for stream in streams:
            if stream not in PIXEL_STREAMS:
                raise ValueError(f"no stream {stream!r}; streams are {', '.join(PIXEL_STREAMS)}")
            if stream in places:
                arrays[stream] = self._array(index, stream, self._decode(stream, places[stream]))
        pose = None
        if "pose" in places:
            transforms = self._decode("pose", places["pose"]).transforms
            if not transforms:
                raise BadInput(f"{self.path}: frame {index} has an empty list of transforms", hint=HINT)
            try:
                pose = foxglove.transform_matrix(transforms[0].translation, transforms[0].rotation)
            except ValueError as error:
                raise BadInput(f"{self.path}: pose of frame {index}: {error}", hint=HINT) from None
        return Frame(index, stamp * 1e-9, **arrays, world_from_camera=pose, camera_name=name)

    def encoded(self, index: int, stream: Literal["color", "right", "picture"] = "color") -> bytes | None:
        """Return the stored JPEG or PNG of a frame, or None when it has none.

        It states no EXIF orientation, by which others would turn it under intrinsics that are not turned.
        """
        places = self._index[index][2]
        return without_orientation(bytes(self._decode(stream, places[stream]).data)) if stream in places else None

    def _array(self, index: int, stream: str, message: Any) -> np.ndarray:
        try:
            if stream in ("color", "right", "picture"):
                image = foxglove.decode_color(message.data)
                if image is None:
                    raise ValueError("image cannot be decoded")
                return image
            pixels = foxglove.raw_array(message)
            if stream == "depth":
                return foxglove.millimetres_to_depth(pixels)
            if stream == "deviation":
                return foxglove.steps_to_deviation(pixels)
            return pixels.astype(np.uint16, copy=False)
        except ValueError as error:
            raise BadInput(f"{self.path}: {stream} of frame {index}: {error}", hint=HINT) from None

    def _find_topics(self) -> dict[int, tuple[str, str]]:
        """Return channel -> (camera, stream); the camera of `/tf` is empty."""
        topics: dict[int, tuple[str, str]] = {}
        for channel in self._log.channels.values():
            match = TOPIC.fullmatch(channel.topic)
            if match is None and channel.topic != TRANSFORMS:
                continue
            topics[channel.id] = (match[1], match[2]) if match else ("", "pose")
            schema = self._log.schemas.get(channel.schema_id)
            expected = (MESSAGE_TYPES[match[2]] if match else FrameTransforms).DESCRIPTOR.full_name
            if schema is None or schema.name != expected:
                raise BadInput(
                    f"{self.path}: topic {channel.topic} is not {expected}", hint="run `scenewright ingest` first"
                )
        return topics

    def _build_index(self) -> list[tuple[int, str, dict[str, Location]]]:
        """Return (stamp [ns], camera, stream -> place) of every frame, in time order."""
        frames: dict[int, dict[str, Location]] = {}
        names: dict[int, str] = {}
        for channel_id, (name, stream) in self._topics.items():
            for stamp, location in self._log.indexed(channel_id):
                frames.setdefault(stamp, {})[stream] = location
                if name and names.setdefault(stamp, name) != name:
                    raise BadInput(
                        f"{self.path}: cameras {names[stamp]!r} and {name!r} share the stamp {stamp}",
                        hint="run `scenewright ingest` first",
                    )
        return [(stamp, names.get(stamp, CAMERA_FRAME), places) for stamp, places in sorted(frames.items())]

    def _decode(self, stream: str, location: Location) -> Any:
        try:
            kind = FrameTransforms if stream == "pose" else MESSAGE_TYPES[stream]
            return kind.FromString(self._log.fetch(location))
        except DecodeError:
            raise BadInput(f"{self.path}: a message of stream {stream} cannot be decoded", hint=HINT) from None


def require_depth(sequence: Sequence) -> None:
    """Raise BadInput when the sequence has frames and none of them has depth."""
    streams = sequence.info.streams
    if streams and "depth" not in streams:
        raise BadInput(
            f"{sequence.root}: its frames have no depth ({', '.join(streams)})",
            hint="make depth of its stereo pairs: scenewright disparity"
            if "right" in streams
            else "record depth, or a stereo pair",
        )
