"""Tiny scenes with a known surface: boxes on a floor, ray cast in numpy, written as sequence and segments."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.base import as_transform
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment, FrameSegments, Segments, SegmentsFile
from scenewright.schemas.sequence import Gravity, Sequence, SequenceCamera, SequenceFile
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.kit.formats.masks import write_panoptic_zip
from scenewright.stages.kit.formats.trajectories import write_tum
from scenewright.stages.kit.geometry.transforms import look_at

CAMERA = Camera(width=160, height=120, fx=130.0, fy=130.0, cx=79.5, cy=59.5)
THINGS = frozenset(entry.id for entry in load_vocabulary().classes if entry.kind == "thing")


def class_id(name: str) -> int:
    return load_vocabulary().by_name(name).id


@dataclass(frozen=True)
class Block:
    """An axis-aligned box of a class."""

    class_name: str
    minimum: tuple[float, float, float]
    maximum: tuple[float, float, float]


FLOOR = Block("floor", (-3.0, -3.0, -1.0), (3.0, 3.0, 0.0))
TABLE = Block("table", (-0.6, -0.4, 0.0), (0.6, 0.4, 0.5))
CUP = Block("cup", (-0.4, -0.1, 0.5), (-0.2, 0.1, 0.7))
OTHER_CUP = Block("cup", (0.2, -0.1, 0.5), (0.4, 0.1, 0.65))
SCENE = (FLOOR, TABLE, CUP, OTHER_CUP)


def rays(camera: Camera, world_from_camera: np.ndarray) -> np.ndarray:
    """World directions (H, W, 3) whose length makes the ray parameter the z-depth."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    directions = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
    return directions @ world_from_camera[:3, :3].T


def render(
    blocks: tuple[Block, ...], world_from_camera: np.ndarray, camera: Camera = CAMERA
) -> tuple[np.ndarray, np.ndarray]:
    """z-depth (H, W) float32 [m], 0 where nothing is hit, and the number 1.. of the block that is hit (H, W) int32."""
    directions, eye = rays(camera, world_from_camera), world_from_camera[:3, 3]
    depths = []
    for block in blocks:
        with np.errstate(divide="ignore", invalid="ignore"):
            near = (np.array(block.minimum) - eye) / directions
            far = (np.array(block.maximum) - eye) / directions
        enter, leave = np.minimum(near, far).max(axis=-1), np.maximum(near, far).min(axis=-1)
        depths.append(np.where((enter <= leave) & (enter > 0), enter, np.inf))
    nearest = np.min(depths, axis=0)
    hit = np.isfinite(nearest)
    return np.where(hit, nearest, 0).astype(np.float32), np.where(hit, np.argmin(depths, axis=0) + 1, 0).astype(
        np.int32
    )


def sphere_depth(center: np.ndarray, radius: float, world_from_camera: np.ndarray, camera: Camera) -> np.ndarray:
    """z-depth (H, W) float32 of a sphere, 0 where it is missed."""
    directions, offset = rays(camera, world_from_camera), center - world_from_camera[:3, 3]
    a, b = (directions**2).sum(axis=-1), directions @ offset
    root = b**2 - a * (offset @ offset - radius**2)
    return np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, 0).astype(np.float32)


def orbit(count: int, radius: float = 1.8, height: float = 1.5, target: tuple[float, ...] = (0.0, 0.0, 0.3)) -> list:
    """Poses on a circle that look at `target`."""
    angles = 2 * np.pi * np.arange(count) / count
    return [
        look_at(np.array([radius * np.cos(a), radius * np.sin(a), height]), np.array(target, dtype=float))
        for a in angles
    ]


def frame_segments(
    blocks: tuple[Block, ...], image: np.ndarray, background: tuple[int, ...] = ()
) -> list[FrameSegment]:
    """One segment for every visible block; those in `background` lost their prediction."""
    result = []
    for number in np.unique(image[image > 0]).tolist():
        name = blocks[number - 1].class_name
        known = number not in background
        result.append(
            FrameSegment(
                id=number,
                class_id=class_id(name) if known else 0,
                instance=number if known else 0,
                is_thing=class_id(name) in THINGS and known,
                score=1.0,
                area=int((image == number).sum()),
            )
        )
    return result


def color_of(image: np.ndarray) -> np.ndarray:
    """A plain colour for every block."""
    return np.stack([(40 * image) % 256, (90 * image) % 256, (140 * image) % 256], axis=-1).astype(np.uint8)


def write_scene(
    root: Path,
    blocks: tuple[Block, ...] = SCENE,
    frames: int = 12,
    *,
    with_pose: bool = True,
    with_depth: bool = True,
    background: dict[int, tuple[int, ...]] | None = None,
) -> tuple[Sequence, Segments]:
    """Write a sequence and true segments under `root`. `background`: frame -> blocks without prediction."""
    sequence, segments = Sequence(root=root / "sequence"), Segments(root=root / "segments")
    for folder in (sequence.root, segments.root):
        folder.mkdir(parents=True)
    poses = orbit(frames)
    images, listings = [], []
    with FrameWriter(sequence.path("frames.mcap"), CAMERA) as writer:
        for index, pose in enumerate(poses):
            depth, image = render(blocks, pose)
            writer.write(0.1 * index, color_of(image), depth if with_depth else None, pose if with_pose else None)
            images.append((index, image))
            lost = (background or {}).get(index, ())
            listings.append(FrameSegments(frame=index, segments=tuple(frame_segments(blocks, image, lost))))
    write_tum(sequence.path("trajectory.tum"), 0.1 * np.arange(frames), np.array(poses))
    SequenceFile(
        source_format="test",
        rule="test",
        camera=CAMERA,
        cameras=(SequenceCamera(name="camera", camera=CAMERA),),
        streams=("color", "depth", "pose"),
        frame_count=frames,
        frames_in_log=frames,
        gravity=Gravity(method="given", world_from_log=as_transform(np.eye(4))),
    ).write(sequence.path("sequence.json"))
    write_panoptic_zip(segments.path("panoptic.zip"), images)
    SegmentsFile(
        backend="ground-truth", label="true blocks", width=CAMERA.width, height=CAMERA.height, frames=tuple(listings)
    ).write(segments.path("segments.json"))
    return sequence, segments
