"""Batches of crops and phrases, drawn on a processor or a GPU (torch).

A crop of a room is labelled by the thing at its middle; other things that it shows are neither right nor wrong. Models
are set before pieces of rooms. Then light, sharpness and noise change a little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from scenewright.stages.kit.open_words.two_towers import SIDE, tokens
from scenewright.stages.splat.training.words.lexicon import FALSE, TRUE, UNKNOWN, Lexicon
from scenewright.stages.splat.training.words.samples import RENDERED, Samples
from scipy.ndimage import find_objects

LEAST_PIXELS = 40
"""Pixels of a thing in a picture that a crop about it needs."""
MAIN_SHARE = 0.3
"""Share, weighted towards the middle, of a crop from which on it shows its main thing."""
PRESENT_SHARE = 0.03
"""Share, weighted towards the middle, of a crop from which on another thing counts as present."""
OTHERS = 4
"""Other things of a crop that are remembered: those of most pixels."""
MOST_ATTRIBUTES = 4
"""Attributes of a thing that are remembered: the first of these."""
PHRASES = 32
"""Phrases of a thing that are drawn from."""
TRIES = 8
"""Points of a thing's box that are tried for the middle of a crop."""


@dataclass(frozen=True)
class Places:
    """Where things are seen: (P,) frames and things, boxes (P, 4) top, left, height, width [px]."""

    frames: np.ndarray
    things: np.ndarray
    boxes: np.ndarray


def places_of(samples: Samples) -> Places:
    """Return where at least LEAST_PIXELS of a thing are seen."""
    frames, things, boxes = [], [], []
    for frame, labels in enumerate(samples.labels):
        counts = np.bincount(labels.reshape(-1), minlength=len(samples.things))
        found = find_objects(labels)
        for thing in np.flatnonzero(counts >= LEAST_PIXELS):
            if thing and found[thing - 1] is not None:
                rows, columns = found[thing - 1]
                frames.append(frame)
                things.append(int(thing))
                boxes.append((rows.start, columns.start, rows.stop - rows.start, columns.stop - columns.start))
    return Places(np.array(frames), np.array(things), np.array(boxes, float))


@dataclass(frozen=True)
class Crops:
    """N crops."""

    pictures: torch.Tensor
    """(N, 3, SIDE, SIDE), 0 to 1."""
    main: torch.Tensor
    """(N,) things."""
    others: torch.Tensor
    """(N, OTHERS) things; 0 none."""
    valid: torch.Tensor
    """(N,) bool: the crop shows its main thing, more than any other."""


