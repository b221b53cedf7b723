"""Kind `panoptic_map`: a labelled TSDF map and a mesh per entity (Han 2024, sections 2.3.2 to 2.3.4)."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field
from scenewright.schemas.artifact import Artifact, Document, OptionalDocument
from scenewright.schemas.base import Model, RelativePath, Transform, Vector3
from scenewright.schemas.edits import AppliedEditsFile

SNAPSHOTS = "snapshots"
"""Folder of the partial maps; each is named by the number of frames in it."""


class Because(Model):
    """Why an entity has its surface and its name."""

    instance: int
    """Of the entity."""
    shape: str
    """How its surface was found."""
    looks: float
    """How many frames saw it; of long logs, of those that were kept."""
    said: dict[str, float]
    """What masks said most: class -> mean score, 0..1 a look."""
    name: str = ""
    """Rule that gave the name; empty of what is no thing."""
    posterior: float | None = None
    """Of the name."""
    runners_up: dict[str, float] = Field(default_factory=dict)
    """Class -> posterior of the names that come next."""


class Entity(Model):
    """One panoptic entity: an object or a layout surface."""

    instance: int
    """Global instance label p, >= 1."""
    class_name: str
    mesh: RelativePath
    """`entities/<instance>.ply`."""
    vertices: int
    triangles: int
    box_minimum: Vector3
    box_maximum: Vector3
    """Axis-aligned bounds in the world frame."""
    confidence: float
    """Share of the triple-wise count that agrees with (class, instance)."""
    observations: int
    """Frames that voted for it."""
    segments: tuple[int, ...]
    """Global segment labels l in it."""


class EntitiesFile(Model):
    """entities.json."""

    voxel_size: float
    truncation_distance: float
    frames_integrated: int
    segmentation: str
    """`label` of the segments artifact: which masks these entities come from."""
    world_from_sequence: Transform | None = Field(default=None, exclude_if=lambda pose: pose is None)
    """How an edit of gravity turned the map; its world is that of the sequence else. Absent otherwise."""
    entities: tuple[Entity, ...]


class BecauseFile(Model):
    """because.json."""

    entities: tuple[Because, ...]
    """By instance."""
    dropped: tuple[str, ...] = ()
    """Why things of masks are no entities."""


class Opening(Model):
    """A hole in a wall through which cameras looked, at least 0.3 m wide."""

    left: float
    """Where it begins along the wall, seen from the room [m from the wall's `start`]."""
    width: float
    """[m]"""
    sill: float
    """Height over the floor [m]; 0: a door."""
    head: float
    """[m]"""


class LayoutPlane(Model):
    """A plane that was judged: whether it bounds the room."""

    kind: Literal["floor", "wall", "ceiling"]
    """What it is, or would be."""
    bounds: bool
    normal: Vector3
    """Unit vector into the room, world frame."""
    offset: float
    """normal . p = offset for points p on it [m]."""
    area: float
    """Of its surface [m^2]."""
    start: Vector3
    end: Vector3
    """Ends of what was seen of it, in the world frame [m]: of a wall its lower left and upper right corner."""
    reasons: dict[str, float]
    """Reason -> log odds."""
    log_odds: float
    """Over 0 it bounds the room."""
    openings: tuple[Opening, ...] = ()
    """Of a wall."""


class LayoutFile(Model):
    """layout.json: planes by their log odds, those that bound the room first."""

    floor: float | None
    """Height of the floor [m]; None where none was found."""
    planes: tuple[LayoutPlane, ...]


class PanopticMap(Artifact):
    """`mesh.ply` (whole map, colour), `mesh_labels.npz` (`instance`, `segment`, `class_id`: (V,) int32 per vertex of
    mesh.ply, 0 = unlabelled), `entities/<instance>.ply`, `entities.json`, `counts.npz` (the triple-wise count:
    `segment`, `class_id`, `instance`, `count`, each (K,)), `volume.npz` (`block_coordinates` (B, 3) int32, blocks
    sorted by z, y, x; over the 8^3 voxels of a block, x fastest: `tsdf` (B, 512) float16 in truncation distances,
    `weight` (B, 512) float16, `segment` (B, 512) int32, `color` (B, 512, 3) uint8). Of frames, by `--merging ours`,
    `free_space.npz`, the cells that frames saw through: `block_coordinates` (B, 3) int32, `free` (B, 64) uint8, a bit
    for each of a block's 8^3 cells, x fastest, the lowest bit first, `edge` (1,) of a cell [m]. With `--snapshot-every`
    also `snapshots/<frames>/`, the map as it was after so many frames: entities.json, entities/ and mesh.ply. Of an
    annotated scan (`--from-mesh`) there are no counts and no volume. Of frames, by `--merging ours`, `layout.json` says
    which planes bound the room and why, `because.json` how each entity was found and named. Of an edited map (`edit
    map`) `edits.json` says what became of each edit."""

    kind: ClassVar[str] = "panoptic_map"
    description: ClassVar[str] = "labelled TSDF map: whole mesh, a mesh per entity, counts"

    def snapshots(self) -> tuple[PanopticMap, ...]:
        """Return the partial maps kept while mapping went on, the earliest first; they have no volume and no counts."""
        folder = self.path(SNAPSHOTS)
        if not folder.is_dir():
            return ()
        return tuple(PanopticMap(entry) for entry in sorted(folder.iterdir()) if entry.is_dir())

    info = Document(EntitiesFile, "entities.json")
    edits = OptionalDocument(AppliedEditsFile, "edits.json")
    layout = OptionalDocument(LayoutFile, "layout.json")
    because = OptionalDocument(BecauseFile, "because.json")
