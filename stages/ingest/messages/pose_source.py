"""Where the poses of a log come from: the tree of transforms, or a topic of odometry or poses joined with it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.messages.survey import STATIC, LogContent, Poses
from scenewright.stages.ingest.messages.topic_names import words
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.transform_tree import TransformTree

WORLD_FRAMES = ("map", "world", "odom")
"""Names of frames that stand still (REP-105)."""
MOST_FRAMES = 12
"""Most frames that a message lists."""
NOT_MEASURED = frozenset({"goal", "goals", "target", "initialpose", "cmd", "command", "setpoint", "desired"})
"""Words of pose topics that say where something is wanted, not where it is."""


@dataclass(frozen=True)
class PoseSource:
    """Poses of frames of the log in one world."""

    world: str
    rule: str
    """In words, for people."""
    tree: TransformTree
    gap: int
    """Largest gap [ns] that is interpolated over."""
    tolerance: int
    """Time [ns] before the first or after the last sample for which that sample counts."""
    poses: Poses | None = None
    """Topic of poses of `child`; None: the tree has them all."""
    child: str = ""
    notes: tuple[str, ...] = field(default=())

    def at(self, frame: str, stamp: int) -> np.ndarray | None:
        """Return world_from_frame (4, 4) at a stamp [ns], None where the log does not cover it.

        Raises BadInput when nothing connects the frame with the world.
        """
        if self.poses is None:
            return self._between(self.world, frame, stamp)
        reference_from_child = self.poses.track.at(stamp, gap=self.gap, tolerance=self.tolerance)
        child_from_frame = self._between(self.child, frame, stamp)
        world_from_reference = self._between(self.world, self.poses.frame_id, stamp)
        if reference_from_child is None or child_from_frame is None or world_from_reference is None:
            return None
        return world_from_reference @ reference_from_child @ child_from_frame

    def why_not(self, frame: str, stamp: int) -> str:
        """Return in words why there is no pose of a frame at a stamp [ns]."""
        limits = {"gap": self.gap, "tolerance": self.tolerance}
        if self.poses is None:
            return self.tree.why_not(self.world, frame, stamp, **limits)
        if self.poses.track.at(stamp, **limits) is None:
            return f"{self.poses.topic} {self.poses.track.why_not(stamp)}"
        for target, source in ((self.child, frame), (self.world, self.poses.frame_id)):
            reason = "" if target == source else self.tree.why_not(target, source, stamp, **limits)
            if reason:
                return reason
        return ""

    def gap_at(self, frame: str, stamp: int) -> int:
        """Return the largest gap [ns] that has to be interpolated over for the pose of a frame at a stamp [ns]."""
        if self.poses is None:
            return self.tree.gap_at(self.world, frame, stamp)
        pairs = ((self.child, frame), (self.world, self.poses.frame_id))
        gaps = [self.tree.gap_at(*pair, stamp) for pair in pairs if pair[0] != pair[1]]
        return max([self.poses.track.gap_at(stamp), *gaps])

    def _between(self, target: str, source: str, stamp: int) -> np.ndarray | None:
        if target == source:
            return np.eye(4)
        return self.tree.lookup(target, source, stamp, gap=self.gap, tolerance=self.tolerance)


def find_poses(
    content: LogContent, frame: str, parameters: IngestParameters, where: str
) -> tuple[PoseSource | None, list[str]]:
    """Return where the poses of a camera's frame come from (None: the log has none), and what was assumed.

    A topic that was asked for; else the tree, when it leads to the frame from one that stands still; else odometry of
    a frame that leads to the camera; else a topic of poses. Raises BadInput for topics and frames that are not there,
    for a loop, and when the frames above the camera have several parents and nothing says which counts.
    """
    content.tree.prefer(parameters.world_frame)
    if parameters.pose_topic is not None:
        asked_for = _from_given_topic(content, frame, parameters, where)
        return asked_for, list(asked_for.notes)
    notes: list[str] = []
    poses = _from_tree(content, frame, parameters, where, notes)
    if poses is None:
        poses = _from_topics(content, frame, parameters, where, notes)
    if poses is None and parameters.world_frame is not None:
        raise BadInput(
            f"{where}: nothing leads from {parameters.world_frame!r} to the camera frame {frame!r}",
            hint="leave out --world-frame, or record tf and tf_static",
        )
    return poses, notes if poses is None else [*notes, *poses.notes]


def why_no_poses(content: LogContent, frame: str) -> str:
    """Return in words what the log has instead of poses of a camera's frame."""
    frames = [repr(name) for name in content.tree.frames]
    known = ", ".join(frames[:MOST_FRAMES]) + (f", ... ({len(frames)} frames)" if len(frames) > MOST_FRAMES else "")
    leading = f"no transforms lead to the camera frame {frame!r}"
    parts = [leading if not content.tree.has_parent(frame) else f"transforms of {frame!r} do not say where it is"]
    parts.append(f"frames that the log knows: {known}" if frames else "the log holds no transforms")
    moving = any(topic.rpartition("/")[2] == "tf" for topic in content.transform_topics)
    moving = moving or any(poses.child_frame_id for poses in content.poses.values())
    if moving and not any(name.endswith(STATIC) for name in content.topics):
        parts.append(f"/{STATIC} is not among its topics, which says where the camera is mounted (record it too)")
    return "; ".join(parts)


