"""Kind `ground_truth`: what is true of the room that a log shows, generated or annotated."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document
from scenewright.schemas.base import Count, Model, Name, Seed, Transform, Vector3
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.scene_parts import Box, Camera


class TrueObject(Model):
    """One object or layout entity of the room."""

    instance: int
    """Label in the log's `labels` stream."""
    name: Name
    """`<class>_<instance>`; the node id in graph.json and the body name in room/."""
    class_name: str
    model_id: Name | None = None
    """Model in the CAD library; None for layout entities."""
    scale: float = 1.0
    world_from_model: Transform
    joints: dict[str, float] = {}
    """Joint name -> value while the room was scanned, at the end of the log where somebody moved it."""
    joints_before: dict[str, float] | None = Field(default=None, exclude_if=lambda joints: joints is None)
    """The values at the beginning of the log, for a thing that somebody opened or shut; else absent."""
    box: Box
    """Gravity-aligned box of the whole object as it stands (open doors included): along its model's own axes; in a
    scan, and where a model lies across its axes, the one of least footprint."""
    round: bool = False
    """Turning it about the vertical changes nothing that matters (a bottle): the yaw of its box says nothing."""
    visible_pixels: Count = 0
    """Pixels over all frames, in a scan points of visible.npz; 0 for what the camera never saw."""


class GroundTruthFile(Model):
    """ground_truth.json."""

    source: Literal["generated", "scan"] = "generated"
    """`generated`: the frame is the world of the log. `scan`: somebody annotated a real scan; the frame is the world of
    the sequence that it was made for, already upright."""
    seed: Seed
    recipe: str
    room_size: Vector3
    camera: Camera
    frame_count: int
    depth_noise: bool
    objects: tuple[TrueObject, ...]


class GroundTruth(Artifact):
    """`log.mcap` (what the sensor recorded: noisy depth, colour, poses, gravity unknown to the reader is
    given as `world` z up; label stream), `trajectory.tum`, `graph.json` (true contact graph), `visible.npz`
    (`points` (N, 3) float32 on a 1 cm grid of true surface that was seen, `instance` (N,) int32), `mesh.ply`
    (the whole true surface), `room/` (interactive scene of the true room, laid out like kind
    interactive_scene). That of a scan has no log, no trajectory and no room, and its graph no edges."""

    kind: ClassVar[str] = "ground_truth"
    description: ClassVar[str] = (
        "generated log with true poses, boxes, contact graph, CAD poses, joints; or annotated scan"
    )
    info = Document(GroundTruthFile, "ground_truth.json")
    graph = Document(ContactGraphFile, "graph.json")

    def pictures(self) -> tuple[int, float]:
        """Return the number of frames, and the megapixels of all of them."""
        camera = self.info.camera
        return self.info.frame_count, self.info.frame_count * camera.width * camera.height / 1e6
