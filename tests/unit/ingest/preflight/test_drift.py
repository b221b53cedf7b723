"""Poses that drift are named where the camera comes back; poses that do not, and other faults, are not called so."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scenewright.cli.inspect_command import command_for
from scenewright.stages.ingest.preflight.report import InspectionReport
from scenewright.stages.kit.registration.rigid_motion import between, exponential

from tests.unit.ingest.preflight.textured_room import inspected, source, walk

THERE_AND_BACK = np.concatenate([walk(30), walk(30)[::-1]])


def with_drift(sideways: float) -> InspectionReport:
    """A walk there and back of which every step goes so much too far to the right [m]."""
    given, slip = [THERE_AND_BACK[0]], exponential(np.array([0.0, 0.0, 0.0, sideways, 0.0, 0.0]))
    for before, after in pairwise(THERE_AND_BACK):
        given.append(given[-1] @ between(before, after) @ slip)
    log = source(len(THERE_AND_BACK), poses=THERE_AND_BACK, speckled=True)
    entries = [replace(entry, world_from_camera=pose) for entry, pose in zip(log.entries, given, strict=True)]
    return inspected(replace(log, entries=tuple(entries)), len(entries)).report


def test_poses_that_are_right_miss_nothing() -> None:
    report = with_drift(0.0)
    drift = report.cameras[0].drift
    assert report.verdict == "ready", report.findings
    assert drift is not None and drift.places >= 3 and drift.missed < 0.003


def test_poses_that_drift_are_named() -> None:
    """2 mm a step: at places that are seen again 30 to 59 steps later, 6 to 12 cm."""
    report = with_drift(0.002)
    camera = report.cameras[0]
    assert camera.poses.verdict == "agree" and camera.drift is not None
    assert 0.06 < camera.drift.missed < 0.12 and camera.drift.neighbours_missed < 0.01
    assert report.verdict == "doubtful" and "poses drift" in report.reason and "poses_method=refine" in report.fix
    assert "run reconstruct-without-poses --set log=room --set poses_method=refine" in command_for(report, [])


def test_a_walk_that_does_not_come_back_says_nothing() -> None:
    assert inspected(source(20)).report.cameras[0].drift is None


@pytest.mark.parametrize("words", ["inverse", "opengl"])
def test_poses_that_contradict_the_depth_are_not_said_to_drift(words: str) -> None:
    report = inspected(source(48), 26, f"pose_convention={words}").report
    assert report.verdict == "wasted" and report.cameras[0].drift is None
