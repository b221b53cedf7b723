"""Stored frames as training samples: crops, mirroring, lost colour, lost gravity, other tones and noise."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.training.data import DEPTH_UNIT, HEIGHT, WIDTH
from benchmarks.training.targets import IGNORED, SOME_THING, Targets, make_targets
from schemas.errors import BadInput
from schemas.scene_parts import Camera
from schemas.vocabulary import load_vocabulary
from stages.segment.backends.network.features import STRIDE, Mount, features

CROP_WIDTH, CROP_HEIGHT = 256, 192
COLOR_DROPOUT, GRAVITY_DROPOUT, FLOOR_DROPOUT = 0.35, 0.3, 0.35
"""Shares of samples that are shown without colour, without gravity, and of those with gravity without the floor."""


@dataclass(frozen=True)
class StoredFrame:
    """One frame of a shard."""

    color: np.ndarray
    depth: np.ndarray
    """[m]"""
    labels: np.ndarray
    camera: Camera
    up: np.ndarray
    """Zeros where gravity is not known."""
    height: float
    classes: tuple[str, ...]


class FrameSet:
    """All frames of a set of shards, memory-mapped. Raises BadInput for a folder without shards."""

    def __init__(self, folder: Path) -> None:
        self._folder = Path(folder)
        self._shards: list[tuple[list[np.ndarray], list[Any]]] = []
        self._places: list[tuple[int, int]] = []
        for shard in sorted(file.parent for file in Path(folder).glob("shard_*/frames.json")):
            rows = json.loads((shard / "frames.json").read_text())
            arrays = [
                np.load(shard / f"{name}.npy", mmap_mode="r", allow_pickle=False)
                for name in ("color", "depth", "label")
            ]
            self._places += [(len(self._shards), k) for k in range(len(rows))]
            self._shards.append((arrays, rows))
        if not self._places:
            raise BadInput(f"{folder}: no frames", hint="make them first: python -m benchmarks.training.data")

    def __reduce__(self) -> tuple[type[FrameSet], tuple[Path]]:
        """Another process maps the files itself."""
        return FrameSet, (self._folder,)

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int) -> StoredFrame:
        shard, k = self._places[index]
        (color, depth, label), rows = self._shards[shard]
        row = rows[k]
        return StoredFrame(
            color=np.asarray(color[k]),
            depth=depth[k].astype(np.float32) * np.float32(DEPTH_UNIT),
            labels=np.asarray(label[k]),
            camera=Camera(**row["camera"]),
            up=np.array(row["up"]),
            height=row["height"],
            classes=tuple(row["classes"]),
        )

    def class_names(self) -> tuple[str, ...]:
        """Return the classes that occur, in the order of the vocabulary."""
        found = {name for _, rows in self._shards for row in rows for name in row["classes"]}
        return tuple(entry.name for entry in load_vocabulary().classes if entry.name in found)


def as_sample(
    frame: StoredFrame, classes: tuple[str, ...], *, color: bool, gravity: bool
) -> tuple[np.ndarray, Targets]:
    """Return (inputs (16, H, W), targets at half of that) of a whole frame, as it is."""
    mount = Mount(frame.up, frame.height) if gravity else Mount()
    inputs = features(frame.depth, frame.color if color else None, frame.camera, mount)
    return inputs, _targets(frame.labels, frame.classes, classes)


def _targets(labels: np.ndarray, names: tuple[str, ...], classes: tuple[str, ...]) -> Targets:
    vocabulary = load_vocabulary()
    table, things = np.full(len(names) + 1, IGNORED, dtype=np.int64), np.zeros(len(names) + 1, dtype=bool)
    for label, name in enumerate(names, start=1):
        if name in classes:
            table[label] = classes.index(name)
            things[label] = vocabulary.by_name(name).kind == "thing"
        else:
            things[label] = name == SOME_THING
    return make_targets(labels[::STRIDE, ::STRIDE], table, things)


def varied(
    frame: StoredFrame, classes: tuple[str, ...], random: np.random.Generator, *, whole: bool
) -> tuple[np.ndarray, Targets]:
    """Return (inputs, targets) of a frame changed at random: a crop of 256x192 pixels out of the frame (at up to 1.25
    times coarser pixels), or with `whole` the whole frame; mirrored; other colours; wrong or missing gravity."""
    color, depth, labels = frame.color, frame.depth, frame.labels
    camera, up, height = frame.camera, frame.up, frame.height
    if not whole:
        color, depth, labels, camera = _crop(color, depth, labels, camera, random)
    if random.random() < 0.5:
        color, depth, labels = color[:, ::-1], depth[:, ::-1], labels[:, ::-1]
        camera = camera.model_copy(update={"cx": camera.width - 1 - camera.cx})
        up = up * np.array([-1.0, 1.0, 1.0])
    if random.random() < 0.25:
        depth = _cut_background(depth, random)
    mount = Mount()
    if np.any(up) and random.random() >= GRAVITY_DROPOUT:
        tilted = up + random.normal(0.0, 0.025, 3)
        known = random.random() >= FLOOR_DROPOUT
        mount = Mount(tilted / np.linalg.norm(tilted), height + float(random.normal(0.0, 0.03)) if known else None)
    shown = None if random.random() < COLOR_DROPOUT else _other_colors(color, random)
    inputs = features(np.ascontiguousarray(depth), shown, camera, mount)
    if shown is None:
        # Where neither colour nor depth says anything for many pixels around, nothing can be asked of the network.
        blind = cv2.erode((depth == 0).astype(np.uint8), np.ones((15, 15), np.uint8)) > 0
        labels = np.where(blind, 0, labels)
    return inputs, _targets(np.ascontiguousarray(labels), frame.classes, classes)


def _crop(
    color: np.ndarray, depth: np.ndarray, labels: np.ndarray, camera: Camera, random: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Camera]:
    share = float(random.uniform(CROP_WIDTH / WIDTH, 1.0))
    width, height = round(WIDTH * share), round(HEIGHT * share)
    left, top = int(random.integers(WIDTH - width + 1)), int(random.integers(HEIGHT - height + 1))
    factor = CROP_WIDTH / width
    window = (slice(top, top + height), slice(left, left + width))
    size = (CROP_WIDTH, CROP_HEIGHT)
    camera = Camera(
        width=CROP_WIDTH,
        height=CROP_HEIGHT,
        fx=camera.fx * factor,
        fy=camera.fy * factor,
        cx=(camera.cx - left + 0.5) * factor - 0.5,
        cy=(camera.cy - top + 0.5) * factor - 0.5,
    )
    return (
        cv2.resize(np.ascontiguousarray(color[window]), size, interpolation=cv2.INTER_AREA),
        cv2.resize(np.ascontiguousarray(depth[window]), size, interpolation=cv2.INTER_NEAREST_EXACT),
        cv2.resize(np.ascontiguousarray(labels[window]), size, interpolation=cv2.INTER_NEAREST_EXACT),
        camera,
    )


def _cut_background(depth: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return depth without what lies beyond a random distance."""
    valid = depth[depth > 0]
    if not len(valid):
        return depth
    limit = float(np.quantile(valid, random.uniform(0.4, 1.0))) * 1.05
    return np.where(depth > limit, 0, depth).astype(np.float32)


