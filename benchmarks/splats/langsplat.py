"""LangSplat (Qin et al., CVPR 2024), small: every Gaussian holds a code of three numbers for each of three levels, in a
space that an autoencoder of this room makes out of what its segments say.

As there: segments of three levels (whole, part, subpart), each cut out on black and encoded; an autoencoder of the
room's vectors alone; codes learned through the rasteriser against the segments' codes (L1) while the Gaussians stay as
they are; a text is asked of all levels, and the level with the greatest relevancy answers. Otherwise: the segments are
those of our pieces at three granularities, seen in each picture (SAM is not here), the autoencoder has two hidden
layers, and pictures are a quarter as large.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from scenewright.stages.kit.geometry.cameras import scaled
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.open_words.encoder import Encoder
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture, Rasterizer, View
from scenewright.stages.splat import Sight
from scenewright.stages.splat.language.pieces import pieces
from scipy.spatial import cKDTree
from torch import nn

CODE = 3
"""Numbers of a code, as there."""
EPOCHS, AUTOENCODER_RATE = 100, 7e-4
STEPS, CODE_RATE = 300, 0.0025
"""Theirs are 30,000 steps of a graphics card."""
SMALLER = 0.25
LEAST_PIXELS = 12
"""Of a segment, in the smaller picture."""
COVERED = 0.6
FIRST, SECOND = 0.9, 0.999


class Autoencoder(nn.Module):
    """Vectors (N, width) <-> codes (N, CODE), both of length 1."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.down = nn.Sequential(nn.Linear(width, 64), nn.ReLU(), nn.Linear(64, 16), nn.ReLU(), nn.Linear(16, CODE))
        self.up = nn.Sequential(nn.Linear(CODE, 16), nn.ReLU(), nn.Linear(16, 64), nn.ReLU(), nn.Linear(64, width))

    def encode(self, vectors: torch.Tensor) -> torch.Tensor:
        """Return codes of vectors."""
        return nn.functional.normalize(self.down(vectors), dim=-1)

    def decode(self, codes: torch.Tensor) -> torch.Tensor:
        """Return vectors of codes."""
        return nn.functional.normalize(self.up(codes), dim=-1)


@dataclass(frozen=True)
class Segmented:
    """One picture's segments."""

    view: View
    labels: np.ndarray
    """(levels, H, W): row of `vectors`, -1 where there is none."""
    vectors: np.ndarray
    """(S, width)."""


