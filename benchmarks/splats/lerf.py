"""LERF (Kerr et al., ICCV 2023), small: a radiance field and a language field, both rendered along rays.

As there: density and colour from hash grids, rendered by sampling rays, learned from colour alone and from all pictures
at once; a language field of 2 x 12 levels of 8 numbers and a network of 4 layers of 256, looked up at 24 samples of a
ray, each at the size that the pixel's square has at that depth, summed by the same weights and made of length 1; Huber
loss; crops of 0.05 to 0.5 of the height; RAdam. A text is asked of a view at all sizes; the best size of the view, then
its best pixel, at the depth rendered there. Otherwise: 2^16 entries a level, fewer rays a step and samples a ray, those
where it is dense drawn by a first pass through the same field instead of by networks of their own, and no DINO branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.splat import HashGrid, LanguageField, PosedView
from scenewright.stages.splat.language.field import ENTRIES, Space
from scenewright.stages.splat.language.pyramid import Level
from scenewright.stages.splat.methods.method import Rate
from torch import nn

RAYS, FIRST_SAMPLES, SAMPLES, LANGUAGE_SAMPLES = 512, 48, 32, 24
NEAR, FAR = 0.1, 8.0
"""Of a ray [m along the view's axis]."""
NUMBERS, LANGUAGE_NUMBERS, LANGUAGE_LAYERS = 2, 8, 4
HIDDEN, GEOMETRY = 64, 15
RATE, LANGUAGE_RATE, DECAY = 1e-2, Rate(1e-2, 1e-3, 4000), 1e-9
LANGUAGE_WEIGHT, DELTA = 0.1, 1.25
LOOKED_AT = 1024
"""Pixels of a picture that it is judged by: all would take a minute each."""


class RadianceField(nn.Module):
    """Places [m] and directions -> density [1/m] and colour."""

    def __init__(self, cameras: np.ndarray, entries: int) -> None:
        super().__init__()
        self.space, self.grid = Space(cameras), HashGrid(entries, NUMBERS)
        self.dense = nn.Sequential(nn.Linear(self.grid.width, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 1 + GEOMETRY))
        self.color = nn.Sequential(nn.Linear(GEOMETRY + 3, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, 3), nn.Sigmoid())

    def density(self, places: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return (N,) and what colour is made of."""
        found = self.dense(self.grid(self.space(places)))
        return torch.exp(found[:, 0].clamp(max=10) - 1), found[:, 1:]


@dataclass(frozen=True)
class Rays:
    """Rays with what they show."""

    origins: torch.Tensor
    directions: torch.Tensor
    """(R, 3), of length 1 along the view's axis, so that a distance is a z-depth."""
    colors: torch.Tensor


@dataclass(frozen=True)
class Rendered:
    """What rays show."""

    color: torch.Tensor
    depth: torch.Tensor
    weights: torch.Tensor
    """(R, SAMPLES)."""
    distances: torch.Tensor


class Lerf:
    """A room learned from all its pictures; language, too, where `pyramids` says what they say."""

    def __init__(
        self,
        views: Sequence[PosedView],
        seed: int,
        pyramids: Sequence[list[Level]] | None = None,
        width: int = 0,
        *,
        entries: int = ENTRIES,
    ) -> None:
        torch.manual_seed(seed)
        self.random = np.random.default_rng(seed)
        self.views, self.pyramids = list(views), pyramids
        poses = np.array([inverse(view.camera_from_world) for view in views])
        middle, reach = poses[:, :3, 3].mean(axis=0), max(float(np.ptp(poses[:, :3, 3], axis=0).max()), 1.0)
        box = middle + reach * np.array([[-1.0] * 3, [1.0] * 3])
        self.field = RadianceField(box, entries)
        self.optimizers: list[torch.optim.Optimizer] = [torch.optim.Adam(self.field.parameters(), lr=RATE, eps=1e-15)]
        self.language = None
        if pyramids is not None:
            self.language = LanguageField(box, width, entries, numbers=LANGUAGE_NUMBERS, layers=LANGUAGE_LAYERS)
            self.optimizers.append(
                torch.optim.RAdam(self.language.parameters(), lr=LANGUAGE_RATE.first, weight_decay=DECAY, eps=1e-15)
            )
        self.steps = 0

    def step(self) -> float:
        """Compare some rays of all pictures with what is rendered, and improve; return the loss before."""
        which = self.random.integers(0, len(self.views), RAYS)
        rows = np.array([self.random.integers(self.views[k].camera.height) for k in which])
        columns = np.array([self.random.integers(self.views[k].camera.width) for k in which])
        rays = self._rays(which, rows, columns)
        shown = self.render(rays)
        loss = ((shown.color - rays.colors) ** 2).mean()
        if self.language is not None:
            loss = loss + LANGUAGE_WEIGHT * self._language_loss(shown, rays, which, rows, columns)
            self.optimizers[1].param_groups[0]["lr"] = LANGUAGE_RATE.at(self.steps)
        for optimizer in self.optimizers:
            optimizer.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        for optimizer in self.optimizers:
            optimizer.step()
        self.steps += 1
        return float(loss.detach())

    def render(self, rays: Rays) -> Rendered:
        """Return what rays show: samples by a first, even pass, then where it found density."""
        count = len(rays.origins)
        even = torch.linspace(0, 1, FIRST_SAMPLES + 1)
        edges = NEAR * (FAR / NEAR) ** even
        with torch.no_grad():
            jitter = torch.rand(count, FIRST_SAMPLES)
            first = edges[:-1] + jitter * (edges[1:] - edges[:-1])
            weights = _weights(self._density(rays, first)[0], first) + 1e-3
            sums = torch.cumsum(weights / weights.sum(dim=1, keepdim=True), dim=1)
            at = ((torch.arange(SAMPLES) + torch.rand(count, SAMPLES)) / SAMPLES).clamp(max=1 - 1e-6)
            which = torch.searchsorted(sums, at).clamp(max=FIRST_SAMPLES - 1)
            distances = (edges[which] + torch.rand(count, SAMPLES) * (edges[which + 1] - edges[which])).sort(dim=1)[0]
        density, made_of = self._density(rays, distances)
        towards = nn.functional.normalize(rays.directions, dim=1)[:, None, :].expand(-1, SAMPLES, -1)
        colors = self.field.color(torch.cat([made_of, towards], dim=2))
        weights = _weights(density, distances)
        depth = (weights * distances).sum(dim=1) / weights.sum(dim=1).clamp(min=1e-6)
        return Rendered((weights[..., None] * colors).sum(dim=1), depth, weights, distances)

    def said(self, rays: Rays, shown: Rendered, metres: torch.Tensor) -> torch.Tensor:
        """Return (R, width) of rays whose squares have `metres` (R,) per metre of depth."""
        assert self.language is not None
        top = shown.weights.detach().topk(min(LANGUAGE_SAMPLES, SAMPLES), dim=1)
        distances = shown.distances.gather(1, top.indices)
        places = rays.origins[:, None] + distances[..., None] * rays.directions[:, None]
        found = self.language.raw(places.reshape(-1, 3), (distances * metres[:, None]).reshape(-1))
        summed = (top.values[..., None] * found.reshape(*distances.shape, -1)).sum(dim=1)
        return nn.functional.normalize(summed, dim=1)

    def looked_at(self, view: PosedView) -> tuple[float, float | None]:
        """Return PSNR [dB] and the median error of depth [m] of a picture, by LOOKED_AT of its pixels."""
        pixels = np.random.default_rng(view.frame).integers(0, view.color.shape[0] * view.color.shape[1], LOOKED_AT)
        rows, columns = np.divmod(pixels, view.color.shape[1])
        with torch.inference_mode():
            shown = self.render(rays_of(view, rows, columns))
        error = float(((shown.color.numpy() - view.color[rows, columns]) ** 2).mean())
        known = np.zeros(len(rows)) if view.depth is None else view.depth[rows, columns]
        apart = np.abs(shown.depth.numpy() - known)[known > 0]
        return -10 * np.log10(max(error, 1e-10)), float(np.median(apart)) if len(apart) else None

    def view_vectors(
        self, camera: Camera, camera_from_world: np.ndarray, sizes: Sequence[float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return vectors (H x W, sizes, width) that a view shows at sizes [m], and its surface points (H x W, 3)."""
        blank = np.zeros((camera.height, camera.width, 3), np.float32)
        view = PosedView(0, 0.0, "", camera, blank, None, camera_from_world)
        rows, columns = np.divmod(np.arange(camera.height * camera.width), camera.width)
        found, points = [], []
        with torch.inference_mode():
            for part in np.array_split(np.arange(len(rows)), max(1, len(rows) // RAYS)):
                rays = rays_of(view, rows[part], columns[part])
                shown = self.render(rays)
                metres = [torch.full((len(part),), float(size)) / shown.depth for size in sizes]
                found.append(torch.stack([self.said(rays, shown, each) for each in metres], dim=1).numpy())
                points.append((rays.origins + shown.depth[:, None] * rays.directions).numpy())
        return np.concatenate(found), np.concatenate(points)

    def _density(self, rays: Rays, distances: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        places = rays.origins[:, None] + distances[..., None] * rays.directions[:, None]
        density, made_of = self.field.density(places.reshape(-1, 3))
        return density.reshape(distances.shape), made_of.reshape(*distances.shape, -1)

    def _rays(self, which: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> Rays:
        order = np.argsort(which, kind="stable")
        parts = [
            rays_of(self.views[k], rows[order][which[order] == k], columns[order][which[order] == k])
            for k in np.unique(which)
        ]
        back = torch.from_numpy(np.argsort(order, kind="stable"))
        return Rays(*(torch.cat([getattr(part, name) for part in parts])[back] for name in Rays.__dataclass_fields__))

    def _language_loss(
        self, shown: Rendered, rays: Rays, which: np.ndarray, rows: np.ndarray, columns: np.ndarray
    ) -> torch.Tensor:
        assert self.pyramids is not None
        level = self.random.integers(len(self.pyramids[0]), size=len(which))
        wanted, metres = [], []
        for k, row, column, number in zip(which, rows, columns, level, strict=True):
            square, camera = self.pyramids[k][number], self.views[k].camera
            wanted.append(square.at(np.array([row]), np.array([column]))[0])
            metres.append(square.share * camera.height / camera.fy)
        found = self.said(rays, shown, torch.tensor(metres, dtype=torch.float32))
        target = torch.from_numpy(np.array(wanted, np.float32))
        return nn.functional.huber_loss(found, target, delta=DELTA, reduction="none").sum(dim=1).mean()


def rays_of(view: PosedView, rows: np.ndarray, columns: np.ndarray) -> Rays:
    """Return the rays of pixels (R,) of a view."""
    camera, pose = view.camera, inverse(view.camera_from_world)
    local = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy, np.ones(len(rows))], axis=1)
    directions = torch.from_numpy((local @ pose[:3, :3].T).astype(np.float32))
    origins = torch.from_numpy(pose[:3, 3].astype(np.float32)).expand(len(rows), 3)
    return Rays(origins, directions, torch.from_numpy(view.color[rows, columns].astype(np.float32)))


def _weights(density: torch.Tensor, distances: torch.Tensor) -> torch.Tensor:
    """Return how much each sample (R, S) of rays counts (Max 1995); behind the last the ray ends."""
    lengths = torch.diff(distances, dim=1, append=torch.full((len(distances), 1), FAR + 1.0))
    alpha = 1 - torch.exp(-density * lengths.clamp(min=0))
    through = torch.cumprod(1 - alpha + 1e-10, dim=1)
    return alpha * torch.cat([torch.ones(len(alpha), 1), through[:, :-1]], dim=1)
