"""A log of messages, whatever its container, as frames."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import LabelEntry
from scenewright.stages.ingest.inertial import measured_up
from scenewright.stages.ingest.messages.camera_frames import depth_note, frame_entries
from scenewright.stages.ingest.messages.camera_geometry import CameraGeometry, geometry_of
from scenewright.stages.ingest.messages.cameras import (
    CameraTopics,
    alternatives,
    calibration_topic,
    chosen_cameras,
    find_cameras,
    unpaired_side,
    unread_depth,
)
from scenewright.stages.ingest.messages.container import MessageLog
from scenewright.stages.ingest.messages.opening import open_message_log
from scenewright.stages.ingest.messages.pose_source import PoseSource, find_poses, why_no_poses
from scenewright.stages.ingest.messages.survey import LogContent, survey
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.source import Entry, LogSource, SourceCamera
from scenewright.stages.kit.formats.frame_streams import LABELS_METADATA, WORLD_METADATA

REFUSE_HINT = "leave out --damage refuse to use what is whole"


def open_messages(path: Path, parameters: IngestParameters, rule: str) -> LogSource:
    """Survey a log of messages and list its frames.

    Raises BadInput when it cannot be read, holds images but no calibration, or does not hold what the options ask for;
    with `damage="refuse"` also when anything of it is damaged.
    """
    log = open_message_log(path, salvage=parameters.damage == "salvage")
    try:
        content = survey(log)
        damage = (*log.damage, *content.damage())
        if damage and parameters.damage == "refuse":
            raise BadInput(f"{path}: {damage[0]}", hint=REFUSE_HINT)
        return _source(log, content, damage, parameters, rule)
    except BaseException:
        log.close()
        raise


def _source(
    log: MessageLog, content: LogContent, damage: tuple[str, ...], parameters: IngestParameters, rule: str
) -> LogSource:
    where = str(log.path)
    cameras = find_cameras(content)
    if not cameras:
        return _without_frames(log, content, damage, rule)
    chosen, others = chosen_cameras(cameras, content, parameters, where)
    built = [_Built(log, content, topics, parameters, where) for topics in chosen]
    main = built[0]
    stated = log.metadata.get(WORLD_METADATA, {})
    world = None if main.poses is None else main.poses.world
    up, up_note = _up(content, main.poses)
    worlds = {each.poses.world for each in built if each.poses is not None}
    if len(worlds) > 1:
        raise BadInput(
            f"{where}: the cameras have poses in different worlds, {' and '.join(sorted(worlds))}",
            hint="give --world-frame, or choose one with --camera",
        )
    entries = [entry for each in built for entry in each.entries]
    entries.sort(key=lambda entry: entry.time)
    notes = [note for each in built for note in each.notes(len(built) > 1)] + content.notes + up_note + log.notes
    return LogSource(
        format=log.format,
        rule="; ".join([rule, *(each.rule(len(built) > 1) for each in built)]),
        cameras=tuple(each.camera(stated.get("registered") != "no") for each in built),
        entries=tuple(entries),
        notes=tuple(dict.fromkeys(notes)),
        world_up="z" if stated.get("world_up") == "z" and stated.get("world_frame") == world else "unknown",
        world_up_detail=f"metadata record {WORLD_METADATA!r} of the log says that z of frame {world!r} is up",
        up_in_log=up,
        label_table=_label_table(log.metadata.get(LABELS_METADATA, {}), where),
        has_labels=any(each.topics.labels is not None for each in built),
        damage=damage,
        streams=content.streams(),
        other_cameras=tuple(camera.name for camera in others),
        missing=main.missing,
        close=log.close,
    )


class _Built:
    """One camera with its frames."""

    def __init__(
        self, log: MessageLog, content: LogContent, topics: CameraTopics, parameters: IngestParameters, where: str
    ) -> None:
        self.topics = topics
        self._content = content
        self._geometry: CameraGeometry = geometry_of(topics, content, parameters, where)
        self.poses, pose_notes = find_poses(content, self._geometry.frame, parameters, where)
        self.entries: list[Entry]
        self.entries, frame_notes = frame_entries(log, content, topics, self._geometry, self.poses, parameters)
        depth_notes = [] if topics.depth is None else [depth_note(log, topics.depth, content, parameters)]
        side = unpaired_side(topics, content)
        if side is not None:
            frame_notes.append(side)
        unused = alternatives(topics, content)
        if unused:
            frame_notes.append(f"not used: {', '.join(unused)} (--color-topic, --depth-topic)")
        self.missing = {} if self.poses else {"pose": why_no_poses(content, self._geometry.frame)}
        if topics.depth is None and (unread := unread_depth(content)):
            self.missing["depth"] = unread
        reasons = [f"frames have no {'poses' if name == 'pose' else name}: {why}" for name, why in self.missing.items()]
        self._notes = [*self._geometry.notes, *pose_notes, *depth_notes, *frame_notes, *reasons]

    def camera(self, registered: bool) -> SourceCamera:
        """Return the camera; `registered` is what the log says itself."""
        geometry = self._geometry
        eyes = (self.topics.color or "left", self.topics.right or "right")
        registered = geometry.registered and registered
        return SourceCamera(self.topics.name, geometry.camera, geometry.baseline, eyes=eyes, registered=registered)

    def notes(self, named: bool) -> list[str]:
        """Return what was assumed, with the camera's name in front when there are several."""
        return [f"{self.topics.name}: {note}" for note in self._notes] if named else self._notes

    def rule(self, named: bool) -> str:
        """Return in words which topics were used."""
        geometry, topics = self._geometry, self.topics
        phrases = []
        if geometry.color is not None:
            phrases.append(f"{'left' if geometry.right is not None else 'colour'} from {topics.color}")
        if geometry.right is not None:
            phrases.append(f"right from {topics.right}")
        if geometry.depth is not None and topics.depth is not None:
            phrases.append(f"depth from {topics.depth} ({self._content.images[topics.depth].encoding})")
        if topics.labels is not None:
            phrases.append(f"labels from {topics.labels}")
        calibration = calibration_topic(topics.main, self._content)
        if calibration is not None:
            phrases.append(f"calibration from {calibration}")
        phrases.append("no poses" if self.poses is None else self.poses.rule)
        return (f"{topics.name}: " if named else "") + ", ".join(phrases)


