"""Which eye of a stereo pair is the left one, where the calibration says that the pictures are exchanged: they know."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.preflight.epipolar import features_of, matched
from scenewright.stages.ingest.source import LogSource, SourceCamera, Unusable
from scenewright.stages.kit.formats.foxglove import decode_color

LOOKED_AT = 6
"""Frames of a camera whose two pictures are matched."""
LEAST_MATCHES = 40
"""Fewest matches that say anything; by eye."""
MOST = 0.8
"""Share of the matches from which on the pictures say how they stand."""
ROWS = 2.0
"""Matches in rows farther apart [px] are mistakes, or of a pair that is not rectified."""


def settled_eyes(source: LogSource, where: str) -> LogSource:
    """Return a log whose baselines are positive.

    A negative one is a calibration by which left and right are exchanged. Where features lie further left in the right
    picture all the same, the calibration has the sign wrong. Raises BadInput where the pictures are exchanged, and
    where they do not tell, with the options that say it.
    """
    if all(camera.baseline is None or camera.baseline >= 0 for camera in source.cameras):
        return source
    cameras, notes = [], []
    for camera in source.cameras:
        if camera.baseline is not None and camera.baseline < 0:
            share, count = order_of_pictures(source, camera)
            notes.append(_verdict(camera, share, count, where))
            camera = replace(camera, baseline=-camera.baseline)
        cameras.append(camera)
    return replace(source, cameras=tuple(cameras), notes=(*source.notes, *notes))


def _verdict(camera: SourceCamera, share: float, count: int, where: str) -> str:
    """Return the note on a pair whose pictures are in order. Raises BadInput for any other."""
    assert camera.baseline is not None
    left, right = camera.eyes
    stated = f"by the calibration {right} stands {-camera.baseline:.4g} m to the left of {left}"
    if count >= LEAST_MATCHES and share >= MOST:
        return (
            f"WARNING: {stated}, but {100 * share:.0f} % of {count} matched features lie further left in {right}: the "
            f"sign of the calibration is taken to be wrong (--baseline {-camera.baseline:.4g} says so)"
        )
    topics = f"--color-topic {right} --right-topic {left}"
    exchange = topics if left.startswith("/") else f"exchange the images of {left} and {right}"
    if count >= LEAST_MATCHES and share <= 1 - MOST:
        raise BadInput(
            f"{where}: left and right are swapped: {stated}, and {100 * (1 - share):.0f} % of {count} matched features "
            f"lie further right in {right}",
            hint=exchange,
        )
    raise BadInput(
        f"{where}: left and right seem to be swapped: {stated}; the images do not tell ({count} features match)",
        hint=f"{exchange}; or, if only the sign is wrong, --baseline {-camera.baseline:.4g}",
    )


def order_of_pictures(source: LogSource, camera: SourceCamera) -> tuple[float, int]:
    """Return the share of matched features of some frames that lie further left in the right picture, and how many
    match in their row."""
    entries = [entry for entry in source.entries if entry.camera_name == camera.name and entry.problem is None]
    chosen = np.linspace(0, len(entries) - 1, min(LOOKED_AT, len(entries))).astype(int)
    disparities = [np.zeros(0)]
    for index in np.unique(chosen).tolist():
        try:
            loaded = entries[index].load()
        except Unusable:
            continue
        pictures = [_gray(picture) for picture in (loaded.color, loaded.right)]
        if any(picture is None for picture in pictures):
            continue
        left, right = matched(*(features_of(picture) for picture in pictures if picture is not None))
        in_row = np.abs(right[:, 1] - left[:, 1]) < ROWS
        disparities.append((left - right)[in_row, 0])
    disparity = np.concatenate(disparities)
    disparity = disparity[np.abs(disparity) > 0.5]  # what is far away lies at one place in both
    return float((disparity > 0).mean()) if len(disparity) else 0.5, len(disparity)


def _gray(picture: np.ndarray | bytes | None) -> np.ndarray | None:
    pixels = decode_color(picture) if isinstance(picture, bytes) else picture
    return None if pixels is None else cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY) if pixels.ndim == 3 else pixels
