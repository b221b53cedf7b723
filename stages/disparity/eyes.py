"""What a sequence must have to be matched, and whether its eyes see the same points in the same rows."""

from __future__ import annotations

import logging
import math

import cv2
import numpy as np
from scenewright.schemas.disparity import RowReport
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.sequence import OF_TOPICS, Sequence
from scenewright.stages.disparity.parameters import DisparityParameters
from scenewright.stages.disparity.rectification import RowCheck, check_rows, matched_features
from scenewright.stages.disparity.semi_global import gray_of
from scenewright.stages.kit.formats.frames import FrameReader

LOOKED_AT = 6
"""Frames of a camera whose features are matched."""
SWAPPED = 0.8
"""Share of negative disparities from which on the eyes are swapped."""
SMALLEST_BASELINE = 1e-4
"""Eyes nearer than this [m] are one."""
LARGEST_TURN = math.radians(3)
"""A turn of the right eye over this is no small one: the calibration is of other cameras."""
LEAST_GAIN = 0.7
"""A correction must bring the row error to this share of what it was."""

BLANK_SPAN, BLANK_SQUARE = 4.0, 15
"""An eye is blank when its means over squares of so many pixels span fewer grey levels than this."""
NO_PARALLAX = 0.1
"""Median disparity [px] of matched features under which both eyes see the same."""


def stereo_cameras(reader: FrameReader, sequence: Sequence) -> dict[str, float]:
    """Return camera -> baseline [m] of the cameras with two eyes. Raises BadInput when there is none, for a baseline
    that is none, and for one that is negative."""
    if len(reader) == 0:
        raise BadInput(f"{sequence.root}: it has no frames", hint="look at the drops in its sequence.json")
    if "right" not in reader.streams:
        raise BadInput(
            f"{sequence.root}: its frames have one eye ({', '.join(reader.streams)})",
            hint="ingest the log with --color-topic and --right-topic, or folders left/ and right/ with a calibration",
        )
    if "color" not in reader.streams:
        raise BadInput(f"{sequence.root}: its frames have a right eye and no left one", hint="ingest both eyes")
    baselines = reader.baselines
    for name, baseline in baselines.items():
        if not math.isfinite(baseline) or abs(baseline) < SMALLEST_BASELINE:
            raise BadInput(
                f"{sequence.root}: the eyes of {name!r} have no baseline ({baseline:g} m)",
                hint="ingest the log again with --baseline METRES",
            )
        if baseline < 0:
            raise BadInput(
                f"{sequence.root}: left and right of {name!r} are swapped: the baseline is {baseline:g} m",
                hint="ingest the log again, which looks at its images",
            )
    return baselines


def check_eyes(
    reader: FrameReader, name: str, sequence: Sequence, parameters: DisparityParameters, logger: logging.Logger
) -> RowReport:
    """Match features of some frames of a camera and return what their rows say.

    Raises BadInput for swapped eyes, and for pairs that are not rectified when `rectification` is `refuse`.
    """
    indices = [k for k in range(len(reader)) if reader.read(k, ()).camera_name == name]
    chosen = [indices[k] for k in np.unique(np.linspace(0, len(indices) - 1, min(LOOKED_AT, len(indices))).astype(int))]
    pairs = []
    for index in chosen:
        frame = reader.read(index, ("color", "right"))
        if frame.color is not None and frame.right is not None:
            pairs.append(matched_features(gray_of(frame.color), gray_of(frame.right)))
    camera = reader.cameras[name]
    rows = check_rows(pairs, camera)
    if rows.checked and rows.negative_share > SWAPPED:
        raise BadInput(
            f"{sequence.root}: left and right of {name!r} are swapped: {100 * rows.negative_share:.0f} % of "
            f"{rows.matches} features lie further right in the right image",
            hint="ingest the log with --color-topic and --right-topic exchanged"
            if sequence.info.source_format in OF_TOPICS
            else "exchange the left and right images, and ingest the log again",
        )
    if rows.checked and abs(rows.median_disparity) < NO_PARALLAX:
        logger.warning(
            "%s: %d matched features of %r have a median disparity of %.2f px: one image twice, or nothing near",
            sequence.root,
            rows.matches,
            name,
            rows.median_disparity,
        )
    report = row_report(rows, name, len(pairs), parameters)
    _tell(report, sequence, parameters, camera, logger)
    return report


def is_blank(picture: np.ndarray) -> bool:
    """Return whether a picture (H, W, 3) uint8 shows nothing but noise: a covered or dead camera, or a bare wall."""
    means = cv2.blur(gray_of(picture).astype(np.float32), (BLANK_SQUARE, BLANK_SQUARE))
    low, high = np.percentile(means, [1, 99])
    return bool(high - low < BLANK_SPAN)


def row_report(rows: RowCheck, name: str, frames: int, parameters: DisparityParameters) -> RowReport:
    """Return the record of a check, with the verdict under these parameters."""
    if not rows.checked:
        return RowReport(camera=name, verdict="not_checked", frames=frames, matches=rows.matches)
    rectified = rows.error <= parameters.largest_row_error
    small = max(abs(rows.pitch), abs(rows.roll)) <= LARGEST_TURN
    helped = rows.corrected_error <= max(LEAST_GAIN * rows.error, 0.0)
    fixed = not rectified and parameters.rectification == "correct" and small and helped
    return RowReport(
        camera=name,
        verdict="rectified" if rectified else "corrected" if fixed else "not_rectified",
        frames=frames,
        matches=rows.matches,
        row_error=round(rows.error, 3),
        row_error_90=round(rows.error_90, 3),
        row_offset=round(rows.offset, 3),
        pitch=round(rows.pitch, 7),
        roll=round(rows.roll, 7),
        corrected_row_error=round(rows.corrected_error, 3),
        negative_share=round(rows.negative_share, 3),
    )


def _tell(
    report: RowReport, sequence: Sequence, parameters: DisparityParameters, camera: Camera, logger: logging.Logger
) -> None:
    where = f"{sequence.root}: {report.camera}"
    if report.verdict == "not_checked":
        logger.warning("%s: rows cannot be checked: %d features match between the eyes", where, report.matches)
    elif report.verdict == "rectified":
        logger.info("%s: rows of %d matched features differ by %.2f px", where, report.matches, report.row_error)
    elif report.verdict == "corrected":
        logger.warning(
            "%s: not rectified: rows differ by %.2f px; the right eye is turned back by %.3f degrees (pitch) and %.3f "
            "(roll), which leaves %.2f px",
            where,
            report.row_error,
            math.degrees(report.pitch or 0.0),
            math.degrees(report.roll or 0.0),
            report.corrected_row_error,
        )
    else:
        message = (
            f"{where}: left and right are not rectified: rows of {report.matches} matched features differ by "
            f"{report.row_error:.2f} px (with a small turn of the right eye {report.corrected_row_error:.2f} px; "
            f"fy {camera.fy:.0f} px)"
        )
        if parameters.rectification == "refuse":
            raise BadInput(message, hint="calibrate the pair again, or give --rectification correct")
        logger.warning("%s", message)
