"""Smoothing moves no plane, less where the weight is large, and takes noise out where it is small."""

from __future__ import annotations

import numpy as np
from scenewright.stages.fuse.smoothing import smoothed_tsdf
from scenewright.stages.fuse.surface import extract_surface

from tests.unit.fuse.test_surface import VOXEL, filled


def plane(points: np.ndarray) -> np.ndarray:
    return (points @ [0.1, -0.2, 0.97] - 0.03) / (4 * VOXEL)


def test_a_plane_stays() -> None:
    blocks = filled(1, plane)
    assert np.abs(smoothed_tsdf(blocks, 0.5) - blocks.tsdf).max() < 1e-6
    blocks.weight[::3, ::5] = 0  # with holes too: only whole pairs of neighbours count
    observed = blocks.weight > 0
    assert np.abs(smoothed_tsdf(blocks, 0.5) - blocks.tsdf)[observed].max() < 1e-6


def test_closed_form_of_one_voxel() -> None:
    blocks = filled(1, lambda points: np.zeros(len(points)))
    blocks.weight[:] = 2
    place = 3 + 8 * 3 + 64 * 3
    blocks.tsdf[0, place] = 0.9
    smoothed = smoothed_tsdf(blocks, 0.5)
    assert np.isclose(smoothed[0, place], 2 * 0.9 / (2 + 3 * 0.5))
    assert np.isclose(smoothed[0, place + 1], 0.5 * 0.45 / 3.5)
    assert smoothed_tsdf(blocks, 0.0) is blocks.tsdf


def test_noise_shrinks_with_little_weight_only() -> None:
    random = np.random.default_rng(0)
    blocks = filled(1, lambda points: plane(points) + 0.05 * random.standard_normal(len(points)))

    def error(weight: float) -> float:
        blocks.weight[:] = weight
        surface = extract_surface(blocks, minimum_weight=0.01, jump=9, tsdf=smoothed_tsdf(blocks, 0.2))
        return float(np.abs(surface.vertices @ [0.1, -0.2, 0.97] - 0.03).mean())

    raw = extract_surface(blocks, minimum_weight=0.01, jump=9)
    before = float(np.abs(raw.vertices @ [0.1, -0.2, 0.97] - 0.03).mean())
    assert error(0.1) < 0.6 * before
    assert error(100.0) > 0.95 * before
