"""Kind `sequence`: one RGB-D sequence in our conventions, whatever the log was."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar, Literal

import numpy as np
from scenewright.schemas.artifact import Artifact, Document, OptionalDocument
from scenewright.schemas.base import Count, Model, Transform
from scenewright.schemas.scene_parts import Camera

StreamName = Literal["color", "depth", "right", "labels", "pose", "deviation", "picture"]
"""What a frame may have: `deviation` is the standard deviation of depth, `picture` is colour at its full size."""


class Gravity(Model):
    """How the world frame was made upright."""

    method: Literal["given", "floor_plane", "level_plane", "mean_camera_up", "imu", "none"]
    """`level_plane`: a table or the like says which way is up, the floor below it was not seen."""
    world_from_log: Transform
    """What ingest applied to the log's world frame."""
    inlier_count: int = 0
    """Points that support the plane, when `floor_plane` or `level_plane`."""
    detail: str = ""


class LabelEntry(Model):
    """Meaning of one value of the `labels` stream."""

    instance: int
    class_name: str


class SequenceCamera(Model):
    """One camera of a sequence."""

    name: str
    camera: Camera
    baseline: float | None = None
    """Distance of the right eye along +x of the camera [m], when there is a right stream."""
    picture: Camera | None = None
    """The same camera at the size of the `picture` stream, when its frames have one beside `color`."""
    frame_count: int = 0


class SequenceFile(Model):
    """sequence.json."""

    source_format: str
    """The format that was detected."""
    rule: str
    """The rule that matched, for people."""
    notes: tuple[str, ...] = ()
    """What was assumed (intrinsics, depth unit, times, pose convention) and what looked odd."""
    camera: Camera
    """The main camera, which is the first of `cameras`."""
    cameras: tuple[SequenceCamera, ...]
    """Every camera of the frames."""
    streams: tuple[StreamName, ...]
    frame_count: int
    frames_in_log: int
    drops: dict[str, int] = {}
    """Reason -> number of frames left out."""
    damage: tuple[str, ...] = ()
    """What of the log could not be read at all, one line each."""
    other_cameras: tuple[str, ...] = ()
    """Cameras of the log that were not asked for."""
    gravity: Gravity
    depth_unit: str = "millimetre, 16UC1, 0 invalid"
    label_table: tuple[LabelEntry, ...] = ()
    color_depth_registered: bool = True
    start_time: float = 0.0
    end_time: float = 0.0

    def check_read(self) -> None:
        """Raise ValueError without a camera, or with counts that cannot be."""
        if not self.cameras:
            raise ValueError("names no camera")
        if min(self.frame_count, *(entry.frame_count for entry in self.cameras)) < 0:
            raise ValueError("counts fewer than no frames")


class FrameSources(Model):
    """sources.json: what the log itself calls each frame. A list has one entry a frame, or none at all."""

    color: tuple[str | None, ...] = ()
    """File of its colour picture, relative to the log, with `/`."""
    depth: tuple[str | None, ...] = ()
    """File of its depth."""
    stamps: tuple[Count | None, ...] = ()
    """Time of its picture as the log states it, of its depth where there is none [ns]."""
    left_out: tuple[str, ...] = ()
    """Pictures of the log whose frames are not in the sequence."""

    def check_read(self) -> None:
        """Raise ValueError when the lists are of different lengths."""
        if len({len(entries) for entries in (self.color, self.depth, self.stamps) if entries}) > 1:
            raise ValueError("its lists are of different lengths")

    def times_beside(self, times: np.ndarray) -> np.ndarray:
        """Return the times (N,) [s] of the frames and, beside each, that of its picture in the log: (N, 2)."""
        stamps = self.stamps or (None,) * len(times)
        own = [time if stamp is None else stamp * 1e-9 for time, stamp in zip(times, stamps, strict=True)]
        return np.stack([times, np.array(own, dtype=float)], axis=1)

    def of_frames(self, indices: Iterable[int]) -> FrameSources:
        """Return those of the frames at `indices`, in their order."""
        kept = list(indices)
        columns = {"color": self.color, "depth": self.depth, "stamps": self.stamps}
        return self.model_copy(
            update={name: tuple(column[k] for k in kept) if column else () for name, column in columns.items()}
        )


OF_TOPICS = ("mcap", "rosbag1", "rosbag2")
"""Formats of logs whose images have topics."""


class Sequence(Artifact):
    """`frames.mcap` (stages/kit/formats/frames.py reads and writes it), `sequence.json`, `trajectory.tum`."""

    kind: ClassVar[str] = "sequence"
    schema_version: ClassVar[int] = 3
    description: ClassVar[str] = "RGB-D frames with calibration and poses, gravity aligned"
    info = Document(SequenceFile, "sequence.json")
    sources = OptionalDocument(FrameSources, "sources.json")

    def pictures(self) -> tuple[int, float]:
        """Return the number of frames, and the megapixels of all of them."""
        sizes = [camera.camera.width * camera.camera.height / 1e6 for camera in self.info.cameras]
        pixels = sum(size * camera.frame_count for size, camera in zip(sizes, self.info.cameras, strict=True))
        return self.info.frame_count, pixels or self.info.frame_count * sizes[0]
