"""Pictures of reconstructed threads: the left eye, the true centre line, ours and where it is not sure.

Truth is black, ours is yellow, red where it is known to worse than 2 mm; it is drawn 3 px beside itself, for both to be
seen. Below: both curves as seen from above the picture, columns across and depth down, stretched to fit. Learned masks.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.suture import (
    CALIBRATION_ERROR,
    TWO_CAMERAS,
    Segmenter,
    kept_view,
    read_eye,
    reconstruct_thread,
    seen_scene,
)
from scenewright.stages.suture.training.network.views import EYES

SIDE, STRIP, BESIDE = 520, 130, 3.0
BLACK, YELLOW, RED, WHITE = (0, 0, 0), (255, 225, 40), (255, 40, 40), (255, 255, 255)
VAGUE = 0.002


def panel(folder: Path, seed: int, segmenter: Segmenter) -> np.ndarray:
    """Return the view's picture (SIDE + STRIP, SIDE, 3): the left eye about the thread, both curves in depth."""
    rig = TWO_CAMERAS
    stem = kept_view(folder, rig, seed)
    scene, _ = seen_scene(seed, rig, calibration_error=CALIBRATION_ERROR)
    pictures = [read_eye(stem, eye)[0] for eye in EYES]
    masks = [segmenter.masks(picture).thread for picture in pictures]
    curve = reconstruct_thread(masks[0], masks[1], rig, start=scene.pose.swage)
    truth = apply(scene.camera_from_world, scene.thread)
    pixels = rig.left(truth)
    inside = (pixels >= 0).all(axis=1) & (pixels[:, 0] < rig.width) & (pixels[:, 1] < rig.height)
    low = np.floor(pixels[inside].min(axis=0)).astype(int) - 25
    size = int((pixels[inside].max(axis=0) - low).max()) + 25
    scale = SIDE / size
    turn = np.array([[scale, 0.0, -low[0] * scale], [0.0, scale, -low[1] * scale]])
    image = cv2.warpAffine(pictures[0], turn, (SIDE, SIDE), flags=cv2.INTER_LINEAR)
    draw(image, (pixels - low) * scale, np.zeros(len(pixels), dtype=bool), BLACK)
    strip = np.full((STRIP, SIDE, 3), 245, dtype=np.uint8)
    middle = (float(truth[:, 2].min()) + float(truth[:, 2].max())) / 2.0
    shown = (STRIP - 20) / float(np.ptp(truth[:, 2]))
    for points, vague, colour in (
        (truth, np.zeros(len(truth), dtype=bool), BLACK),
        (curve.points, curve.standard_deviation > VAGUE, (210, 150, 0)),
    ):
        if len(points):
            side = np.stack(
                [(rig.left(points)[:, 0] - low[0]) * scale, STRIP / 2 + (points[:, 2] - middle) * shown], axis=1
            )
            draw(strip, side, vague, colour)
    if len(curve.points):
        draw(image, (rig.left(curve.points) - low) * scale + BESIDE, curve.standard_deviation > VAGUE, YELLOW)
    words = f"{seed}: {curve.status}, {1000 * curve.length_m:.0f} mm of {1000 * polyline(truth):.0f}"
    cv2.putText(image, words, (8, SIDE - 10), cv2.FONT_HERSHEY_SIMPLEX, 0.55, WHITE, 1, cv2.LINE_AA)
    return np.vstack([image, strip])


def polyline(points: np.ndarray) -> float:
    """Return the length [m] of a polyline (N, 3)."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def draw(image: np.ndarray, pixels: np.ndarray, vague: np.ndarray, colour: tuple[int, int, int]) -> None:
    """Draw a line (N, 2) [px], red where it is vague (N,)."""
    fixed = np.round(pixels * 16).astype(np.int32)
    for index in range(len(fixed) - 1):
        first, second = fixed[index].tolist(), fixed[index + 1].tolist()
        cv2.line(image, first, second, RED if vague[index] else colour, 1, cv2.LINE_AA, shift=4)
