"""RGB-D estimation: odometry, then rounds of loop search and pose-graph optimisation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.registration.pairs import edge_of, overlap_candidates, seen_shares
from scenewright.stages.kit.registration.pose_graph import (
    Edge,
    Solution,
    laid_out,
    optimize,
    optimize_gradually,
    parts_of,
)
from scenewright.stages.kit.registration.pyramid import Pyramid, build_pyramid
from scenewright.stages.kit.registration.rigid_motion import between, inverses
from scenewright.stages.kit.stage import Context
from scenewright.stages.poses.features import Corners, Features, find_features, orb_corners
from scenewright.stages.poses.loops import Loop, PyramidCache, Verifier, place_candidates
from scenewright.stages.poses.parameters import PosesParameters
from scenewright.stages.poses.places import Ferns
from scenewright.stages.poses.tracking import Seen, Track, Tracker, TrackingLimits
from scenewright.stages.poses.world import given_poses

LEVELS = 3
"""Levels of the image pyramids in which frames are aligned; by eye."""


@dataclass(frozen=True)
class Estimate:
    """Key frames with their poses, and what was found on the way."""

    track: Track
    world_from_key: np.ndarray
    """(K, 4, 4), in the coordinates of the first key frame of each part."""
    parts: np.ndarray
    """(K,) part of each key frame after loops have joined some."""
    edges: list[Edge]
    loops: list[Loop]
    solution: Solution
    candidates: dict[str, int] = field(default_factory=dict)
    """Pairs that were tried, by how they were found."""


class FrameSource:
    """Frames of the main camera of a sequence, as tracking and loop closure need them."""

    def __init__(
        self, reader: FrameReader, camera_name: str, parameters: PosesParameters, ferns: Ferns, corners: Corners
    ) -> None:
        self.camera = reader.cameras[camera_name]
        self._reader, self._parameters, self._ferns, self._corners = reader, parameters, ferns, corners

    def pyramid(self, index: int) -> Pyramid:
        """Read a frame and return its pyramid."""
        return self.seen(index).pyramid

    def seen(self, index: int) -> Seen:
        """Read a frame. Its features are found when they are asked for."""
        parameters, camera = self._parameters, self.camera
        frame = self._reader.read(index, ("color", "depth") if parameters.use_color else ("depth",))
        color, depth = frame.color, frame.depth
        if depth is None:
            depth = np.zeros((camera.height, camera.width), dtype=np.float32)
        pyramid = build_pyramid(
            depth, color, camera, width=parameters.width, levels=LEVELS, maximum_depth=parameters.maximum_depth
        )

        def describe() -> Features:
            return find_features(color, depth, camera, parameters.maximum_depth, self._corners)

        return Seen(index, pyramid, describe, lambda: self._ferns.code(depth))


def limits_of(parameters: PosesParameters) -> TrackingLimits:
    """Return the limits that the options state."""
    return TrackingLimits(
        overlap=parameters.minimum_overlap,
        agreement=parameters.minimum_agreement,
        residual=parameters.maximum_residual,
        uncertainty=parameters.maximum_uncertainty,
        brightness=parameters.maximum_brightness_difference,
        key_overlap=parameters.key_overlap,
        key_angle=parameters.key_angle,
        key_distance=parameters.key_distance,
    )


def estimate(
    reader: FrameReader,
    frames: list[int],
    camera_name: str,
    parameters: PosesParameters,
    context: Context,
    corners: Corners = orb_corners,
) -> Estimate:
    """Track the frames (indices in the sequence, ascending), close loops and optimise; `corners` find the features."""
    source = FrameSource(reader, camera_name, parameters, Ferns(context.random(1)), corners)
    refines = parameters.method == "refine"
    given = given_poses(reader, frames) if refines else {}
    # Odometry that a loop contradicts by far is wrong, and the path has to say so; given poses are known to drift.
    settle = optimize_gradually if refines else optimize
    tracker = Tracker(limits_of(parameters), parameters.use_color, context.random(2), given)
    with context.progress.step("odometry"):
        for index in context.progress.track(frames, total=len(frames), description="odometry"):
            tracker.add(source.seen(index))
    track = tracker.track
    edges = [edge_of(link.target, link.source, link.alignment, switchable=False) for link in track.links]
    poses = np.array([key.part_from_key for key in track.keys]).reshape(-1, 4, 4)
    loops: list[Loop] = []
    candidates: dict[str, int] = {}
    if parameters.loop_closure and len(track.keys) > 1:
        with context.progress.step("loop closure"):
            poses, loops, candidates = _close_loops(source, track, poses, edges, settle, parameters, context)
    every = edges + [edge_of(loop.target, loop.source, loop.alignment, switchable=True) for loop in loops]
    with context.progress.step("pose graph"):
        solution = settle(poses, every)
    parts = parts_of(len(track.keys), believed(every, solution))
    return Estimate(track, solution.world_from_node, parts, every, loops, solution, candidates)


def believed(edges: list[Edge], solution: Solution) -> list[Edge]:
    """Return the edges that the solution gave at least half of their weight."""
    return [edge for edge, weight in zip(edges, solution.weights, strict=True) if weight >= 0.5]


def _close_loops(
    source: FrameSource,
    track: Track,
    poses: np.ndarray,
    edges: list[Edge],
    settle: Callable[[np.ndarray, list[Edge]], Solution],
    parameters: PosesParameters,
    context: Context,
) -> tuple[np.ndarray, list[Loop], dict[str, int]]:
    """Return poses (K, 4, 4) with the loops that were verified, and how many pairs were tried."""
    pyramids = PyramidCache(lambda key: source.pyramid(track.keys[key].frame))
    verifier = Verifier(track.keys, pyramids, limits_of(parameters), parameters.use_color, context.random(3))
    cameras = [source.camera] * len(track.keys)

    def near(later: int) -> np.ndarray:
        """Whether earlier key frames see anything of the same: given poses are not off by rooms."""
        motions = inverses(poses[:later]) @ poses[later]
        return seen_shares(track.keys[:later], track.keys[later], motions, cameras[:later]) > 0

    pairs = place_candidates(
        track.keys,
        context.random(4),
        per_key=parameters.loop_candidates,
        least_gap=parameters.loop_gap,
        near=near if parameters.method == "refine" else None,
    )
    tried = {"place": len(pairs), "overlap": 0}
    loops: list[Loop] = []
    for target, later in context.progress.track(pairs, total=len(pairs), description="places"):
        loop = verifier.by_appearance(target, later)
        if loop is not None:
            loops.append(loop)
    pairs_tried = set(pairs)
    for _ in range(parameters.overlap_rounds):
        every = edges + [edge_of(loop.target, loop.source, loop.alignment, switchable=True) for loop in loops]
        solution = settle(laid_out(poses, every), every)
        poses = solution.world_from_node
        parts = parts_of(len(poses), believed(every, solution))
        fresh = overlap_candidates(track.keys, poses, cameras, pairs_tried, per_key=parameters.overlap_candidates)
        fresh = [(target, later) for target, later in fresh if parts[target] == parts[later]]
        if not fresh:
            break
        pairs_tried |= set(fresh)
        tried["overlap"] += len(fresh)
        for target, later in context.progress.track(fresh, total=len(fresh), description="overlaps"):
            loop = verifier.by_position(target, later, between(poses[target], poses[later]))
            if loop is not None:
                loops.append(loop)
    every = edges + [edge_of(loop.target, loop.source, loop.alignment, switchable=True) for loop in loops]
    return laid_out(poses, every), loops, tried
