"""Overlap and boundary measures of class-agnostic object masks, as in the unseen-object-segmentation literature.

Definitions of Xie et al. 2021 ("Unseen Object Instance Segmentation for Robotic Environments", section V-A, after
Dave et al. 2019): every true object is matched with at most one found one, so that the sum of the pairs' F-measures
is the largest (Hungarian method). With c_i a found object and g(c_i) the true one matched with it (empty if none),

    P = sum_i |c_i & g(c_i)| / sum_i |c_i|,   R = sum_i |c_i & g(c_i)| / sum_j |g_j|,   F = 2 P R / (P + R)

for the overlap; for the boundary, c and g stand for the boundary pixels of the masks and the other side of an
intersection is dilated: |c_i & D(g(c_i))| in P and |D(c_i) & g(c_i)| in R. The matching is that of the overlap.
A boundary pixel is one whose membership differs from that of its right, lower or lower-right neighbour; D is a disk
with a radius of 0.003 of the image diagonal, rounded up: 3 pixels at 640x480. Every value belongs to one frame; a
table gives the mean over frames (macro average). Without any true and any found object all values are 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

DILATION_SHARE = 0.003
"""Radius of the dilation over the image diagonal."""
RECALLED_F = 0.75
"""An object whose pair has a larger overlap F counts as found."""


@dataclass(frozen=True)
class Agreement:
    """Precision, recall and their harmonic mean, all 0..1."""

    precision: float
    recall: float
    f: float


@dataclass(frozen=True)
class ObjectMaskScore:
    """What one frame scores."""

    overlap: Agreement
    boundary: Agreement
    true_count: int
    found_count: int
    recalled_share: float
    """Share of the true objects whose pair has an overlap F over 0.75; 1 when there is none ("F@.75")."""

    @property
    def right_count(self) -> bool:
        """Whether as many objects were found as there are."""
        return self.true_count == self.found_count


def overlap_table(truth: np.ndarray, found: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (true ids (T,), found ids (N,), shared pixels (T, N)) of two label images (H, W), ids > 0 ascending."""
    true_ids, true_index = np.unique(truth, return_inverse=True)
    found_ids, found_index = np.unique(found, return_inverse=True)
    pairs = true_index.ravel() * len(found_ids) + found_index.ravel()
    table = np.bincount(pairs, minlength=len(true_ids) * len(found_ids)).reshape(len(true_ids), len(found_ids))
    rows, columns = true_ids > 0, found_ids > 0
    return true_ids[rows], found_ids[columns], table[rows][:, columns]


def boundary_of(mask: np.ndarray) -> np.ndarray:
    """Return (H, W) bool: pixels whose membership in a mask (H, W) bool differs from the right, lower or lower-right
    neighbour's. The image's own border is none."""
    padded = np.pad(mask, ((0, 1), (0, 1)), mode="edge")
    same = padded[:-1, :-1]
    different: np.ndarray = (same != padded[:-1, 1:]) | (same != padded[1:, :-1]) | (same != padded[1:, 1:])
    return different


def _agreement(hits: float, recalled: float, found: float, true: float) -> Agreement:
    if found == 0 and true == 0:
        return Agreement(1.0, 1.0, 1.0)
    precision = hits / found if found else 0.0
    recall = recalled / true if true else 0.0
    return Agreement(precision, recall, 2 * precision * recall / (precision + recall) if hits and recalled else 0.0)


def score_object_masks(truth: np.ndarray, found: np.ndarray) -> ObjectMaskScore:
    """Return the measures of one frame: two label images (H, W) of non-negative integers, 0 = no object.

    Raises ValueError when the shapes differ or are not images.
    """
    if truth.ndim != 2 or truth.shape != found.shape:
        raise ValueError(f"label images must have one shape (H, W), not {truth.shape} and {found.shape}")
    true_ids, found_ids, shared = overlap_table(truth, found)
    true_pixels = np.array([np.count_nonzero(truth == k) for k in true_ids], dtype=float)
    found_pixels = np.array([np.count_nonzero(found == k) for k in found_ids], dtype=float)
    f = 2 * shared / np.maximum(true_pixels[:, None] + found_pixels[None, :], 1)
    rows, columns = linear_sum_assignment(-f)
    matched = [(row, column) for row, column in zip(rows, columns, strict=True) if shared[row, column] > 0]
    hits = float(sum(shared[row, column] for row, column in matched))

    radius = math.ceil(DILATION_SHARE * math.hypot(*truth.shape))
    disk = disk_kernel(radius)
    true_edges = [boundary_of(truth == k) for k in true_ids]
    found_edges = [boundary_of(found == k) for k in found_ids]
    near_hits = near_recalled = 0
    for row, column in matched:
        near_hits += int(np.count_nonzero(found_edges[column] & _dilated(true_edges[row], disk)))
        near_recalled += int(np.count_nonzero(true_edges[row] & _dilated(found_edges[column], disk)))
    return ObjectMaskScore(
        overlap=_agreement(hits, hits, found_pixels.sum(), true_pixels.sum()),
        boundary=_agreement(
            float(near_hits),
            float(near_recalled),
            float(sum(np.count_nonzero(edge) for edge in found_edges)),
            float(sum(np.count_nonzero(edge) for edge in true_edges)),
        ),
        true_count=len(true_ids),
        found_count=len(found_ids),
        recalled_share=sum(f[pair] > RECALLED_F for pair in matched) / len(true_ids) if len(true_ids) else 1.0,
    )


def disk_kernel(radius: int) -> np.ndarray:
    """Return a (2r+1, 2r+1) uint8 disk: 1 where the distance from the middle is at most `radius` pixels."""
    rows, columns = np.ogrid[-radius : radius + 1, -radius : radius + 1]
    kernel: np.ndarray = (rows**2 + columns**2 <= radius**2).astype(np.uint8)
    return kernel


def _dilated(mask: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    wide: np.ndarray = cv2.dilate(mask.astype(np.uint8), kernel) > 0
    return wide
