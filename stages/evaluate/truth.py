"""The ground truth as evaluation needs it, moved into the world frame of the reconstruction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.contact_graph import ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth, TrueObject
from scenewright.schemas.scene_parts import Box
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.evaluate.surfaces import Surface, read_surface
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.geometry.boxes import box_yaw, gravity_aligned_box
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.measurement.pose_error import yaw_of


@dataclass(frozen=True)
class TrueRoom:
    """Everything true of the room, in the reconstruction's world frame."""

    objects: tuple[TrueObject, ...]
    points: np.ndarray
    """(N, 3) surface points that the camera saw, 1 cm grid."""
    instances: np.ndarray
    """(N,) instance of each point."""
    graph: ContactGraphFile
    surface: Surface
    """The whole true surface."""
    optional: frozenset[int]
    """Instances that the camera hardly saw: finding them is no merit, missing them no fault."""
    name: str

    def by_instance(self) -> dict[int, TrueObject]:
        """Objects by instance label."""
        return {entry.instance: entry for entry in self.objects}

    def by_name(self) -> dict[str, TrueObject]:
        """Objects by node id."""
        return {entry.name: entry for entry in self.objects}

    def evaluated(self, things_only: bool = False) -> list[TrueObject]:
        """Objects that were seen, by instance; with `things_only` those of countable classes."""
        things = thing_classes()
        return [
            entry
            for entry in sorted(self.objects, key=lambda o: o.instance)
            if entry.instance not in self.optional and (not things_only or entry.class_name in things)
        ]

    def labelled_points(self) -> np.ndarray:
        """(N,) instance per point, 0 where the instance is optional (void)."""
        return np.where(np.isin(self.instances, sorted(self.optional)), 0, self.instances)


def stuff_classes() -> frozenset[str]:
    """Names of the classes without instances."""
    return frozenset(entry.name for entry in load_vocabulary().classes if entry.kind == "stuff")


def thing_classes() -> frozenset[str]:
    """Names of the countable classes (`object` included)."""
    return frozenset(entry.name for entry in load_vocabulary().classes if entry.kind == "thing")


def load_truth(truth: GroundTruth, world_from_log: np.ndarray, minimum_visible_points: int) -> TrueRoom:
    """Read the ground truth and move it by `world_from_log` (4, 4), what ingest did to the log's world.

    Boxes keep their size and stay upright: exact when ingest only turned about z, close when it corrected a small
    tilt. That of an annotated scan is not moved. Raises BadInput when visible.npz is unreadable or its arrays disagree.
    """
    file = truth.info
    if file.source == "scan":  # it is in the sequence's world already
        world_from_log = np.eye(4)
    points, instances = read_arrays(truth.path("visible.npz"), "points", "instance", shapes=("N 3", "N"))
    points, instances = points.astype(float), instances.astype(np.int64)
    if points.shape != (len(instances), 3):
        raise BadInput(
            f"{truth.path('visible.npz')}: {points.shape} points for {len(instances)} instances",
            hint="make the ground truth again",
        )
    counts = {int(k): int(n) for k, n in zip(*np.unique(instances, return_counts=True), strict=True)}
    optional = {o.instance for o in file.objects if counts.get(o.instance, 0) < minimum_visible_points}
    if file.source == "scan":  # an annotator may say that a thing counts neither way, though points of it are known
        optional |= {o.instance for o in file.objects if not o.visible_pixels}
    surface = read_surface(truth.path("mesh.ply"))
    return TrueRoom(
        objects=tuple(_moved_object(entry, world_from_log) for entry in file.objects),
        points=apply(world_from_log, points),
        instances=instances,
        graph=truth.graph,
        surface=replace(surface, vertices=apply(world_from_log, surface.vertices)),
        optional=frozenset(optional),
        name=f"{file.recipe}, seed {file.seed}" if file.source == "generated" else file.recipe,
    )


def _moved_object(entry: TrueObject, world_from_log: np.ndarray) -> TrueObject:
    return entry.model_copy(
        update={
            "box": _moved_box(entry.box, world_from_log),
            "world_from_model": as_transform(world_from_log @ np.array(entry.world_from_model)),
        }
    )


def _moved_box(box: Box, world_from_log: np.ndarray) -> Box:
    yaw = box_yaw(box) + yaw_of(world_from_log[:3, :3])
    return gravity_aligned_box(apply(world_from_log, np.array(box.center)), np.array(box.size), yaw)
