"""What only a needle has in the pictures, along the outline that fits the masks best.

Masks of a depth edge, of a fold or of a shadowed rim can have a needle's form. A wire differs from what lies on both of
its sides all along, at the width that a needle has where it would lie; an edge, sharp or soft, has colours that lie
between those of its sides.
Steel is grey and mirrors what is about it, so that it gleams here and there. A wire ends; an edge or a thread goes on
along the outline's tangents.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.suture.needle.silhouette import WIRE_RADIUS, Arc, Outline, Sheet, arc_at, trace
from scenewright.stages.suture.rig import NEEDLE_RADIUS, StereoRig

NAMES = ("ridge", "width", "colour", "gleam", "going_on")
"""What `looks_of` returns, in its order."""
BESIDE = (1.5, 3.0)
"""How far beyond the wire's rim [px] its surroundings are looked at."""
WITHIN = (-0.4, 0.0, 0.4)
"""Where the wire itself is looked at, in shares of half its width."""
ACROSS = np.linspace(-1.0, 1.0, 25)
"""Where its profile is looked at, from one side's surroundings to the other's."""
BLUR = 1.0
"""A line of no width looks so wide [px]; by eye."""
USUAL_WIDTH = -0.27
"""What a needle's wire has for a width by `_widths`: its lights are narrower than it is. Median of 33 tuning views."""
ALONG = 2
"""Pieces on either side over which colours are averaged."""
BEYOND = np.array([0.10, 0.16, 0.22, 0.28])
"""How far beyond an end it is looked for whether the wire goes on, as a share of the needle's radius."""
NOISE = 4.0
"""Differences of colour of so many grey levels are half noise; by eye."""
FEWEST_RIDGE = 0.1
"""Share of the pieces that may be less of a ridge than is told: glints and crossings hide it; by eye."""
DARK = 24.0
"""Grey levels that are added before colours are compared: in the dark they are noise; by eye."""
NOTHING = np.array([0.0, 1.0, 1.0, 0.0, 1.0])
"""The looks of an outline of which the pictures show nothing."""


def looks_of(
    rig: StereoRig, sheets: tuple[Sheet, Sheet], pictures: tuple[np.ndarray, np.ndarray], outline: Outline
) -> np.ndarray:
    """Return NAMES (5,) of an outline in two pictures (H, W, 3) uint8 RGB.

    `ridge`: how far the wire's colour lies from every blend of its two sides' colours, against how far these lie from
    each other, 0 (an edge between them) to 1 (a wire before one ground), of the pieces where it is least so; `width`:
    by what factor it looks wider or thinner than a needle (the logarithm); `colour`: how far from grey it is, 0 to 1;
    `gleam`: how much its brightness changes along it, 0 to 1; `going_on`: how much of its contrast goes on beyond the
    end that ends less clearly, 0 to 1 (an end that thread or something else hides is none). Pieces count that
    the mask shows and whose sides are clear of the needle's other half.
    """
    arc = arc_at(rig, outline.pose.camera_from_needle, outline.shift)
    seen = [_eye_looks(arc, *of_eye, eye) for eye, of_eye in enumerate(zip(sheets, pictures, strict=True))]
    both = np.concatenate([of_eye.colours for of_eye in seen])
    if len(both) == 0:
        return NOTHING
    strength = np.linalg.norm(both[:, 0] - both[:, 1:].mean(axis=1), axis=1)
    ends = [of_eye.beyond for of_eye in seen if of_eye.beyond is not None]
    going_on = float(np.mean(ends)) / (float(np.median(strength)) + NOISE) if ends else 0.0
    return np.array(
        [
            np.quantile(_ridges(both), FEWEST_RIDGE),
            abs(float(np.median(np.concatenate([of_eye.widths for of_eye in seen]))) - USUAL_WIDTH),
            _colourfulness(both[:, 0]).mean(),
            np.mean([of_eye.gleam() for of_eye in seen if len(of_eye.colours)]),
            min(going_on, 1.0),
        ]
    )


@dataclass(frozen=True)
class _EyeLooks:
    """Of the pieces that count in one eye: colours (P, 3, 3) of the wire and of its two sides, the logarithm (P,) of
    how many times a needle's width the wire has; the contrast beyond the end that goes on more, None where none is
    clear."""

    colours: np.ndarray
    widths: np.ndarray
    beyond: float | None

    def gleam(self) -> float:
        """Return how much the wire's brightness changes along it, 0 to 1."""
        low, high = np.quantile(self.colours[:, 0].mean(axis=1), (0.1, 0.9))
        return float(high - low) / 255.0


def _ridges(colours: np.ndarray) -> np.ndarray:
    """Return of each piece's colours (P, 3, 3), the wire's and its sides', how much of a ridge (P,) it is, 0 to 1."""
    wire, step = colours[:, 0] - colours[:, 1], colours[:, 2] - colours[:, 1]
    share = np.clip((wire * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-9), 0.0, 1.0)
    away = np.linalg.norm(wire - share[:, None] * step, axis=1)
    return np.asarray(away / (away + np.linalg.norm(step, axis=1) + NOISE))


def _colourfulness(colours: np.ndarray) -> np.ndarray:
    """Return how far from grey (...) colours (..., 3) are, 0 to 1."""
    return np.asarray((colours.max(axis=-1) - colours.min(axis=-1)) / (colours.max(axis=-1) + DARK))