def _from_tree(
    content: LogContent, frame: str, parameters: IngestParameters, where: str, notes: list[str]
) -> PoseSource | None:
    tree, world_frame = content.tree, parameters.world_frame
    if world_frame is not None:
        _check_frame(world_frame, content, where)
        if not (frame in tree.frames and world_frame in tree.frames and tree.connected(world_frame, frame)):
            return None
    elif not tree.has_parent(frame):
        return None
    world = world_frame or _world_of(tree.chain(frame))
    edges = tree.between(world, frame)
    _check_parents(tree, edges, where)
    stands_still = f"all transforms from {world!r} to the camera {frame!r} are constant"
    if edges and all(tree.is_constant(edge) for edge in edges):
        if _odometry_of(content, frame) is not None:
            return None
        if all(tree.is_static(edge) for edge in edges) and world_frame is None and not _is_world(world):
            notes.append(
                f"{stands_still} and static, and nothing says that {world!r} stands still "
                f"(--world-frame {world} takes it so)"
            )
            return None
        notes.append(f"{stands_still}: the camera is taken to stand still")
    topics = ", ".join(sorted(content.transform_topics))
    rule = f"poses of {frame!r} in {world!r} from {topics}"
    return PoseSource(world, rule, tree, *_limits(parameters))


def _world_of(chain: list[str]) -> str:
    """Return the topmost frame of a chain that is called as worlds are, else its root."""
    return next((frame for frame in reversed(chain) if _is_world(frame)), chain[-1])


def _is_world(frame: str) -> bool:
    return frame.rpartition("/")[2].lower() in WORLD_FRAMES


def _limits(parameters: IngestParameters) -> tuple[int, int]:
    return round(parameters.maximum_transform_gap * 1e9), round(parameters.maximum_time_difference * 1e9)


def _check_frame(frame: str, content: LogContent, where: str) -> None:
    frames = sorted({*content.tree.frames, *(poses.frame_id for poses in content.poses.values())})
    if frame not in frames:
        raise BadInput(f"{where}: no frame {frame!r}", hint=f"frames: {', '.join(frames) or 'none'}")


def _check_parents(tree: TransformTree, frames: list[str], where: str) -> None:
    for frame in frames:
        parents = tree.parents(frame)
        if len(parents) > 1 and not tree.is_preferred(frame):
            parent_names = " and ".join(repr(parent) for parent in parents)
            raise BadInput(
                f"{where}: frame {frame!r}, above the camera, has two parents, {parent_names}: poses are not known",
                hint="--world-frame says which of them leads to the world",
            )


def _odometry_of(content: LogContent, frame: str) -> Poses | None:
    """Return the odometry whose moving frame leads to the camera, of several the one with the most messages."""
    fitting = [
        poses
        for poses in content.poses.values()
        if poses.child_frame_id and not NOT_MEASURED & set(words(poses.topic)) and _are_connected(content, poses, frame)
    ]
    return min(fitting, key=lambda poses: (-poses.track.count, poses.topic), default=None)


def _are_connected(content: LogContent, poses: Poses, frame: str) -> bool:
    if poses.child_frame_id == frame:
        return True
    tree = content.tree
    return frame in tree.frames and poses.child_frame_id in tree.frames and tree.connected(poses.child_frame_id, frame)


def _from_topics(
    content: LogContent, frame: str, parameters: IngestParameters, where: str, notes: list[str]
) -> PoseSource | None:
    odometry = _odometry_of(content, frame)
    if odometry is not None:
        return _source_of_topic(odometry, content, frame, parameters, where)
    bare = [
        poses
        for poses in content.poses.values()
        if not poses.child_frame_id and not NOT_MEASURED & set(words(poses.topic))
    ]
    best = min(bare, key=lambda poses: (-poses.track.count, poses.topic), default=None)
    if best is not None:
        return _source_of_topic(best, content, frame, parameters, where)
    for poses in sorted(content.poses.values(), key=lambda poses: poses.topic):
        if poses.child_frame_id:
            notes.append(
                f"{poses.topic} says where {poses.child_frame_id!r} is, and no transforms lead from there to the "
                f"camera {frame!r}"
            )
    return None


def _from_given_topic(content: LogContent, frame: str, parameters: IngestParameters, where: str) -> PoseSource:
    poses = content.poses.get(str(parameters.pose_topic))
    if poses is None:
        topics = ", ".join(sorted(content.poses)) or "none"
        raise BadInput(f"{where}: no poses on topic {parameters.pose_topic!r}", hint=f"topics with poses: {topics}")
    if poses.child_frame_id and not _are_connected(content, poses, frame):
        raise BadInput(
            f"{where}: {poses.topic} says where {poses.child_frame_id!r} is, and no transforms lead from there to the "
            f"camera {frame!r}",
            hint="record tf_static",
        )
    return _source_of_topic(poses, content, frame, parameters, where)


def _source_of_topic(
    poses: Poses, content: LogContent, frame: str, parameters: IngestParameters, where: str
) -> PoseSource:
    world = parameters.world_frame or poses.frame_id
    if world != poses.frame_id:
        _check_frame(world, content, where)
        content.tree.between(world, poses.frame_id)
    notes = []
    if not poses.child_frame_id:
        notes.append(
            f"poses from {poses.topic} ({content.topics[poses.topic].described()}), which does not say whose they are: "
            f"taken as poses of the camera {frame!r}"
        )
    elif poses.child_frame_id != frame:
        _check_parents(content.tree, content.tree.between(poses.child_frame_id, frame), where)
    rule = f"poses of {frame!r} in {world!r} from {poses.topic}"
    if poses.child_frame_id and poses.child_frame_id != frame:
        rule += f" ({poses.child_frame_id!r}) and {', '.join(sorted(content.transform_topics))}"
    return PoseSource(
        world, rule, content.tree, *_limits(parameters), poses, poses.child_frame_id or frame, tuple(notes)
    )
