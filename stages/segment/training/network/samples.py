"""Stored frames: as they lie in their shards, as samples without any change, and as batches on a device."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.segment.backends.network.features import STRIDE, Mount, features
from scenewright.stages.segment.training.network.drawn_features import CameraBatch
from scenewright.stages.segment.training.network.shards import DEPTH_UNIT
from scenewright.stages.segment.training.network.targets import IGNORED, SOME_THING, Targets, make_targets

LABELS = 256
"""Labels that a picture of one byte a pixel can hold."""


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
        self.folder, self._known = Path(folder), set[str]()
        self.shards: list[list[np.ndarray]] = []
        """Colour, depth [DEPTH_UNIT] and labels of every shard."""
        self.rows: list[list[Any]] = []
        """What frames.json says of the frames of every shard."""
        self._places: list[tuple[int, int]] = []
        self.grow()
        if not self._places:
            raise BadInput(f"{folder}: no frames", hint="make them first (docs/SEGMENTATION.md)")

    def grow(self) -> None:
        """Take the shards that were written since."""
        found = sorted(file.parent for file in self.folder.glob("shard_*/frames.json"))
        for shard in (each for each in found if each.name not in self._known):
            self._known.add(shard.name)
            rows = json.loads((shard / "frames.json").read_text())
            # Copied when written to, which nobody does: torch takes no array that cannot be.
            arrays = [
                np.load(shard / f"{name}.npy", mmap_mode="c", allow_pickle=False)
                for name in ("color", "depth", "label")
            ]
            self._places += [(len(self.shards), k) for k in range(len(rows))]
            self.shards.append(arrays)
            self.rows.append(rows)

    def __len__(self) -> int:
        return len(self._places)

    def place(self, index: int) -> tuple[int, int]:
        """Return the shard of a frame and its place in it."""
        return self._places[index]

    def __getitem__(self, index: int) -> StoredFrame:
        shard, k = self._places[index]
        color, depth, label = self.shards[shard]
        row = self.rows[shard][k]
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
        found = {name for rows in self.rows for row in rows for name in row["classes"]}
        return tuple(entry.name for entry in load_vocabulary().classes if entry.name in found)


def as_sample(
    frame: StoredFrame, classes: tuple[str, ...], *, color: bool, gravity: bool
) -> tuple[np.ndarray, Targets]:
    """Return (inputs (16, H, W), targets at half of that) of a whole frame, as it is."""
    mount = Mount(frame.up, frame.height) if gravity else Mount()
    inputs = features(frame.depth, frame.color if color else None, frame.camera, mount)
    return inputs, make_targets(frame.labels[::STRIDE, ::STRIDE], *label_tables(frame.classes, classes))


def label_tables(names: tuple[str, ...], classes: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return of every label (LABELS,) the number of its class among `classes`, IGNORED where it has none, and whether
    it is one thing. `names`: the class of label 1, 2, ..."""
    vocabulary = load_vocabulary()
    table, things = np.full(LABELS, IGNORED, dtype=np.int64), np.zeros(LABELS, dtype=bool)
    for label, name in enumerate(names, start=1):
        if name in classes:
            table[label] = classes.index(name)
            things[label] = vocabulary.by_name(name).kind == "thing"
        else:
            things[label] = name == SOME_THING
    return table, things


@dataclass(frozen=True)
class Frames:
    """B stored frames on a device."""

    color: torch.Tensor
    """(B, H, W, 3) uint8."""
    depth: torch.Tensor
    """(B, H, W) float32 [m]."""
    labels: torch.Tensor
    """(B, H, W) uint8; 0 nothing."""
    cameras: CameraBatch
    up: torch.Tensor
    """(B, 3); zeros where gravity is not known."""
    height: torch.Tensor
    """(B,) [m]."""
    class_of_label: torch.Tensor
    """(B, LABELS) int64."""
    thing_of_label: torch.Tensor
    """(B, LABELS) bool."""


class Store:
    """Sets of frames on a device (where that is the processor, they stay mapped from the disk)."""

    def __init__(self, sets: list[FrameSet], classes: tuple[str, ...], device: str) -> None:
        self.sets, self._classes, self._device = sets, classes, device
        self._shards: list[list[list[torch.Tensor]]] = [[] for _ in sets]
        self.grow()

    def grow(self) -> None:
        """Take the shards that were written since."""
        for frames, shards in zip(self.sets, self._shards, strict=True):
            frames.grow()
            for arrays, rows in zip(frames.shards[len(shards) :], frames.rows[len(shards) :], strict=True):
                color, depth, label = (torch.from_numpy(array) for array in arrays)
                tables = [label_tables(tuple(row["classes"]), self._classes) for row in rows]
                cameras = [[row["camera"][name] for name in ("fx", "fy", "cx", "cy")] for row in rows]
                mounts = [[*row["up"], row["height"]] for row in rows]
                told = [
                    torch.from_numpy(np.stack([table for table, _ in tables])),
                    torch.from_numpy(np.stack([things for _, things in tables])),
                    torch.tensor(cameras, dtype=torch.float32),
                    torch.tensor(mounts, dtype=torch.float32),
                ]
                # torch counts with few kinds of unsigned numbers: the bits of the depth as signed ones.
                shards.append([part.to(self._device) for part in (color, depth.view(torch.int16), label, *told)])

    def frames(self, chosen: list[tuple[int, int]]) -> Frames:
        """Return those that are told by their set and their number in it."""
        places = [(self._shards[which], *self.sets[which].place(index)) for which, index in chosen]
        parts = [torch.stack([shards[shard][k][row] for shards, shard, row in places]) for k in range(7)]
        color, depth, labels, table, things, cameras, mounts = parts
        return Frames(
            color,
            (depth.to(torch.int32) & 0xFFFF).to(torch.float32) * DEPTH_UNIT,
            labels,
            CameraBatch(*cameras.T),
            mounts[:, :3],
            mounts[:, 3],
            table,
            things,
        )
