"""Frames as they are stored for training: shards, which whoever makes frames writes and the training maps.

A shard is a folder with `color.npy` (N, 240, 320, 3) uint8, `depth.npy` (N, 240, 320) uint16 [0.25 mm], `label.npy`
(N, 240, 320) uint8 (place in the frame's table of instances + 1, 0 = nothing) and `frames.json` (camera, mount, class
of every instance). Arrays are memory-mapped, so training needs little memory.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.scene_parts import Camera

WIDTH, HEIGHT = 320, 240
DEPTH_UNIT = 0.00025
"""[m]"""


@dataclass(frozen=True)
class Sample:
    """One frame as it is stored."""

    color: np.ndarray
    depth: np.ndarray
    label: np.ndarray
    camera: Camera
    up: np.ndarray
    height: float
    classes: tuple[str, ...]
    """Class of label 1, 2, ..."""
    origin: str


def write_shard(samples: list[Sample], folder: Path) -> None:
    """Write the samples as one shard."""
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / "color.npy", np.stack([sample.color for sample in samples]))
    np.save(folder / "depth.npy", np.stack([sample.depth for sample in samples]))
    np.save(folder / "label.npy", np.stack([sample.label for sample in samples]))
    rows = [
        {
            "camera": sample.camera.model_dump(),
            "up": [round(float(v), 6) for v in sample.up],
            "height": round(sample.height, 4),
            "classes": list(sample.classes),
            "origin": sample.origin,
        }
        for sample in samples
    ]
    # Last and at once: whoever sees it finds a whole shard.
    (folder / "rows.json").write_text(json.dumps(rows) + "\n")
    (folder / "rows.json").replace(folder / "frames.json")
