"""Saying what is wrong with poses, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.pose_convention_names import CONVENTION_WORDS, PoseConvention
from scenewright.stages.ingest.preflight.poses import BY_DEPTH, BY_FEATURES
from scenewright.stages.ingest.preflight.report import Finding, Hypothesis, PoseReport, Severity
from scenewright.stages.ingest.preflight.units import Reading

FLIPS: dict[str, str] = {
    "inverse": "invert the poses",
    "opengl": "turn the camera axes from OpenGL's: multiply each pose by diag(1, -1, -1, 1) from the right",
    "inverse-opengl": "invert the poses, then multiply each by diag(1, -1, -1, 1) from the right",
    "ros-body": "add the transform from the body to the camera's optical frame",
    "inverse-ros-body": "invert the poses, then add the transform from the body to the camera's optical frame",
    "left-handed": "mirror y: multiply each pose by diag(1, -1, 1, 1) from both sides",
    "quaternion-wxyz": "write the quaternions with w last",
    "quaternion-xyzw": "write the quaternions with w first",
    "inverse-quaternion-wxyz": "write the quaternions with w last and invert the poses",
}


def pose_findings(
    report: PoseReport,
    ways: Sequence[Reading],
    camera: Camera,
    interval: float,
    name: str,
    *,
    convention: PoseConvention,
    pose_scale: float,
) -> list[Finding]:
    """Return what the pose check found.

    `ways` are the readings of depth and translations under which they agree where the best hypothesis scales them,
    likeliest first; `interval` [s] is that of the frames; `convention` and `pose_scale` are what the options
    make of the poses already.
    """
    findings: list[Finding] = []
    measure = BY_FEATURES if report.method == "epipolar" else BY_DEPTH
    pictures = "colour" if report.method == "epipolar" else "depth"

    def add(severity: Severity, message: str, fix: str = "", check: str = "poses") -> None:
        findings.append(Finding(severity=severity, check=check, message=message, fix=fix, camera=name))

    best = report.best
    residual = measure.words(report.hypotheses[0].residual) if report.hypotheses else ""
    if report.verdict == "not checked":
        add("note", f"poses {report.detail}")
    elif report.verdict == "agree":
        if report.bad_pairs:
            places = ", ".join(f"{time:.3f}" for time in report.bad_times[:4])
            add(
                "doubtful",
                f"{report.bad_pairs} of {report.pairs} pairs of frames disagree with their poses, at {places} s",
                "leave those times out",
            )
    elif best is not None and report.decisive:
        agree = f"they agree ({measure.words(best.residual)})"
        severity: Severity = "wasted" if report.verdict == "contradict" else "doubtful"
        contradict = f"poses contradict {pictures} (median residual {residual})"
        if best.lag:
            late = "late" if best.lag > 0 else "early"
            seconds = abs(best.lag) * interval
            add(
                "doubtful",
                f"poses are {abs(best.lag)} frames ({seconds:.3f} s) {late} against {pictures} (median residual "
                f"{residual}, {measure.words(best.residual)} with that undone)",
                "shift the stamps of the poses by that much before ingest",
            )
        elif best.focal_factor != 1:
            wrong = report.hypotheses[0].residual > measure.bad
            add(
                "wasted" if wrong else "doubtful",
                f"the focal length does not fit: frames agree best with {best.focal_factor:.3g} times it (median "
                f"residual {residual}, {measure.words(best.residual)} with that)",
                f"give the calibration of these images, near --fx {camera.fx * best.focal_factor:.4g} "
                f"--fy {camera.fy * best.focal_factor:.4g}",
                "calibration",
            )
        elif best.convention == "as-is":
            depth_first = bool(ways) and "depth_scale" in ways[0].changes
            scale = best.translation_scale
            either = f"with translations times {scale:.4g}, or depth times {1 / scale:.4g}, {agree}"
            add(
                "wasted" if depth_first else severity,
                f"{'depth unit: ' if depth_first else ''}{contradict}; {either}",
                f"ingest with {_options(best, ways, pose_scale)}",
                "depth" if depth_first else "poses",
            )
        else:
            words = CONVENTION_WORDS[best.convention]  # type: ignore[index]
            scaled = f" and translations times {best.translation_scale:.4g}" if best.translation_scale != 1 else ""
            add(severity, f"{contradict}; with {words}{scaled} {agree}", _flip_fix(best, ways, convention, pose_scale))
    elif report.turns_only:
        add(
            "wasted" if report.verdict == "contradict" else "doubtful",
            f"poses contradict {pictures} ({report.detail}): they turn as the camera does, but do not move as it does",
            "look for other poses, or for a wrong unit that varies",
        )
    elif best is not None:
        or_second = f" or {_short(report.runner_up)}" if report.runner_up else ""
        add(
            "wasted" if report.verdict == "contradict" else "doubtful",
            f"poses contradict {pictures} (median residual {residual}); {_short(best)}{or_second} fits better "
            f"({measure.words(best.residual)}), but not clearly enough to say which",
            "check the convention, the units and the stamps of the poses",
        )
    else:
        severity = "wasted" if report.verdict == "contradict" else "doubtful"
        add(severity, f"poses contradict {pictures}: {report.detail}", _witness_fix(report))
    return findings


def _short(hypothesis: Hypothesis | None) -> str:
    if hypothesis is None:
        return ""
    phrases = [] if hypothesis.convention == "as-is" else [hypothesis.convention]
    if hypothesis.translation_scale != 1:
        phrases.append(f"translations times {hypothesis.translation_scale:.3g}")
    if hypothesis.focal_factor != 1:
        phrases.append(f"focal length times {hypothesis.focal_factor:.3g}")
    if hypothesis.lag:
        phrases.append(f"a lag of {hypothesis.lag} frames")
    return " with ".join(phrases) or "as they are"


def _flip_fix(best: Hypothesis, ways: Sequence[Reading], convention: PoseConvention, pose_scale: float) -> str:
    scale = f" {_options(best, ways, pose_scale)}" if best.translation_scale != 1 else ""
    if convention == "as-is":
        return f"ingest with --pose-convention {best.convention}{scale}"
    return f"{FLIPS[best.convention]}{', with' if scale else ''}{scale}, after what --pose-convention does already"


def _options(best: Hypothesis, ways: Sequence[Reading], pose_scale: float) -> str:
    """Return the options that make depth and translations agree, the likeliest way first."""
    if not ways:  # without depth there is no other witness of the size
        return f"--pose-scale {pose_scale * best.translation_scale:.4g}"
    return ", or ".join(way.words(pose_scale) for way in ways[:3])


def _witness_fix(report: PoseReport) -> str:
    if report.colour_verdict == "agree":
        return (
            f"colour agrees with the poses ({report.colour_residual:.2g} pixels), so look at the depth: its unit, its "
            "calibration, whether it is of this camera"
        )
    return "check where the poses come from, and their stamps"


def rigidity_words(poses: np.ndarray) -> str:
    """Return what is wrong with matrices (N, 4, 4) that are no rigid transforms, in words."""
    finite = poses[np.isfinite(poses).all(axis=(1, 2))]
    if not len(finite):
        return "they are not finite"
    rotations = finite[:, :3, :3]
    determinants = np.linalg.det(rotations)
    scale = float(np.median(np.cbrt(np.abs(determinants))))
    if not scale > 1e-6:
        return "their rotations are zero"
    normal = rotations / np.cbrt(np.abs(determinants) + 1e-30)[:, None, None]
    orthogonal = np.abs(normal @ normal.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)) < 1e-2
    if orthogonal.mean() < 0.5:
        return "their rotations are not orthonormal"
    if (determinants < 0).mean() > 0.5:
        return "they are mirrored (determinant -1): from a left-handed system, or with one axis flipped"
    if abs(scale - 1) > 1e-2:
        return f"their rotations carry a scale of {scale:.4g} (similarity transforms): divide by it"
    return "the last row is not 0 0 0 1"
