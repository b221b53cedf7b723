"""Is a stereo pair rectified, and which eye is which. Depth from it, for checking poses of logs without depth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np
from scenewright.stages.ingest.preflight.epipolar import features_of, matched
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.report import Finding, StereoReport, significant

FRAMES = 6
"""Most frames whose two eyes are matched; by eye."""
LEAST_MATCHES = 40
"""Fewest matched features with which a stereo pair is checked; by eye."""
ROW_ERROR = 1.5
"""Median distance of matched rows [pixels] over which a pair is not rectified."""


def stereo_report(looks: Mapping[int, Look], baseline: float | None) -> StereoReport | None:
    """Return what matching the eyes of some frames tells; None without right images."""
    pairs = [look for _, look in sorted(looks.items()) if look.gray is not None and look.right is not None]
    if not pairs:
        return None
    chosen = [pairs[i] for i in np.unique(np.linspace(0, len(pairs) - 1, min(FRAMES, len(pairs))).astype(int))]
    rows, disparities = [np.zeros(0)], [np.zeros(0)]
    for look in chosen:
        assert look.gray is not None and look.right is not None
        left, right = matched(features_of(look.gray), features_of(look.right))
        rows.append((right[:, 1] - left[:, 1]) * look.factor)
        disparities.append((left[:, 0] - right[:, 0]) * look.factor)
    row, disparity = np.concatenate(rows), np.concatenate(disparities)
    rounded_baseline = significant(baseline)
    if len(row) < LEAST_MATCHES:
        detail = f"cannot be checked: {len(row)} features match between the eyes, {LEAST_MATCHES} are needed"
        return StereoReport(checked=False, detail=detail, baseline=rounded_baseline, matches=len(row))
    error = float(np.median(np.abs(row)))
    aligned = disparity[np.abs(row) < max(3 * error, 2.0)]
    positive = float((aligned > -0.5).mean())
    return StereoReport(
        checked=True,
        detail=f"{len(row)} matches in {len(chosen)} frames, rows {error:.2g} pixels apart",
        baseline=rounded_baseline,
        matches=len(row),
        row_error=significant(error),
        positive_share=significant(positive),
        median_disparity=significant(float(np.median(aligned))),
    )


def stereo_findings(report: StereoReport, camera: str) -> list[Finding]:
    """Return what is odd about a stereo pair."""
    findings = []

    def add(severity: str, message: str, fix: str) -> None:
        findings.append(Finding(severity=severity, check="stereo", message=message, fix=fix, camera=camera))  # type: ignore[arg-type]

    if report.baseline is None or report.baseline <= 0:
        add("wasted", f"the stereo baseline is {report.baseline}", "a right calibration needs P[3] = -fx baseline")
    elif not 0.001 <= report.baseline <= 2.0:
        add("doubtful", f"the stereo baseline is {report.baseline:g} m", "is it in metres?")
    if report.checked and report.row_error is not None and report.row_error > ROW_ERROR:
        add(
            "doubtful",
            f"left and right are not rectified: rows differ by {report.row_error:.1f} pixels",
            "rectify first",
        )
    if report.checked and report.positive_share is not None and report.positive_share < 0.3:
        add("wasted", "left and right are swapped: matches shift to the right", "exchange the topics of the two eyes")
    return findings


def with_stereo_depth(look: Look, baseline: float) -> Look:
    """Return the frame with depth [mm] from semi-global matching of its two eyes, where that is sure of itself."""
    if look.gray is None or look.right is None or look.gray.shape != look.right.shape:
        return look
    levels = 16 * max(1, round(look.gray.shape[1] / 80))
    matcher = cv2.StereoSGBM.create(
        minDisparity=0, numDisparities=levels, blockSize=5, P1=200, P2=800, disp12MaxDiff=1, uniquenessRatio=10
    )
    disparity = matcher.compute(look.gray, look.right).astype(np.float32) / 16
    with np.errstate(divide="ignore"):
        depth = np.where(disparity > 1.0, look.camera.fx * baseline / disparity, 0.0)
    millimetres = np.where(depth < 60.0, np.rint(1000 * depth), 0).astype(np.uint16)
    return replace(look, depth=millimetres, depth_camera=look.camera)
