"""Blur, exposure and repeated pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.report import Finding, PictureReport, exact

MEASURING_WIDTH = 320
"""Width to which pictures are thinned before they are measured [px]."""
RELATIVE_BLUR = 0.3
"""Sharpness under this share of the log's median is blur."""
ABSOLUTE_BLUR = 12.0
"""Sharpness under this is blur, or a picture of nothing."""
DARK, BRIGHT = 8, 247
"""Grey values, of 255, beyond which a pixel is dark or bright; by eye."""
LEAST_NEIGHBOURS = 8
"""Pairs of neighbours from which flicker and repetition are told."""
SAME_PICTURE = 0.15
"""Mean absolute difference (of 255) under which two pictures are one."""


def sharpness(gray: np.ndarray) -> float:
    """Return the variance of the Laplacian of a picture (H, W) uint8 at 320 pixels width."""
    factor = max(1, round(gray.shape[1] / MEASURING_WIDTH))
    if factor > 1:
        size = (gray.shape[1] // factor, gray.shape[0] // factor)
        gray = cv2.resize(gray, size, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(gray, cv2.CV_32F).var())


def sharpnesses(looks: Mapping[int, Look]) -> dict[int, float]:
    """Return the sharpness of every frame that has colour."""
    return {index: sharpness(look.gray) for index, look in sorted(looks.items()) if look.gray is not None}


def picture_report(looks: Mapping[int, Look], runs: Sequence[Sequence[int]]) -> PictureReport | None:
    """Return blur and exposure of the frames; None without colour."""
    grays = {index: look.gray for index, look in sorted(looks.items()) if look.gray is not None}
    if not grays:
        return None
    sharp = np.array(list(sharpnesses(looks).values()))
    median = float(np.median(sharp))
    blurred = (sharp < RELATIVE_BLUR * median) | (sharp < ABSOLUTE_BLUR)
    means = {index: float(gray.mean()) for index, gray in grays.items()}
    neighbours = [(run[k], run[k + 1]) for run in runs for k in range(len(run) - 1)]
    neighbours = [(i, j) for i, j in neighbours if i in grays and j in grays and grays[i].shape == grays[j].shape]
    changes = [abs(means[j] - means[i]) / max(means[i], 1.0) for i, j in neighbours]
    same = [float(cv2.absdiff(grays[i], grays[j]).mean()) < SAME_PICTURE for i, j in neighbours]
    return PictureReport(
        frames=len(grays),
        sharpness_median=exact(median),
        blurred_share=exact(float(blurred.mean())),
        dark_share=exact(float(np.mean([(gray < DARK).mean() for gray in grays.values()]))),
        bright_share=exact(float(np.mean([(gray > BRIGHT).mean() for gray in grays.values()]))),
        brightness=exact(float(np.mean(list(means.values())))),
        flicker=exact(float(np.median(changes))) if len(changes) >= LEAST_NEIGHBOURS else 0.0,
        repeated_share=exact(float(np.mean(same))) if len(same) >= LEAST_NEIGHBOURS else 0.0,
    )


def picture_findings(report: PictureReport, camera: str) -> list[Finding]:
    """Return what is odd about the pictures."""
    findings = []

    def add(message: str, fix: str = "") -> None:
        findings.append(Finding(severity="doubtful", check="pictures", message=message, fix=fix, camera=camera))

    if report.blurred_share > 0.3:
        add(f"{100 * report.blurred_share:.0f} % of the images are blurred or show nothing", "use --every, or rescan")
    if report.brightness < 20 or report.dark_share > 0.5:
        add(f"images are dark: mean brightness {report.brightness:.0f} of 255", "record in more light")
    if report.bright_share > 0.4:
        add(f"images are overexposed: {100 * report.bright_share:.0f} % of the pixels are white", "lower the exposure")
    if report.flicker > 0.1:
        add(f"brightness flickers by {100 * report.flicker:.0f} % between neighbours", "fix the exposure")
    if report.repeated_share > 0.3:
        add(f"{100 * report.repeated_share:.0f} % of the images are the same as the one before", "record each once")
    return findings
