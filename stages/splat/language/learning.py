"""Teach the language field what the squares of the pictures say, at the surface that each pixel shows.

The thesis rasterises what the grids hold at the Gaussians' centres and runs the network at each pixel; here the field
is looked up where the splat has its surface at the pixel, which is the same for opaque surfaces and needs no gradients
through the picture. Of a pixel's seven squares one is drawn at random; its size in the room is share x height x depth /
focal length. Huber loss (delta 1.25), Adam 2.5e-3 to 1e-3.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.cameras import scaled
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.rasterizer import Rasterizer, View
from scenewright.stages.splat.language.field import LanguageField
from scenewright.stages.splat.language.pyramid import Level

DELTA = 1.25
"""Difference from which on the Huber loss is linear."""
FIRST_RATE, LAST_RATE = 2.5e-3, 1e-3
"""Rates of learning at the first and the last step."""
SAMPLES = 3072
"""Pixels of all pictures in a step."""
SMALLER = 0.25
"""Size of the pictures whose pixels are drawn."""
COVERED = 0.6
"""Alpha from which on a pixel shows a surface."""


@dataclass(frozen=True)
class Lesson:
    """What pixels of one picture say."""

    places: np.ndarray
    """(N, 3) float32 surface points [m, world]."""
    depths: np.ndarray
    """(N,) float32 z-depth [m]."""
    vectors: np.ndarray
    """(N, levels, width) float16."""
    metres: np.ndarray
    """(levels,) size of a square per metre of depth."""


def lesson_of(
    levels: list[Level], gaussians: Gaussians, rasterizer: Rasterizer, camera: Camera, camera_from_world: np.ndarray
) -> Lesson:
    """Return the lesson of a picture with this pyramid: the pixels of a quarter of its size where the splat is."""
    small = scaled(camera, SMALLER)
    picture = rasterizer.draw(gaussians, View(small, camera_from_world)).picture
    rows, columns = np.nonzero(picture.alpha > COVERED)
    depths = (picture.depth[rows, columns] / picture.alpha[rows, columns]).astype(np.float32)
    rays = np.stack([(columns - small.cx) / small.fx, (rows - small.cy) / small.fy, np.ones(len(rows))], axis=1)
    pose = inverse(camera_from_world)
    places = (rays * depths[:, None]) @ pose[:3, :3].T + pose[:3, 3]
    across, down = (columns + 0.5) * camera.width / small.width - 0.5, (rows + 0.5) * camera.height / small.height - 0.5
    vectors = np.stack([level.at(down, across) for level in levels], axis=1).astype(np.float16)
    metres = np.array([level.share * camera.height / camera.fy for level in levels], np.float32)
    return Lesson(places.astype(np.float32), depths, vectors, metres)


def learn(field: LanguageField, lessons: list[Lesson], steps: int, random: np.random.Generator) -> Iterator[float]:
    """Take `steps` steps; yield the loss of each."""
    optimizer = torch.optim.Adam(field.parameters(), lr=FIRST_RATE, eps=1e-15, fused=True)
    lengths = np.array([len(lesson.places) for lesson in lessons])
    filled = np.flatnonzero(lengths)
    per_picture = max(1, SAMPLES // 6)
    for step in range(steps):
        for group in optimizer.param_groups:
            group["lr"] = FIRST_RATE * (LAST_RATE / FIRST_RATE) ** (step / max(1, steps - 1))
        places, sizes, target_vectors = [], [], []
        for which in random.choice(filled, 6):
            lesson = lessons[which]
            at = random.integers(0, len(lesson.places), per_picture)
            level = random.integers(0, len(lesson.metres), per_picture)
            places.append(lesson.places[at])
            sizes.append(lesson.metres[level] * lesson.depths[at])
            target_vectors.append(lesson.vectors[at, level])
        predicted = field(torch.from_numpy(np.concatenate(places)), torch.from_numpy(np.concatenate(sizes)))
        target = torch.from_numpy(np.concatenate(target_vectors).astype(np.float32))
        loss = torch.nn.functional.huber_loss(predicted, target, delta=DELTA, reduction="none").sum(dim=1).mean()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        yield float(loss.detach())
