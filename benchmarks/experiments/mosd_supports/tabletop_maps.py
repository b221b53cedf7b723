"""One frame of a tabletop data set becomes a map, through the steps `ingest`, `segment` and `fuse`.

Gravity is square to the table: the frames have no inertial data, and the plane of the pixels labelled table is what the
camera could have measured just as well. The table's top is z = 0, where `graph` supposes a floor when nothing there is
labelled, so that masks without a table still have something to stand on.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import LabelEntry
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.mesh_files import read_mesh
from scenewright.stages.kit.formats.numpy_files import read_arrays
from scenewright.stages.kit.geometry.cameras import back_project, project
from scenewright.stages.kit.geometry.planes import ransac_plane
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scipy.optimize import linear_sum_assignment

from benchmarks.steps import opened, step

VOXEL_SIZE = 0.004
"""Metres; what rests on these tables is 2 to 30 cm high."""
PLANE_DISTANCE = 0.006
"""Pixels of the table within this distance of its plane fit it [m]."""
REPEATS = 12
"""The frame is shown so often, as by a camera that stands still: `fuse` believes what frames say again and again."""
SAME_DEPTH = 0.02
"""A vertex is what a pixel shows when their depths differ by less [m]."""
LEAST_OVERLAP = 0.25
"""An entity of the map may be an annotated node from this intersection over union on, as in `evaluate`."""


@dataclass(frozen=True)
class LabelledView:
    """One frame: colour (H, W, 3) uint8 RGB, depth (H, W) [m] with 0 invalid, nodes (H, W): 1, 2, ... or 0."""

    color: np.ndarray
    depth: np.ndarray
    nodes: np.ndarray
    classes: tuple[str, ...]
    """Class of each node, in their order."""
    world_from_camera: np.ndarray
    """(4, 4), z up."""


def upright_pose(depth: np.ndarray, table: np.ndarray, camera: Camera, seed: int = 0) -> np.ndarray:
    """Return world_from_camera (4, 4): z is square to the plane of the pixels `table` (H, W) bool and 0 on it, and y
    points away from the camera. depth (H, W) [m]. Raises ValueError when too few pixels are table."""
    points = back_project(depth, camera)[table & (depth > 0)].astype(float)
    fit = ransac_plane(points, distance_threshold=PLANE_DISTANCE, iterations=300, random=np.random.default_rng(seed))
    if fit is None:
        raise ValueError("no plane in the pixels of the table")
    up = fit.normal if fit.offset > 0 else -fit.normal  # the camera, at the origin, is above the table
    forward = np.array([0.0, 0.0, 1.0]) - up[2] * up
    forward /= np.linalg.norm(forward)
    rotation = np.stack([np.cross(forward, up), forward, up])
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[2, 3] = abs(fit.offset)
    return pose


def build_map(view: LabelledView, camera: Camera, backend: str, folder: Path) -> PanopticMap:
    """Write the frame as a log into `folder` and run the steps up to the map. `backend`: ground-truth or objects."""
    table = [LabelEntry(instance=k, class_name=name) for k, name in enumerate(view.classes, 1)]
    with FrameWriter(folder / "log.mcap", camera, labels=True, label_table=table) as writer:
        for k in range(REPEATS):
            writer.write(0.1 * k, view.color, view.depth, view.world_from_camera, view.nodes.astype(np.uint16))
    sequence = step("ingest", folder / "sequence", log=folder / "log.mcap")
    segments = step("segment", folder / "segments", {"backend": backend}, sequence=sequence)
    fused = step("fuse", folder / "panoptic_map", {"voxel_size": VOXEL_SIZE}, sequence=sequence, segments=segments)
    return opened(PanopticMap, fused)


def nodes_of_entities(panoptic_map: PanopticMap, view: LabelledView, camera: Camera) -> dict[int, int]:
    """Return map instance -> node: one to one, with the greatest summed overlap of vertices that the frame shows, and
    at least LEAST_OVERLAP (intersection over union) each."""
    mesh = read_mesh(panoptic_map.path("mesh.ply"), may_be_empty=True)
    instances = read_arrays(panoptic_map.path("mesh_labels.npz"), "instance")[0].astype(np.int64)
    pixels, depth = project(apply(inverse(view.world_from_camera), np.asarray(mesh.vertices, float)), camera)
    places = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(int)
    inside = np.all((places >= 0) & (places < [camera.width, camera.height]), axis=1)
    columns, rows = places[inside].T
    shown = np.abs(view.depth[rows, columns] - depth[inside]) < SAME_DEPTH
    true, predicted = view.nodes[rows, columns][shown], instances[inside][shown]
    count = len(view.classes)
    names = np.unique(predicted[predicted > 0])
    overlap = np.zeros((count, len(names)))
    for column, name in enumerate(names):
        both = np.bincount(true[predicted == name], minlength=count + 1)[1:]
        union = np.bincount(true, minlength=count + 1)[1:] + int((predicted == name).sum()) - both
        overlap[:, column] = both / np.maximum(union, 1)
    overlap[overlap < LEAST_OVERLAP] = 0.0
    pairs = zip(*linear_sum_assignment(-overlap), strict=True)
    return {int(names[column]): int(row) + 1 for row, column in pairs if overlap[row, column] > 0}
