"""Every door (tests/fuzz/registry.py) and every damage that bytes can have: refused in one line, or read on."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from tests.bad_input.damages import WHOLE, changes, cuts, spread
from tests.fuzz.registry import NAMES, load

DOORS = [name for name in NAMES if not name.startswith("room_")]
"""Those of rooms take edits, no content."""
MOST_INPUTS = 200
"""Of one sort of damage, for each door; ten for each sample where it has more than twenty."""
UNREADABLE = {("image_message", "nonsense"), ("rosbag2_metadata", "of mcap")}
"""Samples for fuzzers that are refused as they are."""
FOLDERS = (
    "layout_7scenes layout_scannet layout_colmap layout_colmap_text layout_stray_scanner layout_polycam "
    "layout_scanner_app "
)
"""Layouts with describing files that nothing is read from."""
READ = {
    "empty": FOLDERS
    + "layout_arkit_scenes layout_redwood layout_tum layout_scenenn layout_replica obj message transcript "
    "ros_definition",
    "cut in the middle": FOLDERS + "layout_arkit_scenes layout_tum obj stl calibration_file transcript ros_definition",
    "words": FOLDERS + "obj",
    "no UTF-8": FOLDERS + "panoptic_zip npz image_message model_reply",
    "a zero byte": FOLDERS + "stl message compressed_depth image_message depth_array calibration_file ros_definition",
    "more behind its end": FOLDERS
    + "panoptic_zip panoptic_png npz obj stl rosbag2 message compressed_depth image_message library_model depth_array "
    "service_request model_reply",
    "nested": FOLDERS + "obj image_message",
    "nested objects": FOLDERS + "obj image_message",
}
"""Damage -> the doors that read one of their samples all the same."""
IN_PART = {
    "empty": "trajectory settings",
    "cut in the middle": "mcap rosbag1 rosbag2 trajectory settings pose_list label_table",
    "words": "label_table",
    "a zero byte": "mcap rosbag1 rosbag2 panoptic_zip",
    "more behind its end": "mcap rosbag1",
}
"""Damage -> the doors that refuse some and read the rest; `rosbag2_metadata` always, as a bag is read without it."""
CUT_NOWHERE = (
    "panoptic_zip panoptic_png npz our_ply glb urdf manifest json_payload frames_mcap compressed_depth image_message "
    "layout_nerfstudio layout_record3d layout_scannetpp "
    "depth_array onnx_sidecar model_answer service_reply service_info service_request"
)
"""Doors that refuse every beginning of every sample."""


def outcome(name: str, data: bytes) -> str:
    """Return what a door, which must answer soon, makes of bytes."""
    started = time.process_time()
    found = load(name).outcome(data)
    assert time.process_time() - started < 5, (name, data[:100])
    return found


@pytest.mark.parametrize("name", DOORS)
def test_samples_are_read(name: str) -> None:
    for label, data in load(name).seeds().items():
        assert (outcome(name, data) == "refused") == ((name, label) in UNREADABLE), label


@pytest.mark.parametrize("damage", WHOLE)
def test_a_damage_is_refused_by_every_door_but_those_listed(damage: str) -> None:
    read, in_part = set(), set()
    for name in DOORS:
        door = load(name)
        samples = [(data[: door.choosing], data[door.choosing :]) for data in door.seeds().values()]
        outcomes = {outcome(name, choice + WHOLE[damage](content)) for choice, content in samples}
        if "read" in outcomes:
            read.add(name)
        elif "in part" in outcomes:
            in_part.add(name)
    assert read == set(READ[damage].split())
    assert in_part == {"rosbag2_metadata", *IN_PART.get(damage, "").split()}


def damaged(name: str, damages: Callable[[bytes], list[bytes]]) -> list[bytes]:
    """Return the samples of a door with damages, ten for each of many samples."""
    door = load(name)
    samples = door.seeds().values()
    inputs = [data[: door.choosing] + each for data in samples for each in damages(data[door.choosing :])]
    return spread(inputs, max(MOST_INPUTS, 10 * len(samples)))


@pytest.mark.parametrize("name", DOORS)
def test_what_is_cut_is_refused_where_a_format_can_tell(name: str) -> None:
    outcomes = {outcome(name, data) for data in damaged(name, cuts)}
    assert (outcomes == {"refused"}) == (name in CUT_NOWHERE.split())


@pytest.mark.parametrize("name", DOORS)
def test_flipped_bits_and_extreme_numbers_raise_nothing_else(name: str) -> None:
    for data in damaged(name, changes):
        try:
            outcome(name, data)
        except Exception as error:
            error.add_note(f"door {name}, input {data!r}")
            raise
