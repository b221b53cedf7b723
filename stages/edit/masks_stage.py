"""`scenewright edit masks`: masks for every frame out of a panoptic map that was put right, to train with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import open3d as o3d
from scenewright.schemas.errors import BadInput
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment, FrameSegments, Segments, SegmentsFile
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.trajectory import Trajectory
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.edit.map_state import MapState, read_state
from scenewright.stages.edit.parameters import EditMasksParameters
from scenewright.stages.kit.formats.frames import Frame, FrameReader
from scenewright.stages.kit.formats.masks import write_panoptic_zip
from scenewright.stages.kit.formats.trajectories import poses_at, read_tum
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.stage import Context

LABEL = "masks drawn from a map"
LARGEST_ID = 0xFFFFFF
"""Largest id of a panoptic picture: 24 bits."""


def run(
    sequence: Sequence,
    panoptic_map: PanopticMap,
    trajectory: Trajectory | None = None,
    *,
    parameters: EditMasksParameters,
    context: Context,
) -> Segments:
    """Draw what each frame sees of the things of the map, and write it as `segment` writes masks.

    A pixel with depth is of the thing whose surface is nearest to its point, within `reach`; one without, of the thing
    that its ray meets first. So is every pixel whose ray meets a thing that a person drew (`edit add --drawn`: glass)
    before what the camera measured. Frames without a pose, in `trajectory` where one is given, are left out. Raises
    BadInput when no frame has one.
    """
    state, map_info = read_state(panoptic_map)
    turned = np.eye(4) if map_info.world_from_sequence is None else np.array(map_info.world_from_sequence)
    if max(state.entities, default=0) > LARGEST_ID:
        raise BadInput(f"{panoptic_map.root}: an instance is beyond {LARGEST_ID}", hint="make the map again")
    info, caster = sequence.info, _RayCaster(state)
    annotations: list[FrameSegments] = []
    with FrameReader(sequence.path("frames.mcap")) as reader:
        poses = None
        if trajectory is not None:
            poses = poses_at(reader.times, *read_tum(trajectory.path("trajectory.tum")), parameters.pose_tolerance)

        def images() -> Iterator[tuple[int, np.ndarray]]:
            frames = reader.frames(streams=("depth",))
            for frame in context.progress.track(frames, total=len(reader), description="draw masks"):
                pose = frame.world_from_camera if poses is None else poses[frame.index]
                if pose is None:
                    continue
                frame = replace(frame, world_from_camera=turned @ pose)
                ids = frame_ids(frame, reader.cameras[frame.camera_name], state, caster, parameters.reach)
                annotations.append(FrameSegments(frame=frame.index, segments=_segments(ids, state)))
                yield frame.index, ids

        with context.progress.step("draw the masks"):
            write_panoptic_zip(context.output / "panoptic.zip", images())
    if not annotations:
        raise BadInput(f"{sequence.root}: no frame has a pose", hint="give the --trajectory that the map was made with")
    SegmentsFile(
        backend="map", label=LABEL, width=info.camera.width, height=info.camera.height, frames=tuple(annotations)
    ).write(context.output / "segments.json")
    segment_count = sum(len(frame.segments) for frame in annotations)
    summary = {
        "label": LABEL,
        "frames": len(annotations),
        "without_pose": len(reader) - len(annotations),
        "segments_per_frame": round(segment_count / len(annotations), 2),
    }
    return Segments(context.output, outcome="ok" if segment_count else "empty", summary=summary)


class _RayCaster:
    """The mesh of a map, for rays."""

    def __init__(self, state: MapState) -> None:
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self._faces = state.surface.faces
        if len(self._faces):
            self._scene.add_triangles(
                o3d.core.Tensor.from_numpy(np.ascontiguousarray(state.surface.vertices, np.float32)),
                o3d.core.Tensor.from_numpy(np.ascontiguousarray(self._faces, np.uint32)),
            )

    def first(self, camera: Camera, world_from_camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return z-depth (H, W) [m] of what the rays meet first, infinite for nothing, and a vertex (H, W) of it."""
        ahead = back_project(np.ones((camera.height, camera.width), np.float32), camera).reshape(-1, 3)
        rays = np.empty((len(ahead), 6), np.float32)
        rays[:, :3], rays[:, 3:] = world_from_camera[:3, 3], ahead @ world_from_camera[:3, :3].T
        hit = self._scene.cast_rays(o3d.core.Tensor.from_numpy(rays), nthreads=1)
        triangle = hit["primitive_ids"].numpy().astype(np.int64)
        met = triangle < len(self._faces)
        vertex = np.zeros(triangle.shape, np.int64)
        vertex[met] = self._faces[triangle[met], 0]
        shape = (camera.height, camera.width)
        return hit["t_hit"].numpy().reshape(shape), vertex.reshape(shape)  # rays go on by 1 m of depth at a time


def frame_ids(frame: Frame, camera: Camera, state: MapState, caster: _RayCaster, reach: float) -> np.ndarray:
    """Return the instance (H, W) int32 that each pixel of a frame shows, 0 for none."""
    assert frame.world_from_camera is not None
    depth = np.zeros((camera.height, camera.width), np.float32) if frame.depth is None else frame.depth
    distance, vertex = caster.first(camera, frame.world_from_camera)
    met = np.isfinite(distance)
    labels = np.append(state.instance, 0)
    ids = np.where(met, labels[np.where(met, vertex, -1)], 0).astype(np.int32)
    drawn = np.array(sorted(k for k, entity in state.entities.items() if not entity.observations), int)
    on_map = (depth > 0) & ~(np.isin(ids, drawn) & (distance < depth))
    points = apply(frame.world_from_camera, back_project(depth, camera)[on_map].astype(float))
    ids[on_map] = np.maximum(state.called(points, reach), 0)
    return ids


def _segments(ids: np.ndarray, state: MapState) -> tuple[FrameSegment, ...]:
    vocabulary = load_vocabulary()
    segments = []
    for number, area in zip(*(array.tolist() for array in np.unique(ids, return_counts=True)), strict=True):
        if number in state.entities:
            entry = vocabulary.by_name(state.entities[number].class_name)
            segments.append(
                FrameSegment(
                    id=number, class_id=entry.id, instance=number, is_thing=entry.kind == "thing", score=1.0, area=area
                )
            )
    return tuple(segments)
