"""How the poses move, and how much neighbours see of each other."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scenewright.stages.ingest.preflight.fits import relative_pose
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.report import Finding, MotionReport, exact, significant
from scenewright.stages.ingest.preflight.reprojection import projected
from scenewright.stages.kit.geometry.cameras import back_project

JUMP = 0.5
"""Distance of neighbouring poses [m] over which a step may be a jump."""
JUMP_FACTOR = 12.0
"""A jump is also longer than this many median steps."""
REPEATED = 0.2
"""Share of poses equal to the one before worth a warning."""
LITTLE_OVERLAP = 0.5
"""Shared view of neighbouring frames below which it is called little; by eye."""
LISTED = 8
"""Most jumps whose times are listed."""


def motion_report(
    poses: np.ndarray, times: np.ndarray, looks: Mapping[int, Look], runs: tuple[tuple[int, ...], ...]
) -> MotionReport | None:
    """Return the motion of poses (N, 4, 4) at `times` (N,) [s]; None for fewer than two."""
    if len(poses) < 2:
        return None
    positions = poses[:, :3, 3]
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    cosines = (np.einsum("nij,nij->n", poses[:-1, :3, :3], poses[1:, :3, :3]) - 1) / 2
    turns = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    seconds = np.maximum(np.diff(times), 1e-9)
    median = float(np.median(steps))
    jumps = np.flatnonzero((steps > JUMP) & (steps > JUMP_FACTOR * median))
    repeated = (np.diff(poses, axis=0) == 0).all(axis=(1, 2))
    extent = positions.max(axis=0) - positions.min(axis=0)
    overlaps = [
        shared(looks[i], looks[i + 1], relative_pose(poses[i + 1], poses[i]))
        for run in runs
        for i in run[:-1]
        if i in looks and i + 1 in looks and looks[i].depth is not None
    ]
    return MotionReport(
        length=exact(float(steps.sum())),
        extent=(exact(extent[0]), exact(extent[1]), exact(extent[2])),
        step_median=exact(median),
        step_largest=exact(float(steps.max())),
        turn_median=exact(float(np.median(turns))),
        turn_largest=exact(float(turns.max())),
        speed_median=exact(float(np.median(steps / seconds))),
        jumps=len(jumps),
        jump_times=tuple(exact(times[k], 15) for k in jumps[:LISTED]),
        repeated_share=exact(float(repeated.mean())),
        overlap=significant(float(np.median(overlaps)), 3) if overlaps else None,
    )


def shared(first: Look, second: Look, second_from_first: np.ndarray) -> float:
    """Return the share of the valid pixels of `first` that fall into the picture of `second`."""
    assert first.depth is not None
    step = max(1, first.depth.shape[1] // 40)
    points = back_project(first.depth * np.float32(1e-3), first.depth_camera, stride=step).reshape(-1, 3)
    points = points[points[:, 2] > 0].astype(np.float64)
    if not len(points):
        return 0.0
    moved = points @ second_from_first[:3, :3].T + second_from_first[:3, 3]
    return float(projected(moved, second.depth_camera)[3].mean())


def motion_findings(report: MotionReport, poses_agree: bool, camera: str) -> list[Finding]:
    """Return what is odd about the motion."""
    findings = []

    def add(severity: str, message: str, fix: str = "") -> None:
        findings.append(Finding(severity=severity, check="poses", message=message, fix=fix, camera=camera))  # type: ignore[arg-type]

    if report.jumps:
        places = ", ".join(f"{time:.3f}" for time in report.jump_times[:4])
        add(
            "doubtful",
            f"the poses jump {report.jumps} times, by up to {report.step_largest:.3g} m (median step "
            f"{report.step_median:.2g} m), after {places} s",
            "use the part before or after with --start and --stop",
        )
    if report.repeated_share > REPEATED:
        add(
            "doubtful" if report.repeated_share < 1 else "note",
            f"{100 * report.repeated_share:.0f} % of the poses are exactly the one before",
            "the tracker was slower than the camera, or stood still: use --every, or other poses",
        )
    if poses_agree and report.overlap is not None and report.overlap < LITTLE_OVERLAP:
        add(
            "doubtful",
            f"neighbouring frames share only {100 * report.overlap:.0f} % of what they see",
            "move more slowly, or record more images a second",
        )
    return findings