def _without_frames(log: MessageLog, content: LogContent, damage: tuple[str, ...], rule: str) -> LogSource:
    """A log without any image is empty; one with images of which none can be used is bad input, as is one of which
    nothing can be read."""
    if not content.topics and damage:
        raise BadInput(f"{log.path}: nothing in it can be read: {damage[0]}", hint="copy the log again")
    if content.images:
        reasons = [f"{name}: {content.topics[name].unreadable}" for name in sorted(content.images)]
        raise BadInput(f"{log.path}: no images that can be used ({'; '.join(reasons)[:400]})", hint="docs/LOGS.md")
    videos = [f"{name}: {topic.unreadable}" for name, topic in sorted(content.topics.items()) if topic.unreadable]
    notes = [
        f"the log holds no image messages; topics: {content.described_topics()}",
        *content.notes,
        *videos[:5],
        *log.notes,
    ]
    camera = Camera(width=0, height=0, fx=1, fy=1, cx=0, cy=0)
    return LogSource(
        log.format,
        rule,
        (SourceCamera("camera", camera),),
        (),
        tuple(notes),
        damage=damage,
        streams=content.streams(),
        close=log.close,
    )


def _up(content: LogContent, poses: PoseSource | None) -> tuple[np.ndarray | None, list[str]]:
    """Return up in the world of the poses by the first IMU whose frame they reach, and what was found."""
    notes: list[str] = []
    for _, inertial in sorted(content.inertial.items()):
        if poses is None:
            return None, ["IMU not used for up: there are no poses"]
        try:
            up, note = measured_up(inertial.samples, partial(poses.at, inertial.frame_id))
        except BadInput as problem:
            notes.append(f"IMU not used for up: {problem.message}")
            continue
        notes.append(f"{note} ({inertial.topic})")
        if up is not None:
            return up, notes
    return None, notes


def _label_table(table: dict[str, str], where: str) -> tuple[LabelEntry, ...]:
    try:
        return tuple(LabelEntry(instance=int(key), class_name=table[key]) for key in sorted(table, key=int))
    except ValueError:
        raise BadInput(f"{where}: metadata record {LABELS_METADATA!r} has a key that is not a number") from None
