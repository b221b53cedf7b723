"""Colour against depth, in space and in time: depth jumps lie on colour edges, when both see the same scene.

The score is the mean colour gradient on the near side of depth jumps over the mean gradient of the picture. Chance is
1; 7-Scenes scores 1.3 as recorded and 2.4 with its colour carried into the depth camera.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.report import Finding, RegistrationReport, exact, significant

MEASURING_WIDTH = 320
"""Width to which pictures are thinned before edges are compared [px]."""
JUMP = 0.08
"""Relative depth difference of neighbouring pixels that is a jump."""
GRADIENT_LIMIT = 6.0
"""Gradients over so many means count as this much, or a few specular pixels would decide."""
LEAST_EDGES = 80
"""Jump pixels a frame (at 320 pixels width) to say anything."""
LARGEST_LAG = 5
"""Largest lag between colour and depth that is searched [frames]."""
LARGEST_OFFSET = 24
"""Largest offset of colour that is searched [px at 320 px width]."""
ALIGNED = 1.4
"""Score from which colour and depth surely have something to do with each other."""
UNRELATED = 1.2
"""Score under which they surely have not."""
LAG_RATIO = 1.1
"""Score of the best lag over that of none from which colour and depth are called shifted in time."""
OFFSET_RATIO = 1.12
"""Score of the best offset over that of none from which colour and depth are called shifted in the picture; by eye."""
RELATED = 1.3
"""Score that another place must have to be claimed as the right one."""
LEAST_OFFSET = 3
"""Pixels at 320 pixels width under which an offset is within what jumps can tell."""


@dataclass(frozen=True)
class Edges:
    """Colour gradient and depth jumps of one frame, at about 320 pixels width."""

    gradient: np.ndarray | None
    """(h, w) float32 with mean 1; None for a picture without any."""
    jumps: np.ndarray | None
    """(h, w) float32, 1 on the near side of a jump; None with too few."""
    factor: int
    """Full image over this one."""


def edges_of(look: Look) -> Edges | None:
    """Return the edges of a frame; None unless it has colour and depth of one size."""
    if look.gray is None or look.depth is None or look.gray.shape != look.depth.shape:
        return None
    factor = max(1, round(look.gray.shape[1] / MEASURING_WIDTH))
    height, width = (size // factor for size in look.gray.shape)
    gray = look.gray[: height * factor, : width * factor]
    gray = cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA) if factor > 1 else gray
    smooth = cv2.GaussianBlur(gray.astype(np.float32), (0, 0), 1.0)
    gradient = np.hypot(cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1))
    mean = float(gradient.mean())
    depth = look.depth[factor // 2 :: factor, factor // 2 :: factor][:height, :width]
    jumps = depth_jumps(depth)
    return Edges(
        np.minimum(gradient / mean, GRADIENT_LIMIT) if mean > 1.0 else None,
        jumps.astype(np.float32) if jumps.sum() >= LEAST_EDGES else None,
        factor * look.factor,
    )


def depth_jumps(depth: np.ndarray) -> np.ndarray:
    """Return (H, W) bool: pixels of depth (H, W), 0 invalid, that have a valid neighbour farther by a jump."""
    values = depth.astype(np.float32)
    farthest = cv2.dilate(values, np.ones((3, 3), np.uint8))
    return (values > 0) & (farthest > (1 + JUMP) * values)


def check_registration(
    looks: Mapping[int, Look], runs: Sequence[Sequence[int]], registered: bool
) -> RegistrationReport:
    """Judge whether colour and depth of the frames show the same thing at the same time and place."""
    edges = {index: own_edges for index, look in sorted(looks.items()) if (own_edges := edges_of(look)) is not None}
    pairs = [(e.gradient, e.jumps) for e in edges.values() if e.gradient is not None and e.jumps is not None]
    if not edges:
        return RegistrationReport(checked=False, detail="cannot be checked: no frame has both colour and depth")
    if len(pairs) < 3:
        edge_kind = "depth jumps" if all(e.jumps is None for e in edges.values()) else "colour edges"
        return RegistrationReport(checked=False, detail=f"cannot be checked: too few {edge_kind}")
    score = float(np.mean([_score(gradient, jumps) for gradient, jumps in pairs]))
    lags = lag_scores(edges, runs)
    lag, late = _best_lag(lags)
    offset, offset_score = best_offset(pairs)
    factor = next(iter(edges.values())).factor
    # Each mistake looks a little like the other while the camera moves one way; the better explanation counts.
    shifted = max(map(abs, offset)) >= LEAST_OFFSET and offset_score >= OFFSET_RATIO * score
    shifted &= offset_score > max([RELATED, *lags.values()])
    decisive = late and not shifted
    return RegistrationReport(
        checked=True,
        detail=_words(score, lag, decisive, shifted, registered),
        score=exact(score),
        offset=(offset[0] * factor, offset[1] * factor) if shifted else (0, 0),
        offset_score=exact(offset_score),
        lag_frames=significant(lag, 2),
        lag_decisive=decisive,
        lag_scores=tuple((k, exact(value)) for k, value in sorted(lags.items())),
    )


def _score(gradient: np.ndarray, jumps: np.ndarray) -> float:
    return float((gradient * jumps).sum() / jumps.sum() / max(float(gradient.mean()), 1e-6))


def lag_scores(edges: Mapping[int, Edges], runs: Sequence[Sequence[int]]) -> dict[int, float]:
    """Return lag -> mean score of colour of frame i under depth jumps of frame i - lag, over the frames of the runs.

    Empty unless every lag has pairs.
    """
    score_of: dict[int, float] = {}
    for lag in range(-LARGEST_LAG, LARGEST_LAG + 1):
        scores = []
        for run in runs:
            for index in run:
                color, depth = edges.get(index), edges.get(index - lag) if index - lag in run else None
                if color and depth and color.gradient is not None and depth.jumps is not None:
                    scores.append(_score(color.gradient, depth.jumps))
        if len(scores) < 3:
            return {}
        score_of[lag] = float(np.mean(scores))
    return score_of


def _best_lag(scores: Mapping[int, float]) -> tuple[float | None, bool]:
    """Return the lag of the best score, between frames by a parabola, and whether it is a claim.

    None when the camera moves too little for lags to differ.
    """
    if not scores:
        return None, False
    best = max(scores, key=lambda lag: scores[lag])
    if scores[best] < ALIGNED or scores[best] < LAG_RATIO * min(scores.values()):
        return None, False
    lag = float(best)
    if best - 1 in scores and best + 1 in scores:
        before, peak, after = scores[best - 1], scores[best], scores[best + 1]
        curvature = before - 2 * peak + after
        if curvature < 0:
            lag += float(np.clip(0.5 * (before - after) / curvature, -0.5, 0.5))
    return lag, abs(lag) >= 1 and scores[best] >= LAG_RATIO * scores[0]


def best_offset(pairs: Sequence[tuple[np.ndarray | None, np.ndarray | None]]) -> tuple[tuple[int, int], float]:
    """Return the shift (dx, dy) of colour against depth with the best score over all frames, and that score."""
    spectra, weight, shape = [], 0.0, (0, 0)
    for gradient, jumps in pairs:
        assert gradient is not None and jumps is not None
        shape = gradient.shape
        spectra.append(np.fft.rfft2(gradient / gradient.mean() - 1) * np.conj(np.fft.rfft2(jumps)))
        weight += float(jumps.sum())
    correlation = np.fft.irfft2(np.sum(spectra, axis=0), s=shape) / weight + 1
    reach = min(LARGEST_OFFSET, min(shape) // 2 - 1)
    window = np.roll(correlation, (reach, reach), axis=(0, 1))[: 2 * reach + 1, : 2 * reach + 1]
    row, column = np.unravel_index(int(np.argmax(window)), window.shape)
    return (int(column) - reach, int(row) - reach), float(window[row, column])


def _words(score: float, lag: float | None, decisive: bool, shifted: bool, registered: bool) -> str:
    phrases = [f"colour gradient under depth jumps {score:.2f} times the mean"]
    if decisive:
        phrases.append(f"best {abs(lag or 0):.1f} frames {'later' if (lag or 0) > 0 else 'earlier'}")
    elif lag is None:
        phrases.append("too little motion to compare clocks")
    if shifted:
        phrases.append("better elsewhere in the image")
    if not registered:
        phrases.append("the log does not register them")
    return ", ".join(phrases)


def registration_findings(report: RegistrationReport, frame_interval: float, camera: str) -> list[Finding]:
    """Return what is odd about colour against depth; `frame_interval` [s] turns frames into time."""
    findings = []

    def add(message: str, fix: str) -> None:
        findings.append(Finding(severity="doubtful", check="registration", message=message, fix=fix, camera=camera))

    if report.lag_decisive and report.lag_frames is not None:
        seconds = abs(report.lag_frames) * frame_interval
        late = "late" if report.lag_frames > 0 else "early"
        add(
            f"colour is {abs(report.lag_frames):.1f} frames ({seconds:.3f} s) {late} against depth",
            "shift the stamps of one of the two by that much before ingest",
        )
    elif report.offset and report.offset != (0, 0):
        add(
            f"colour lies {report.offset[0]:+d}, {report.offset[1]:+d} pixels from depth: not registered",
            "register depth to colour, or give the log the extrinsics of the two cameras",
        )
    elif report.checked and report.score is not None and report.score < UNRELATED:
        add(
            f"colour and depth do not line up: colour gradient under depth jumps is {report.score:.2f} times the mean "
            "(1 is chance)",
            "register depth to colour; check that the two belong to the same frames",
        )
    return findings
