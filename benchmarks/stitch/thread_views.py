"""A reconstructed thread against the true one of its scene."""

from __future__ import annotations

import time
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial import cKDTree

from benchmarks.stitch.segmentation_views import CALIBRATION_ERROR, EYES, kept_view, read_eye
from benchmarks.stitch.thread_records import ThreadRecord
from stages.kit.geometry.transforms import apply
from stages.suture.rig import TWO_CAMERAS, StereoRig
from stages.suture.segmentation.infer import Segmenter
from stages.suture.thread.reconstruct import ThreadCurve, reconstruct_thread
from stages.suture.world.sampling import seen_scene
from stages.suture.world.scene import NeedleScene
from stages.suture.world.tubes import THREAD

FINE = 0.0001
"""The true curve is taken in steps of this [m]."""
NEAR = 0.002


def reconstructions(folder: Path, seed: int, segmenter: Segmenter | None) -> list[ThreadRecord]:
    """Return the records of the view of `seed`: on the true masks and, with a segmenter, on learned ones."""
    stem = kept_view(folder, TWO_CAMERAS, seed)
    scene, _ = seen_scene(seed, TWO_CAMERAS, calibration_error=CALIBRATION_ERROR)
    pictures, true_masks = [], []
    for eye in EYES:
        picture, bodies = read_eye(stem, eye)
        pictures.append(picture)
        true_masks.append(bodies == THREAD)
    arms = {"true": true_masks}
    if segmenter is not None:
        arms["learned"] = [segmenter.masks(picture).thread for picture in pictures]
    records = []
    for name, masks in arms.items():
        started = time.process_time()
        curve = reconstruct_thread(masks[0], masks[1], TWO_CAMERAS, start=scene.pose.swage)
        seconds = time.process_time() - started
        records.append(judged(name, seed, scene, true_masks, curve, seconds))
    return records


def finely(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the polyline (N, 3) [m] in FINE steps (M, 3), and each one's length from the beginning (M,) [m]."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = np.arange(0.0, along[-1], FINE)
    return np.stack([np.interp(at, along, points[:, axis]) for axis in range(3)], axis=1), at


def seen_by_both(points: np.ndarray, masks: list[np.ndarray], rig: StereoRig) -> np.ndarray:
    """Return which (N,) of the true points (N, 3) fall, give or take a pixel, on thread in both eyes' true masks."""
    both = np.ones(len(points), dtype=bool)
    for mask, pixels in zip(masks, (rig.left(points), rig.right(points)), strict=True):
        wide = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        columns, rows = np.round(pixels).astype(int).T
        inside = (columns >= 0) & (rows >= 0) & (columns < rig.width) & (rows < rig.height)
        both &= inside & wide[np.clip(rows, 0, rig.height - 1), np.clip(columns, 0, rig.width - 1)]
    return both


def judged(
    name: str, seed: int, scene: NeedleScene, true_masks: list[np.ndarray], curve: ThreadCurve, seconds: float
) -> ThreadRecord:
    """Return the record of one curve."""
    truth, along = finely(apply(scene.camera_from_world, scene.thread))
    seen = seen_by_both(truth, true_masks, scene.rig)
    common = {
        "masks": name,
        "seed": seed,
        "holder": scene.holder,
        "crossed": scene.crossing is not None,
        "status": curve.status,
        "remarks": curve.remarks,
        "true_length": 1000.0 * float(along[-1]),
        "seen_length": 1000.0 * FINE * float(seen.sum()),
        "seconds": seconds,
    }
    if curve.status == "none":
        none = dict.fromkeys(
            ("distance_mean", "distance_p95", "missed_mean", "missed_p95", "inside_2sd", "length", "backward"), -1.0
        )
        return ThreadRecord(**common, **none, followed=0.0)
    distance, nearest = cKDTree(truth).query(curve.points)
    missed = cKDTree(curve.points).query(truth[seen])[0] if seen.any() else np.zeros(1)
    steps = np.diff(along[nearest])
    ordinary = (distance[1:] < NEAR) & (np.abs(steps) < 0.005) & (steps != 0)
    return ThreadRecord(
        **common,
        distance_mean=1000.0 * float(distance.mean()),
        distance_p95=1000.0 * float(np.quantile(distance, 0.95)),
        missed_mean=1000.0 * float(missed.mean()),
        missed_p95=1000.0 * float(np.quantile(missed, 0.95)),
        followed=float((missed < NEAR).mean()),
        backward=float((steps[ordinary] < 0).mean()) if ordinary.any() else 0.0,
        inside_2sd=float((distance < 2.0 * curve.standard_deviation).mean()),
        length=1000.0 * curve.length_m,
    )