class Drawer:
    """Draws crops out of samples, on a device."""

    def __init__(self, samples: Samples, classes: int, device: str) -> None:
        """`classes`: so many of the first attributes are classes, of which each is drawn as often."""
        self.device = device
        self.frames = torch.from_numpy(samples.frames).to(device)
        self.labels = torch.from_numpy(samples.labels.astype(np.int32)).to(device)
        self.sprites = torch.from_numpy(samples.sprites).to(device)
        self.masks = torch.from_numpy(samples.masks).to(device)
        self.sprite_things = torch.from_numpy(samples.sprite_things).to(device)
        self.held = torch.from_numpy(samples.held).to(device)
        self.things = torch.from_numpy(samples.things).to(device)
        self.places = places_of(samples)
        self.kinds = samples.things[:, :classes].argmax(axis=1)
        side = (torch.arange(SIDE, device=device) + 0.5) / SIDE
        bell = torch.exp(-0.5 * ((side - 0.5) / 0.25) ** 2)
        self._bell = (bell[:, None] * bell) / bell.sum() ** 2
        self._fine = (torch.arange(2 * SIDE, device=device) + 0.5) / (2 * SIDE)
        self._coarse = side

    def evenly_by_class(self, keep: np.ndarray, random: np.random.Generator, count: int) -> np.ndarray:
        """Return `count` places among those where `keep` (P,) is true, every class as often as another."""
        rows = np.flatnonzero(keep)
        kinds, member = np.unique(self.kinds[self.places.things[rows]], return_inverse=True)
        order = np.argsort(member, kind="stable")
        starts = np.searchsorted(member[order], np.arange(len(kinds) + 1))
        drawn = random.integers(len(kinds), size=count)
        sizes = starts[drawn + 1] - starts[drawn]
        return rows[order[starts[drawn] + (random.random(count) * sizes).astype(int)]]

    def of_rooms(self, places: np.ndarray, random: np.random.Generator) -> Crops:
        """Return a crop about each of these places (N,)."""
        count, (height, width) = len(places), self.labels.shape[1:]
        frames = torch.from_numpy(self.places.frames[places]).to(self.device)
        things = torch.from_numpy(self.places.things[places]).to(self.device)
        top, left, high, wide = self.places.boxes[places].T
        tried = random.random((TRIES, 2, count))
        rows = (top + tried[:, 0] * high).astype(int)
        columns = (left + tried[:, 1] * wide).astype(int)
        middle = random.random(count) < 0.5
        rows[-1], columns[-1] = top + (high - 1) // 2, left + (wide - 1) // 2
        rows[:, middle], columns[:, middle] = rows[-1, middle], columns[-1, middle]
        at = [torch.from_numpy(v).to(self.device) for v in (rows, columns)]
        there = self.labels[frames[None], at[0], at[1]] == things[None]
        first = torch.where(there.any(0), there.to(torch.int8).argmax(0), torch.tensor(TRIES - 1, device=self.device))
        row, column = (v.gather(0, first[None])[0].float() for v in at)
        extent = torch.from_numpy(np.maximum(high, wide) * random.uniform(0.8, 1.9, count)).float().to(self.device)
        side = extent.clamp(14, min(0.55 * height, 200)).round()
        low = torch.stack(
            [torch.minimum((v - side / 2).clamp(min=0), n - side) for v, n in ((row, height), (column, width))], 1
        )
        pictures = self._cut(self.frames, frames, low, side, self._fine)
        main, others, valid = self._shown(frames, low, side)
        return Crops(pictures, main, others, valid & (self.held[main] == self.held[things]))

    def of_models(self, models: np.ndarray, random: np.random.Generator) -> Crops:
        """Return each of these models (N,) from some side before a piece of a room."""
        count, (height, width) = len(models), self.labels.shape[1:]
        which = torch.from_numpy(models).to(self.device)
        views = torch.from_numpy(random.integers(self.masks.shape[1], size=count)).to(self.device)
        frames = torch.from_numpy(random.integers(len(self.frames), size=count)).to(self.device)
        side = torch.from_numpy(random.integers(16, 110, count)).float().to(self.device)
        free = torch.from_numpy(random.random((count, 2))).float().to(self.device)
        low = free * torch.stack([height - side, width - side], 1)
        behind = self._cut(self.frames, frames, low, side, self._fine)
        zoom = torch.from_numpy(RENDERED * random.uniform(0.75, 1.15, count)).float().to(self.device)
        shift = torch.from_numpy(random.uniform(-0.08, 0.08, (count, 2))).float().to(self.device)
        start = (RENDERED - zoom)[:, None] / 2 + RENDERED * shift
        flat = which * self.masks.shape[1] + views
        front = self._cut(self.sprites.flatten(0, 1), flat, start, zoom, self._fine)
        mask = self._cut(self.masks.flatten(0, 1)[..., None], flat, start, zoom, self._fine, outside=True) * 255.0
        light = random.uniform(0.6, 1.25, (count, 1)) * random.uniform(0.93, 1.07, (count, 3))
        front = (front * torch.from_numpy(light).float().to(self.device)[:, :, None, None]).clamp(0, 1)
        things = self.sprite_things[which]
        nothing = torch.zeros((count, OTHERS), dtype=torch.int64, device=self.device)
        return Crops(front * mask + behind * (1 - mask), things, nothing, torch.ones_like(things, dtype=torch.bool))

    def _cut(
        self,
        pictures: torch.Tensor,
        which: torch.Tensor,
        low: torch.Tensor,
        side: torch.Tensor,
        grid: torch.Tensor,
        *,
        outside: bool = False,
    ) -> torch.Tensor:
        """Return (N, C, SIDE, SIDE): squares of pictures (F, H, W, C), from `low` (N, 2) on, `side` (N,) long, each
        pixel the mean of four bilinear ones. `outside`: 0 beyond the edge, instead of the edge."""
        height, width = pictures.shape[1:3]
        places = [low[:, k, None] + side[:, None] * grid - 0.5 for k in (0, 1)]
        firsts = [v.floor() for v in places]
        shares = [v - f for v, f in zip(places, firsts, strict=True)]
        total = torch.zeros((), device=self.device)
        for dr in (0, 1):
            for dc in (0, 1):
                r, c = firsts[0].long() + dr, firsts[1].long() + dc
                values = pictures[
                    which[:, None, None], r.clamp(0, height - 1)[:, :, None], c.clamp(0, width - 1)[:, None, :]
                ].float()
                weight = (1 - dr - shares[0]).abs()[:, :, None] * (1 - dc - shares[1]).abs()[:, None, :]
                if outside:
                    weight = weight * ((r >= 0) & (r < height))[:, :, None] * ((c >= 0) & (c < width))[:, None, :]
                total = total + weight[..., None] * values
        small = total.reshape(len(which), SIDE, 2, SIDE, 2, -1).mean(dim=(2, 4))
        return small.permute(0, 3, 1, 2) / 255.0

    def _shown(
        self, frames: torch.Tensor, low: torch.Tensor, side: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return the main thing (N,) of squares, others (N, OTHERS), and whether there is a main one."""
        rows, columns = ((low[:, k, None] + side[:, None] * self._coarse).long() for k in (0, 1))
        seen = self.labels[frames[:, None, None], rows[:, :, None], columns[:, None, :]].flatten(1).long()
        weighted = torch.zeros((len(frames), len(self.things)), device=self.device)
        plain = torch.zeros_like(weighted)
        weighted.scatter_add_(1, seen, self._bell.flatten().expand(len(frames), -1))
        plain.scatter_add_(1, seen, torch.full_like(seen, 1, dtype=torch.float32) / seen.shape[1])
        share, main = weighted.max(dim=1)
        plain.scatter_(1, main[:, None], 0.0)
        plain[:, 0] = 0.0
        shares, others = plain.topk(OTHERS, dim=1)
        return main, torch.where(shares > PRESENT_SHARE, others, 0), (share >= MAIN_SHARE) & (main > 0)


def changed(pictures: torch.Tensor, random: np.random.Generator) -> torch.Tensor:
    """Return pictures (N, 3, S, S) in slightly other light, mirrored half of the time, blurred or noisy."""
    count, device = len(pictures), pictures.device

    def drawn(low: float, high: float, *shape: int) -> torch.Tensor:
        return torch.from_numpy(random.uniform(low, high, (count, *shape))).float().to(device)

    mirrored = drawn(0, 1, 1, 1, 1) < 0.5
    pictures = torch.where(mirrored, pictures.flip(3), pictures).clamp(0, 1)
    pictures = pictures.clamp(min=1e-4) ** drawn(0.8, 1.25, 1, 1, 1)
    pictures = pictures * drawn(0.75, 1.2, 1, 1, 1) * drawn(0.94, 1.06, 3, 1, 1)
    soft = torch.nn.functional.avg_pool2d(pictures, 3, 1, 1, count_include_pad=False)
    softer = torch.nn.functional.avg_pool2d(soft, 3, 1, 1, count_include_pad=False)
    blur = drawn(-1.5, 1.0, 1, 1, 1).clamp(min=0)
    pictures = torch.lerp(pictures, softer, blur)
    generator = torch.Generator(device).manual_seed(int(random.integers(2**31)))
    noise = torch.randn(pictures.shape, generator=generator, device=device)
    return (pictures + drawn(0, 0.02, 1, 1, 1) * noise).clamp(0, 1)


class PhrasePool:
    """Phrases of every thing, none held out, made once."""

    def __init__(self, samples: Samples, words: Lexicon, seed: int, device: str) -> None:
        random = np.random.default_rng(seed)
        self.texts: list[str] = []
        self.of_thing = np.zeros((len(samples.things), PHRASES), np.int64)
        known: dict[tuple[str, tuple[int, ...]], int] = {}
        attributes: list[tuple[int, ...]] = []
        rows, member = np.unique(samples.things, axis=0, return_inverse=True)
        for row, drawn in enumerate(rows):
            things = np.flatnonzero(member.reshape(-1) == row)
            if not drawn.any() or samples.held[things].all():
                continue
            found = [words.training_phrase(drawn, random) for _ in range(PHRASES)]
            for place, phrase in enumerate(found):
                key = (phrase.text, phrase.attributes)
                if key not in known:
                    known[key] = len(self.texts)
                    self.texts.append(phrase.text)
                    attributes.append(phrase.attributes)
                self.of_thing[things, place] = known[key]
        self.tokens = tokens(self.texts).to(device)
        self.attributes = attribute_table(attributes, len(words.attributes)).to(device)


def attribute_table(attributes: list[tuple[int, ...]], none: int) -> torch.Tensor:
    """Return (M, MOST_ATTRIBUTES) int64, filled up with `none`."""
    table = torch.full((len(attributes), MOST_ATTRIBUTES), none, dtype=torch.int64)
    for row, own in enumerate(attributes):
        table[row, : len(own)] = torch.tensor(own)
    return table


def truth_of_things(things: torch.Tensor, attributes: torch.Tensor) -> torch.Tensor:
    """Return (N, M) int8 for things (N, A) and `attribute_table` (M, MOST_ATTRIBUTES), as `lexicon.truth_of`."""
    padded = torch.cat([things, torch.full_like(things[:, :1], TRUE)], dim=1)
    values = padded[:, attributes]
    unknown = torch.where((values == UNKNOWN).any(2), UNKNOWN, TRUE)
    return torch.where((values == FALSE).any(2), FALSE, unknown).to(torch.int8)


def truth_of_crops(things: torch.Tensor, crops: Crops, attributes: torch.Tensor) -> torch.Tensor:
    """Return (N, M) int8 of the crops' main things, of `things` (T, A): unknown where it is false but not false of
    every other thing that a crop shows, and where a crop is not valid."""
    truth = truth_of_things(things[crops.main], attributes)
    for column in range(crops.others.shape[1]):
        others = truth_of_things(things[crops.others[:, column]], attributes)
        truth = torch.where((truth == FALSE) & (others != FALSE), UNKNOWN, truth)
    return torch.where(crops.valid[:, None], truth, UNKNOWN)