def _other_colors(color: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the image with other gains, contrast, gamma, saturation, vignette, defocus or motion blur, noise and JPEG,
    moved by up to four pixels against the depth as in logs whose colour is not registered."""
    image: np.ndarray = color.astype(np.float32) / 255
    if random.random() < 0.3:
        du, dv = random.integers(-4, 5, 2)
        image = np.roll(image, (int(dv), int(du)), axis=(0, 1))
    grey = image.mean(axis=2, keepdims=True)
    image = grey + float(random.choice([0.0, 1.0], p=[0.08, 0.92]) * random.uniform(0.3, 1.4)) * (image - grey)
    image = image * random.uniform(0.6, 1.5) * random.uniform(0.75, 1.25, 3).astype(np.float32)
    image = (image - 0.5) * random.uniform(0.6, 1.4) + 0.5 + random.uniform(-0.1, 0.1)
    image = np.clip(image, 0, 1) ** np.float32(np.exp(random.uniform(-0.5, 0.5)))
    blur = random.random()
    if blur < 0.25:
        image = cv2.GaussianBlur(image, (0, 0), float(random.uniform(0.4, 1.8)))
    elif blur < 0.4:
        image = cv2.filter2D(image, -1, _motion(random))
    if random.random() < 0.3:
        v, u = np.mgrid[-1 : 1 : image.shape[0] * 1j, -1 : 1 : image.shape[1] * 1j]
        fall = 1 - float(random.uniform(0, 0.5)) * ((u - random.uniform(-1, 1)) ** 2 + v**2) / 2
        image = image * fall[..., None].astype(np.float32)
    image = image + np.float32(random.uniform(0, 0.06)) * random.standard_normal(image.shape, dtype=np.float32)
    shown = np.clip(np.round(image * 255), 0, 255).astype(np.uint8)
    if random.random() < 0.3:
        quality = int(random.integers(20, 90))
        encoded = cv2.imencode(".jpg", shown, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        return np.asarray(cv2.imdecode(encoded, cv2.IMREAD_COLOR))
    return shown


def _motion(random: np.random.Generator) -> np.ndarray:
    """Return the kernel of a straight motion of up to nine pixels."""
    kernel = np.zeros((9, 9), np.float32)
    angle, length = float(random.uniform(0, np.pi)), float(random.uniform(1.5, 4.4))
    step = (length * np.cos(angle), length * np.sin(angle))
    cv2.line(kernel, (round(4 - step[0]), round(4 - step[1])), (round(4 + step[0]), round(4 + step[1])), 1.0)
    return kernel / kernel.sum()
