"""Kind `sequence`: one RGB-D sequence in our conventions, whatever the log was."""

from __future__ import annotations

from typing import ClassVar, Literal

from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Model, Transform
from scenewright.schemas.scene_parts import Camera


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
    streams: tuple[Literal["color", "depth", "right", "labels", "pose"], ...]
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


class Sequence(Artifact):
    """`frames.mcap` (stages/kit/formats/frames.py reads and writes it), `sequence.json`, `trajectory.tum`."""

    kind: ClassVar[str] = "sequence"
    schema_version: ClassVar[int] = 2
    description: ClassVar[str] = "RGB-D frames with calibration and poses, gravity aligned"
    info = Document(SequenceFile, "sequence.json")

    def pictures(self) -> tuple[int, float]:
        """Return the number of frames, and the megapixels of all of them."""
        sizes = [camera.camera.width * camera.camera.height / 1e6 for camera in self.info.cameras]
        pixels = sum(size * camera.frame_count for size, camera in zip(sizes, self.info.cameras, strict=True))
        return self.info.frame_count, pixels or self.info.frame_count * sizes[0]