def segmented(
    sight: Sight, gaussians: Gaussians, numbered: np.ndarray, tree: cKDTree, rasterizer: Rasterizer, encoder: Encoder
) -> Segmented:
    """Return what a picture's segments say; `numbered` (levels, N): their pieces; `tree`: of their centres."""
    view = View(scaled(sight.camera, SMALLER), sight.camera_from_world)
    picture = rasterizer.draw(gaussians, view).picture
    rows, columns = np.nonzero(picture.alpha > COVERED)
    depths = picture.depth[rows, columns] / picture.alpha[rows, columns]
    camera, pose = view.camera, inverse(sight.camera_from_world)
    rays = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy, np.ones(len(rows))], axis=1)
    nearest = tree.query((rays * depths[:, None]) @ pose[:3, :3].T + pose[:3, 3])[1]
    labels = np.full((len(numbered), *picture.alpha.shape), -1)
    crops: list[np.ndarray] = []
    small = cv2.resize(sight.color, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
    for level, piece in enumerate(numbered):
        seen = np.full(picture.alpha.shape, -1)
        seen[rows, columns] = piece[nearest]
        for which in np.unique(seen[seen >= 0]):
            mask = seen == which
            if mask.sum() >= LEAST_PIXELS:
                labels[level][mask] = len(crops)
                crops.append(_cut(small, mask, encoder.side))
    vectors = encoder.pictures(np.stack(crops)) if crops else np.zeros((0, encoder.width), np.float32)
    return Segmented(view, labels, vectors)


def _cut(color: np.ndarray, mask: np.ndarray, side: int) -> np.ndarray:
    """Return the square about a mask (H, W), black around it."""
    rows, columns = np.nonzero(mask)
    top, left = rows.min(), columns.min()
    part = np.where(mask[..., None], color, 0)[top : rows.max() + 1, left : columns.max() + 1]
    length = max(part.shape[:2])
    square = np.zeros((length, length, 3), np.uint8)
    down, across = (length - part.shape[0]) // 2, (length - part.shape[1]) // 2
    square[down : down + part.shape[0], across : across + part.shape[1]] = part
    return cv2.resize(square, (side, side), interpolation=cv2.INTER_AREA)


def fitted(vectors: np.ndarray, seed: int) -> Autoencoder:
    """Return the autoencoder of a room's vectors (S, width): squared difference and cosine, as there."""
    torch.manual_seed(seed)
    coder, given = Autoencoder(vectors.shape[1]), torch.from_numpy(np.ascontiguousarray(vectors, np.float32))
    optimizer = torch.optim.Adam(coder.parameters(), lr=AUTOENCODER_RATE)
    for _ in range(EPOCHS):
        for rows in torch.randperm(len(given)).split(64):
            found = coder.decode(coder.encode(given[rows]))
            cosine = nn.functional.cosine_similarity(found, given[rows]).mean()
            loss = ((found - given[rows]) ** 2).sum(dim=1).mean() + 0.001 * (1 - cosine)
            optimizer.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
    return coder


def learned_codes(
    gaussians: Gaussians, lessons: Sequence[Segmented], codes: Sequence[np.ndarray], rasterizer: Rasterizer, steps: int
) -> np.ndarray:
    """Return (N, levels, CODE) learned against the codes (S, CODE) of each picture's segments."""
    levels = lessons[0].labels.shape[0]
    held = np.zeros((len(gaussians), levels * CODE), np.float32)
    first, second = np.zeros_like(held), np.zeros_like(held)
    random = np.random.default_rng(0)
    for step in range(1, steps + 1):
        which = int(random.integers(len(lessons)))
        lesson = lessons[which]
        drawn = rasterizer.draw(replace(gaussians, features=held), lesson.view)
        wanted = np.concatenate([codes[which], np.zeros((1, CODE), np.float32)])[lesson.labels]
        wanted = wanted.transpose(1, 2, 0, 3).reshape(*lesson.labels.shape[1:], -1)
        known = np.repeat((lesson.labels >= 0).transpose(1, 2, 0), CODE, axis=2)
        by = np.where(known, np.sign(drawn.picture.features - wanted), 0) / max(int(known.sum()), 1)
        shown = drawn.picture
        nothing = np.zeros_like(shown.color), np.zeros_like(shown.depth), np.zeros_like(shown.alpha)
        gradient = drawn.backward(Picture(*nothing, by)).features
        first = FIRST * first + (1 - FIRST) * gradient
        second = SECOND * second + (1 - SECOND) * gradient**2
        scale = np.sqrt(second / (1 - SECOND**step)) + 1e-15
        held -= np.float32(CODE_RATE) * (first / (1 - FIRST**step) / scale).astype(np.float32)
    return held.reshape(len(gaussians), levels, CODE)


def langsplat(
    gaussians: Gaussians, sights: Sequence[Sight], encoder: Encoder, rasterizer: Rasterizer, *, steps: int = STEPS
) -> np.ndarray:
    """Return (N, levels, width): what every Gaussian says at each level, out of its codes."""
    numbered, tree = pieces(gaussians), cKDTree(gaussians.means)
    lessons = [segmented(sight, gaussians, numbered, tree, rasterizer, encoder) for sight in sights]
    coder = fitted(np.concatenate([lesson.vectors for lesson in lessons]), 0)
    with torch.inference_mode():
        codes = [coder.encode(torch.from_numpy(lesson.vectors)).numpy() for lesson in lessons]
        held = learned_codes(gaussians, lessons, codes, rasterizer, steps)
        return coder.decode(torch.from_numpy(held)).numpy()