def _eye_looks(arc: Arc, sheet: Sheet, picture: np.ndarray, eye: int) -> _EyeLooks:
    """Return what one eye sees of the outline."""
    _, pixels = trace(arc, sheet.corner, eye)
    middles = 0.5 * (pixels[1:] + pixels[:-1])
    tangents = np.diff(pixels[:, :2], axis=0)
    lengths = np.linalg.norm(tangents, axis=1, keepdims=True)
    tangents /= np.maximum(lengths, 1e-6)
    places = _across(middles, tangents)
    colours = _sampled(picture, places + sheet.corner)
    colours = np.stack([colours[:, :3].mean(axis=1), colours[:, 3:5].mean(axis=1), colours[:, 5:].mean(axis=1)], axis=1)
    counts = _on_mask(sheet, middles) & _clear(middles, places[:, 3:])
    if not counts.any():
        return _EyeLooks(np.empty((0, 3, 3)), np.empty(0), None)
    averaged = _along(colours[counts])
    wire = float(pixels[:, 2].max())
    ends = [
        _beyond(picture, sheet, np.array([*pixels[at, :2], wire]), sign * tangents[at])
        for at, sign in ((0, -1.0), (-1, 1.0))
    ]
    clear = [end for end in ends if end is not None]
    widths = _widths(picture, middles[counts] + [*sheet.corner, 0.0], tangents[counts])
    return _EyeLooks(averaged, widths, max(clear) if clear else None)


def _along(values: np.ndarray) -> np.ndarray:
    """Return what pieces have (P, ...), averaged over the next ALONG on either side."""
    index = np.arange(len(values))
    near = np.abs(index[:, None] - index) <= ALONG
    return np.tensordot(near / near.sum(axis=1, keepdims=True), values, axes=1)


def _widths(picture: np.ndarray, middles: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """Return the logarithm (P,) of how many times as wide as drawn the wire looks at middles (P, 3): the area under its
    profile over the profile's height."""
    normals = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    reaches = (middles[:, 2:] + BESIDE[-1]) * ACROSS
    colours = _sampled(picture, middles[:, None, :2] + reaches[..., None] * normals[:, None])
    share = ((1.0 + ACROSS) / 2.0)[None, :, None]
    ground = colours[:, :1] * (1.0 - share) + colours[:, -1:] * share
    profile = _along(np.linalg.norm(colours - ground, axis=2))
    found = profile.mean(axis=1) * (reaches[:, -1] - reaches[:, 0]) / np.maximum(profile.max(axis=1), NOISE)
    return np.asarray(np.log(np.maximum(found, 0.1) / (2.0 * middles[:, 2] + BLUR)))


def _across(middles: np.ndarray, tangents: np.ndarray) -> np.ndarray:
    """Return the places (P, 7, 2) across the wire: three on it, two on each side; middles (P, 3) hold its radius."""
    normals = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    radii = middles[:, 2:]
    sides = [radii + beside for beside in BESIDE]
    reaches = np.concatenate([radii * np.array(WITHIN), *sides, *(-side for side in sides)], axis=1)
    return np.asarray(middles[:, None, :2] + reaches[..., None] * normals[:, None])


def _sampled(picture: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the picture's colours (..., 3) float at places (..., 2) (column, row), its rim's outside of it."""
    columns, rows = (places[..., k].astype(np.float32).reshape(1, -1) for k in (0, 1))
    found = cv2.remap(picture, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found, dtype=float).reshape(*places.shape[:-1], 3)


def _on_mask(sheet: Sheet, places: np.ndarray) -> np.ndarray:
    """Return which places (P, 2 or more) lie on the mask, and not where something hides the needle."""
    columns, rows = np.round(places[:, :2]).astype(int).T
    height, width = sheet.signed.shape
    inside = (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
    columns, rows = columns.clip(0, width - 1), rows.clip(0, height - 1)
    return np.asarray(inside & (sheet.signed[rows, columns] < 1.0) & ~sheet.silent[rows, columns])


def _clear(middles: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Return which pieces (P,) have sides (P, 4, 2) that the wire (P, 3) does not cover elsewhere."""
    away = np.linalg.norm(sides[:, :, None] - middles[None, None, :, :2], axis=-1) - middles[None, None, :, 2]
    return np.asarray((away > 0.5 * BESIDE[0]).all(axis=(1, 2)))


def _beyond(picture: np.ndarray, sheet: Sheet, end: np.ndarray, way: np.ndarray) -> float | None:
    """Return the contrast across the outline's tangent `way` (2,) beyond an `end` (3,) [px], whose radius is the whole
    wire's; None where something may hide it."""
    steps = end[2] * NEEDLE_RADIUS / WIRE_RADIUS * BEYOND
    middles = np.concatenate([end[:2] + steps[:, None] * way, np.full((len(BEYOND), 1), end[2])], axis=1)
    columns, rows = np.round(middles[:, :2]).astype(int).T
    height, width = sheet.signed.shape
    if not ((columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)).all():
        return None
    if sheet.silent[rows, columns].any():
        return None
    colours = _sampled(picture, _across(middles, np.tile(way, (len(middles), 1))) + sheet.corner)
    return float(np.linalg.norm((colours[:, :3].mean(axis=1) - colours[:, 3:].mean(axis=1)).mean(axis=0)))
