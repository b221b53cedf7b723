"""Whether poses drift: where the camera comes back, dense alignment of frames says by how much the poses miss it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise

import numpy as np
from scenewright.stages.ingest.preflight.choice import RUN_LENGTH, turn
from scenewright.stages.ingest.preflight.fits import relative_pose
from scenewright.stages.ingest.preflight.looking import Look
from scenewright.stages.ingest.preflight.motion import shared
from scenewright.stages.ingest.preflight.report import DriftReport, Finding, exact
from scenewright.stages.kit.registration.pairs import USUAL_LIMITS, agreed
from scenewright.stages.kit.registration.pyramid import Pyramid, build_pyramid
from scenewright.stages.kit.registration.rigid_motion import between, distance_of

LEAST_WAY = 2.0
"""Way between two frames from which the camera has come back [m]; a radian of turning counts as a metre."""
NEIGHBOURS_WAY = 0.3
"""Way up to which two frames are neighbours, which any odometry places well [m]."""
LEAST_SHARED = 0.5
"""Share of either frame that the other must see of it."""
SAME_ANGLE = 0.8
"""Largest turn between two frames that are compared [rad]; by eye."""
MOST_PAIRS, LEAST_PAIRS = 8, 3
"""So many places are looked at, and fewer say nothing."""
DRIFT, DRIFT_FACTOR = 0.03, 3.0
"""Poses drift that miss places by this [m], the residual up to which alignments are believed, and by so many times what
they miss neighbours by; by eye."""
WIDTH, LEVELS, FARTHEST = 320, 3, 4.5
"""Frames are aligned at most so wide [px], on so many levels, up to this depth [m]."""


def drift_report(poses: np.ndarray, looks: Mapping[int, Look]) -> DriftReport | None:
    """Return by how much poses (N, 4, 4) of all frames miss the frames that were looked at, where the camera comes back
    and between neighbours; None where too few places are seen twice or can be aligned."""
    steps = [float(np.linalg.norm((b - a)[:3, 3])) + turn(a, b) for a, b in pairwise(poses)]
    way = np.concatenate([[0.0], np.cumsum(steps)])
    seen = [index for index, look in sorted(looks.items()) if look.depth is not None]
    pairs = [(i, j) for i, j in combinations(seen, 2) if turn(poses[i], poses[j]) < SAME_ANGLE]
    pairs.sort(key=lambda pair: way[pair[0]] - way[pair[1]])
    back = _chosen([(i, j) for i, j in pairs if way[j] - way[i] >= LEAST_WAY], poses, looks)
    near = _chosen([(i, j) for i, j in pairs if way[j] - way[i] <= NEIGHBOURS_WAY], poses, looks)
    pyramids: dict[int, Pyramid] = {}
    missed, missed_near = (_missed(chosen, poses, looks, pyramids) for chosen in (back, near))
    if min(len(missed), len(missed_near)) < LEAST_PAIRS:
        return None
    return DriftReport(
        places=len(missed),
        missed=exact(float(np.median(list(missed.values())))),
        way=exact(float(np.median([way[j] - way[i] for i, j in missed]))),
        neighbours_missed=exact(float(np.median(list(missed_near.values())))),
    )


def drifts(report: DriftReport) -> bool:
    """Whether poses miss places by far more than alignment does."""
    return report.missed >= max(DRIFT, DRIFT_FACTOR * report.neighbours_missed)


def drift_findings(report: DriftReport, camera: str) -> list[Finding]:
    """Return what there is to say of poses that drift."""
    if not drifts(report):
        return []
    message = (
        f"poses drift: where the camera comes back, after {report.way:.2g} m of way and turning, the depth puts it "
        f"{100 * report.missed:.2g} cm beside them (median of {report.places} places; "
        f"{100 * report.neighbours_missed:.2g} cm between neighbours)"
    )
    fix = "run reconstruct-without-poses --set poses_method=refine, or give fuse the result of poses --method refine"
    return [Finding(severity="doubtful", check="poses", message=message, fix=fix, camera=camera)]


def _chosen(pairs: Sequence[tuple[int, int]], poses: np.ndarray, looks: Mapping[int, Look]) -> list[tuple[int, int]]:
    """Return the first MOST_PAIRS pairs that see enough of each other, none beside one that was chosen already."""
    chosen: list[tuple[int, int]] = []
    for i, j in pairs:
        if any(abs(i - a) < RUN_LENGTH and abs(j - b) < RUN_LENGTH for a, b in chosen):
            continue
        there, back = relative_pose(poses[j], poses[i]), relative_pose(poses[i], poses[j])
        if min(shared(looks[i], looks[j], there), shared(looks[j], looks[i], back)) >= LEAST_SHARED:
            chosen.append((i, j))
        if len(chosen) == MOST_PAIRS:
            break
    return chosen


def _missed(
    pairs: Sequence[tuple[int, int]], poses: np.ndarray, looks: Mapping[int, Look], pyramids: dict[int, Pyramid]
) -> dict[tuple[int, int], float]:
    """Return the distance [m] between where the poses and where the alignment put the second frame of each pair that
    could be aligned there and back."""
    missed = {}
    for i, j in pairs:
        for index in (i, j):
            if index not in pyramids:
                pyramids[index] = _pyramid(looks[index])
        guess = between(poses[i], poses[j])
        found = agreed(pyramids[i], pyramids[j], guess, USUAL_LIMITS, use_color=True, coarsest=None)
        if found is not None:
            missed[i, j] = distance_of(between(guess, found.target_from_source))
    return missed


def _pyramid(look: Look) -> Pyramid:
    assert look.depth is not None
    gray = look.gray if look.gray is not None and look.gray.shape == look.depth.shape else None
    color = None if gray is None else np.repeat(gray[..., None], 3, axis=2)
    depth = look.depth * np.float32(1e-3)
    return build_pyramid(depth, color, look.depth_camera, width=WIDTH, levels=LEVELS, maximum_depth=FARTHEST)
