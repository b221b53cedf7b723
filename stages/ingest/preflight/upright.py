"""What ingest would do to make the world upright, tried on the frames that were looked at."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.report import Finding, GravityReport, Severity, significant
from scenewright.stages.ingest.source import LogSource
from scenewright.stages.kit.geometry.surface_samples import surface_samples
from scenewright.stages.kit.geometry.upright_world import REASON, make_upright


def gravity_report(
    source: LogSource,
    parameters: IngestParameters,
    poses: np.ndarray,
    posed: Iterable[tuple[Look, np.ndarray]],
    untouched: bool,
) -> GravityReport:
    """Return how the world would be made upright.

    `poses` (N, 4, 4) are all, `posed` the frames with depth; `untouched` says that the poses are as the log has them,
    so that what it states of its world holds.
    """

    def cloud() -> tuple[np.ndarray, np.ndarray]:
        samples = [(np.zeros((0, 3)), np.zeros((0, 3)))]
        for look, pose in posed:
            if look.depth is not None:
                samples.append(surface_samples(look.depth * np.float32(1e-3), look.depth_camera, pose))
        return np.concatenate([points for points, _ in samples]), np.concatenate([normals for _, normals in samples])

    stated = source.world_up_detail if source.world_up == "z" and untouched else None
    try:
        gravity = make_upright(
            parameters.gravity, parameters.up, stated, poses, cloud, np.random.default_rng([0, 0]), source.up_in_log
        )
    except BadInput as error:
        return GravityReport(method="none", detail=str(error))
    up = np.array(gravity.world_from_log)[2, :3]  # the world's z axis in the log's frame
    tilt = None if gravity.method == "none" else math.degrees(math.acos(float(np.clip(up[2], -1, 1))))
    return GravityReport(method=gravity.method, detail=gravity.detail, tilt=significant(tilt, 3))


def gravity_findings(report: GravityReport, has_poses: bool) -> list[Finding]:
    """Return what is odd about gravity."""
    if has_poses and report.method in ("none", "mean_camera_up"):
        message = f"up is not sure: {report.detail}"
        return [Finding(severity="note", check="gravity", message=message, fix="--gravity given --up AXIS if known")]
    if reason := REASON.search(report.detail):
        severity: Severity = "doubtful" if reason[1] == "doubtful" else "note"
        message = f"up may be wrong: {reason[2]}"
        return [Finding(severity=severity, check="gravity", message=message, fix="--gravity given --up AXIS if known")]
    return []
