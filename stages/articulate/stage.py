"""Wiring of `articulate`: a posed sequence in, the parts that it shows in two states and their joints out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.articulations import Articulation, Articulations, ArticulationsFile
from scenewright.schemas.base import as_vector
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.stages.articulate.joints import Cloud, FoundJoint, find_joints
from scenewright.stages.articulate.parameters import ArticulateParameters
from scenewright.stages.articulate.watching import NEAREST, Watched
from scenewright.stages.kit.formats.frames import FrameReader, require_depth
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.surface_samples import surface_samples
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.own_trajectory import frame_poses
from scenewright.stages.kit.prefetching import prefetched
from scenewright.stages.kit.stage import Context, Progress
from scipy import ndimage

MOST_VOXELS = 20_000_000
"""Most voxels of the grid; above this they are made larger."""
OUTLIERS = 0.5
"""Percentile of the seen points, at either end, that the grid leaves out."""
SMALLEST_REGION = 20
"""Connected regions of fewer changed voxels are noise."""
AGREED = 90
"""Percentile of the last frames that show what a region was: some voxels are noisy."""
NEVER = 1_000_000_000
"""Stands for the number of a frame after all others."""
FITTING = 1
"""Random stream."""


@dataclass(frozen=True)
class PosedDepth:
    """What is used of a frame."""

    index: int
    camera: Camera
    depth: np.ndarray
    """(H, W) float32 [m], 0 invalid."""
    world_from_camera: np.ndarray


def run(
    sequence: Sequence, trajectory: Trajectory | None = None, *, parameters: ArticulateParameters, context: Context
) -> Articulations:
    """Watch the voxels of a log, gather what left and what came, and fit joints to it.

    Most logs show nothing that moves: that is a result, too. With no frame that has depth and a pose the outcome is
    `empty`. Raises BadInput for a sequence without depth.
    """
    require_depth(sequence)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        poses = None
        if trajectory is not None:
            poses = frame_poses(trajectory, sequence, reader, parameters.pose_tolerance)
        used = Used(reader, poses, parameters)
        with context.progress.step("watch"):
            grid = grid_of(used, parameters)
            watch(used, grid, parameters, context.progress)
        with context.progress.step("gather"):
            regions = [regions_of(grid.moved_away, grid.left), regions_of(grid.moved_in, grid.came)]
            clouds = gather(used, grid, regions, parameters)
    articulations = []
    explained = [np.zeros(region.count + 1, dtype=bool) for region in regions]
    with context.progress.step("fit"):
        room = SeenRoom(grid, regions)
        for joint in find_joints(clouds[0], clouds[1], room, parameters.minimum_overlap, context.random(FITTING)):
            articulations.append(record_of(joint, regions))
            for mask, numbers in zip(explained, (joint.left, joint.came), strict=True):
                mask[np.array(numbers) + 1] = True
    count = regions[0].count + regions[1].count
    ArticulationsFile(
        voxel_size=grid.edge, frames=used.count, changed_places=count, articulations=tuple(articulations)
    ).write(context.output / "articulations.json")
    write_changes(context.output, grid, regions, explained)
    summary = {
        "frames": used.count,
        "changed_places": count,
        "revolute": sum(entry.type == "revolute" for entry in articulations),
        "prismatic": sum(entry.type == "prismatic" for entry in articulations),
    }
    return Articulations(context.output, outcome="ok" if used.count else "empty", summary=summary)


class Used:
    """The frames that have depth and a pose; each time it is gone through they are read anew."""

    def __init__(
        self, reader: FrameReader, poses: list[np.ndarray | None] | None, parameters: ArticulateParameters
    ) -> None:
        self.reader, self.poses, self.every = reader, poses, parameters.every
        self.count = 0

    def __iter__(self) -> Iterator[PosedDepth]:
        self.count = 0
        cameras = self.reader.cameras
        for frame in prefetched(self.reader.frames(streams=("depth",), every=self.every)):
            pose = frame.world_from_camera if self.poses is None else self.poses[frame.index]
            if frame.depth is not None and pose is not None and frame.depth.max() > 0:
                self.count += 1
                yield PosedDepth(frame.index, cameras[frame.camera_name], frame.depth, pose)


def watch(used: Used, grid: Watched, parameters: ArticulateParameters, progress: Progress) -> None:
    """Let every frame vote on the voxels that it sees."""
    for frame in progress.track(used, total=used.count, description="watch"):
        pose, far = frame.world_from_camera, parameters.maximum_depth
        grid.look(frame.depth, frame.camera, pose, frame.index, far, parameters.frames_seen)


def grid_of(used: Used, parameters: ArticulateParameters) -> Watched:
    """Return an empty grid around what the frames saw; of no frame at all, one voxel."""
    clouds = [np.zeros((0, 3))]
    for frame in used:
        points = back_project(frame.depth, frame.camera, stride=16).reshape(-1, 3)
        used_points = points[(points[:, 2] > NEAREST) & (points[:, 2] < parameters.maximum_depth)]
        clouds.append(apply(frame.world_from_camera, used_points))
    points = np.concatenate(clouds)
    if not len(points):
        return Watched(np.zeros(3), parameters.voxel_size, (1, 1, 1))
    low, high = np.percentile(points, [OUTLIERS, 100 - OUTLIERS], axis=0)
    edge = max(parameters.voxel_size, float((np.prod(high - low) / MOST_VOXELS) ** (1 / 3)))
    low -= 3 * edge
    x, y, z = (int(n) for n in np.ceil((high - low) / edge) + 3)
    return Watched(low, edge, (x, y, z))


@dataclass(frozen=True)
class Regions:
    """Connected regions of voxels that changed one way."""

    number: np.ndarray
    """(X, Y, Z) int32: region of a voxel from 1, 0 for none."""
    count: int
    times: np.ndarray
    """(count, 2): last frame of the old, first of the new, median over the voxels."""
    changes: np.ndarray
    """(X, Y, Z, 2) int32: these of every voxel."""


def regions_of(mask: np.ndarray, changes: np.ndarray) -> Regions:
    """Return the regions of voxels (X, Y, Z) bool that are large enough to be something."""
    label, count = ndimage.label(mask, np.ones((3, 3, 3), dtype=bool))
    large = np.bincount(label.reshape(-1), minlength=count + 1) >= SMALLEST_REGION
    large[0] = False
    number = np.where(large, np.cumsum(large), 0).astype(np.int32)[label]
    times = [np.median(changes[number == k], axis=0) for k in range(1, int(large.sum()) + 1)]
    return Regions(number, len(times), np.array(times).reshape(-1, 2), changes)


class SeenRoom:
    """What the voxels say of places (stages/articulate/joints.py: Room)."""

    def __init__(self, grid: Watched, regions: list[Regions]) -> None:
        self.grid, self.regions = grid, regions
        around = np.ones((3, 3, 3), dtype=bool)
        self.came = ndimage.binary_dilation(grid.moved_in, around)
        steady = np.where(grid.moved_in, NEVER, np.where(grid.first_full < 0, NEVER, grid.first_full))
        self.full_since = ndimage.grey_erosion(steady, footprint=around)

    def at_once(self, left: int, came: int) -> bool:
        """See Room."""
        last, first = self._times(left, came)
        return last < first

    def came_full(self, points: np.ndarray) -> np.ndarray:
        """See Room."""
        return np.asarray(self.came[tuple(self.grid.cells(points).T)])

    def was_full(self, points: np.ndarray, left: int, came: int) -> np.ndarray:
        """See Room."""
        last, _ = self._times(left, came)
        return np.asarray(self.full_since[tuple(self.grid.cells(points).T)] <= last)

    def stays_full(self, points: np.ndarray, left: int, came: int) -> np.ndarray:
        """See Room."""
        last, first = self._times(left, came)
        cells = tuple(self.grid.cells(points).T)
        full_by_then = (self.grid.first_full[cells] >= 0) & (self.grid.first_full[cells] <= last)
        return np.asarray(full_by_then & (self.grid.last_full[cells] >= first) & (self.grid.flips[cells] == 0))

    def _times(self, left: int, came: int) -> tuple[float, float]:
        times = np.stack([self.regions[0].times[left], self.regions[1].times[came]])
        return float(times[:, 0].max()), float(times[:, 1].min())


def gather(used: Used, grid: Watched, regions: list[Regions], parameters: ArticulateParameters) -> list[list[Cloud]]:
    """Return the surface that left each region, and that came to each, from the frames that saw the one or the other;
    one voxel around the changed ones is included."""
    around = np.ones((3, 3, 3), dtype=bool)
    number = [np.asarray(ndimage.grey_dilation(region.number, footprint=around)) for region in regions]
    went, came = regions
    if not went.count and not came.count:
        return [[], []]
    until = ndimage.grey_dilation(np.where(went.number > 0, went.changes[..., 0], -1), footprint=around)
    since = ndimage.grey_erosion(np.where(came.number > 0, came.changes[..., 1], NEVER), footprint=around)
    rows_of_region: list[list[list[np.ndarray]]] = [[[] for _ in range(region.count)] for region in regions]
    for frame in used:
        near_depth = np.where(frame.depth < parameters.maximum_depth, frame.depth, 0.0).astype(np.float32)
        points, normals = surface_samples(near_depth, frame.camera, frame.world_from_camera)
        cells = np.floor((points - grid.origin) / grid.edge).astype(int)
        inside = np.all((cells >= 0) & (cells < grid.shape), axis=1)
        rows = np.column_stack([points, normals])[inside]
        x, y, z = cells[inside].T
        shows = (frame.index <= until[x, y, z], frame.index >= since[x, y, z])
        for which, mask in enumerate(shows):
            region_of_point = np.where(mask, number[which][x, y, z], 0)
            for k in np.unique(region_of_point[region_of_point > 0]):
                rows_of_region[which][int(k) - 1].append(rows[region_of_point == k])
    return [[_cloud(rows) for rows in state] for state in rows_of_region]


def _cloud(chunks: list[np.ndarray]) -> Cloud:
    rows = np.concatenate([np.zeros((0, 6)), *chunks])
    return Cloud(rows[:, :3], rows[:, 3:])


def record_of(joint: FoundJoint, regions: list[Regions]) -> Articulation:
    """Return a joint as it is written."""
    times = np.stack([regions[0].times[joint.left[0]], regions[1].times[joint.came[0]]])
    motion = joint.motion
    return Articulation(
        type=motion.type,
        axis=as_vector(motion.axis),
        origin=as_vector(motion.origin),
        travel=motion.travel,
        leaf=tuple(as_vector(corner) for corner in joint.leaf.corners),
        leaf_after=tuple(as_vector(corner) for corner in joint.leaf_after.corners),
        last_before=int(times[:, 0].max()),
        first_after=int(times[:, 1].min()),
        overlap=joint.overlap,
    )


def write_changes(folder: Path, grid: Watched, regions: list[Regions], explained: list[np.ndarray]) -> None:
    """Write changes.npz: the voxels of the regions that joints explain (masks (count + 1,)), and until when frames show
    what is gone: a region changes at one time, which no single voxel knows well."""
    until = np.full(grid.shape, -1, dtype=np.int32)
    for mask, region in zip(explained, regions, strict=True):
        for number in np.flatnonzero(mask):
            in_region = region.number == number
            last, first = region.changes[in_region].T
            agreed = np.percentile(last, AGREED)
            until[in_region] = np.maximum(until[in_region], np.minimum(int(agreed), first - 1))
    cells = np.argwhere(until >= 0)
    points = (grid.origin + (cells + 0.5) * grid.edge).astype(np.float32)
    np.savez(folder / "changes.npz", points=points, until=until[tuple(cells.T)])
