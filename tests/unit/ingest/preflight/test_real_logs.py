"""Real logs as they are, and with a fault."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenewright.stages.ingest.preflight.settings import ingest_parameters

from benchmarks.experiments.preflight.experiment import judge
from benchmarks.experiments.preflight.faults import FAULTS
from tests.real_data import real_data

DINING_ROOM = ("fx=518", "fy=519", "cx=325.5", "cy=253.5")


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("redwood_livingroom1", ()),
        pytest.param("7scenes_redkitchen", (), marks=pytest.mark.slow),
        ("slambook2_rgbd/diningroom", DINING_ROOM),
    ],
)
def test_untouched_logs_are_ready(name: str, settings: tuple[str, ...]) -> None:
    report, _ = judge(real_data(name), ingest_parameters(settings), None, 40)
    assert report.verdict == "ready", report.findings


@pytest.mark.parametrize("fault", ["inverse poses", "depth x5 (5000 as mm)"])
def test_faults_in_a_real_log_are_named(fault: str) -> None:
    plant, named = FAULTS[fault]
    report, _ = judge(real_data("redwood_livingroom1"), ingest_parameters(()), plant, 40)
    assert report.verdict == "wasted" and named(report.cameras[0])


def test_colour_that_is_not_registered_is_found() -> None:
    log: Path = real_data("7scenes_redkitchen")
    report, _ = judge(log, ingest_parameters(("register_color=false",)), None, 40)
    assert report.verdict == "doubtful" and "not registered" in report.reason
