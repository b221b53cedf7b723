"""Stamps that are no clock's: frames come in the order of the file, and the log says so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.ingest.clocks import stamps_problem
from scenewright.stages.ingest.detection import open_log
from scenewright.stages.ingest.parameters import IngestParameters
from scenewright.stages.ingest.preflight.inspection import inspect_log
from scenewright.stages.ingest.preflight.settings import ingest_parameters
from scenewright.stages.kit.progress import SilentProgress

from tests.real_data import real_data
from tests.unit.ingest.folder_writers import write_image_folder, write_numbered_tum, write_tum
from tests.unit.ingest.tiny_room import frames, png

COUNT = 12
SECOND = 10**9
NAMES = [f"rgb{index:05d}.png" for index in range(COUNT)]
INTERVALS = [0.0059, 0.0148, 0.0167, 0.0166, 0.0057, 0.0169, 0.0171, 0.0333, 0.0131, 0.0097, 0.0088, 0.0349]
"""How long each picture took, in the place of when it was taken."""
WRONG: dict[str, list[float]] = {
    "intervals": INTERVALS,
    "constant": [7.5] * COUNT,
    "repeated": [float(index // 3) for index in range(COUNT)],
    "backward": [10.0 - index / 30 for index in range(COUNT)],
    "begun again": [index % 6 / 30 for index in range(COUNT)],
    "of a unit too small": [index / 30 * 1e-3 for index in range(COUNT)],
}


def in_nanoseconds(seconds: list[float]) -> list[int]:
    return [round(value * SECOND) for value in seconds]


@pytest.mark.parametrize("wrong", WRONG)
def test_stamps_that_are_no_clocks(wrong: str) -> None:
    assert stamps_problem(in_nanoseconds(WRONG[wrong]), NAMES)


@pytest.mark.parametrize("rate", [0.5, 30.0, 300.0])
def test_stamps_of_a_clock(rate: float) -> None:
    stamps = [1403636579 * SECOND + round(index * SECOND / rate) for index in range(40)]
    names = [f"{index}.png" for index in range(40)]
    assert stamps_problem(stamps, names) is None
    shuffled = sorted(range(40), key=str)  # 0, 1, 10, 11, ...: as a shell lists them
    assert stamps_problem([stamps[k] for k in shuffled], [names[k] for k in shuffled]) is None
    assert stamps_problem(stamps[::-1], names[::-1]) is None, "the newest first, and called so"
    set_back = [*stamps[:20], stamps[20] - SECOND * 10, *stamps[21:]]
    assert stamps_problem(set_back, names) is None, "one picture in forty"


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("pairs", [True, False])
def test_a_tum_folder_without_a_clock_is_read_in_its_order(tmp_path: Path, wrong: str, pairs: bool) -> None:
    source = open_log(write_numbered_tum(tmp_path / "log", WRONG[wrong], pairs=pairs), IngestParameters())
    assert [entry.name for entry in source.entries] == [f"rgb/{name}" for name in NAMES]
    for index, entry in enumerate(source.entries):
        assert entry.files.depth is not None and entry.files.depth.name == f"depth{index:05d}.png"
        assert entry.problem is None and entry.stamp is None
    np.testing.assert_allclose([entry.time for entry in source.entries], np.arange(COUNT) / 30, atol=1e-9)
    (note,) = (note for note in source.notes if "order in the file" in note)
    assert note.startswith("WARNING")
    assert source.streams[0].stamps.tolist() == in_nanoseconds([round(value, 9) for value in WRONG[wrong]])


def test_a_shuffled_list_is_sorted_by_its_clock(tmp_path: Path) -> None:
    log = write_numbered_tum(tmp_path / "log", [index / 30 for index in range(COUNT)], pairs=True)
    lines = (log / "associations.txt").read_text().splitlines()
    (log / "associations.txt").write_text("\n".join(lines[k] for k in sorted(range(COUNT), key=str)))
    source = open_log(log, IngestParameters())
    assert [entry.name for entry in source.entries] == [f"rgb/{name}" for name in NAMES]
    assert not any("order in the file" in note for note in source.notes)


def test_poses_are_looked_up_by_the_stamps_they_have(tmp_path: Path) -> None:
    """Stamps of a unit too small, in every list alike."""
    log = write_tum(tmp_path / "log", frames(COUNT))
    for path in log.glob("*.txt"):
        if path.name != "calibration.txt":
            rows = [line.split(None, 1) for line in path.read_text().splitlines() if not line.startswith("#")]
            first = min(float(stamp) for stamp, _ in rows)
            path.write_text("\n".join(f"{(float(stamp) - first) * 1e-3:.9f} {rest}" for stamp, rest in rows))
    source = open_log(log, IngestParameters())
    assert all(entry.world_from_camera is not None for entry in source.entries)


def test_lists_of_two_lengths_without_a_clock_are_refused_and_pairs_are_read(tmp_path: Path) -> None:
    log = write_numbered_tum(tmp_path / "log", INTERVALS, pairs=False)
    rows = (log / "depth.txt").read_text().splitlines()
    (log / "depth.txt").write_text("\n".join(rows[1:]))
    with pytest.raises(BadInput, match="12 images and 11 depth images have no common order") as refused:
        open_log(log, IngestParameters())
    assert "associations.txt in the place of rgb.txt" in (refused.value.hint or "")
    pairs = zip((log / "rgb.txt").read_text().splitlines()[1:], rows[1:], strict=True)
    (log / "rgb.txt").unlink()
    (log / "associations.txt").write_text("\n".join(f"{color} {depth}" for color, depth in pairs))
    source = open_log(log, IngestParameters())
    assert [entry.name for entry in source.entries] == [f"rgb/{name}" for name in NAMES[1:]]


@pytest.mark.parametrize("wrong", ["intervals", "constant", "of a unit too small"])
def test_times_of_plain_images_that_are_none(tmp_path: Path, wrong: str) -> None:
    log = write_image_folder(tmp_path / "log", frames(COUNT), poses=False)
    (log / "times.txt").write_text("\n".join(f"{value:.9f}" for value in WRONG[wrong]))
    source = open_log(log, IngestParameters(frame_rate=10.0))
    np.testing.assert_allclose([entry.time for entry in source.entries], np.arange(COUNT) / 10, atol=1e-9)
    assert any("order in the file, 10 images a second" in note for note in source.notes)


@pytest.mark.parametrize(("settings", "said"), [((), "stamps make"), (("frame_rate=10",), "")])
def test_inspect_says_what_is_taken_until_the_rate_is_given(
    tmp_path: Path, settings: tuple[str, ...], said: str
) -> None:
    log = write_numbered_tum(tmp_path / "log", WRONG["of a unit too small"], pairs=True)
    report = inspect_log(log, ingest_parameters(settings), 6, SilentProgress()).report
    found = [finding for finding in report.findings if finding.check == "reading"]
    assert [said in finding.message and "--frame-rate" in finding.fix for finding in found] == [True] * bool(said)
    assert report.streams[0].reversals == 0


@pytest.mark.parametrize(("step", "doubts"), [(1 / 30, 0), (2.0, 0), (33.3, 2)])
def test_inspect_asks_whether_stamps_are_of_another_unit(tmp_path: Path, step: float, doubts: int) -> None:
    """Milliseconds from 0 on are seconds as far as a reader can tell."""
    log = write_numbered_tum(tmp_path / "log", [index * step for index in range(4)], pairs=True)
    findings = inspect_log(log, ingest_parameters(()), 6, SilentProgress()).report.findings
    assert sum("33.3 s apart: are the stamps of another unit" in finding.message for finding in findings) == doubts


# --- depth units that only the layout states --------------------------------------------------------------------


def rescaled(log: Path, factor: Callable[[np.ndarray], np.ndarray]) -> Path:
    """Write each depth image of a folder anew."""
    for path in sorted((log / "depth").iterdir()):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert image is not None
        path.write_bytes(png(factor(image.astype(float)).astype(np.uint16)))
    return log


def median_of(log: Path, **options: float) -> tuple[float, str]:
    """Return the median depth [m] of the first frame, and the warning about its unit."""
    source = open_log(log, IngestParameters(**options))  # type: ignore[arg-type]
    depth = source.entries[0].load().depth
    assert depth is not None
    notes = [note for note in source.notes if "taken as millimetres" in note]
    return float(np.median(depth[depth > 0])) / 1000, " ".join(notes)


TIMES = [index / 30 for index in range(4)]


def test_millimetres_in_a_tum_folder_are_seen_by_how_near_they_would_be(tmp_path: Path) -> None:
    true, said = median_of(write_numbered_tum(tmp_path / "true", TIMES, pairs=True, units=5000.0))
    assert not said
    near = 0.9 / true  # a desk
    log = rescaled(write_numbered_tum(tmp_path / "log", TIMES, pairs=True, units=1000.0), lambda depth: depth * near)
    median, said = median_of(log)
    assert median == pytest.approx(0.9, rel=0.01) and "--depth-scale 1000, or 5000" in said
    assert median_of(log, depth_scale=1000.0) == (pytest.approx(median), "")
    assert median_of(log, depth_scale=5000.0) == (pytest.approx(median / 5, rel=0.01), "")


def test_values_that_all_hold_the_factor_are_of_the_layout_however_near(tmp_path: Path) -> None:
    """Millimetres of a close-up, times five: 18 cm away."""
    true, _ = median_of(write_numbered_tum(tmp_path / "true", TIMES, pairs=True))
    near = 0.18 / true
    log = write_numbered_tum(tmp_path / "log", TIMES, pairs=True, units=1000.0)
    rescaled(log, lambda depth: np.rint(depth * near) * 5)
    median, said = median_of(log)
    assert median == pytest.approx(0.18, rel=0.02) and not said


@pytest.mark.parametrize(("factor", "poses", "doubted"), [(5, False, True), (1, False, False), (5, True, False)])
def test_millimetres_times_five_that_are_read_as_millimetres(
    tmp_path: Path, factor: int, poses: bool, doubted: bool
) -> None:
    """With poses to compare with, these say it."""
    log = write_image_folder(tmp_path / "log", frames(COUNT), poses=poses)
    rescaled(log, lambda depth: depth * factor)
    findings = inspect_log(log, ingest_parameters(()), 12, SilentProgress()).report.findings
    assert any("multiple of 5" in each.message and "--depth-scale 5000" in each.fix for each in findings) is doubted
    settings = ("depth_scale=5000",) if factor == 5 else ()
    after = inspect_log(log, ingest_parameters(settings), 12, SilentProgress()).report.findings
    assert not any("multiple of 5" in finding.message for finding in after)


# --- a recorded log without a clock, in millimetres ---------------------------------------------------------------


def test_a_recorded_desk_is_read_in_its_order_and_in_metres() -> None:
    log = real_data("realsense_desk_noposes")
    source = open_log(log, IngestParameters(fx=615, fy=615, cx=320, cy=240))
    names = [line.split()[1] for line in (log / "associations.txt").read_text().splitlines()]
    assert [entry.name for entry in source.entries] == names
    depth = source.entries[0].load().depth
    assert depth is not None and 0.3 < np.quantile(depth[depth > 0], 0.05) / 1000 < 0.8  # a D435 sees from 0.2 m on
    assert any("stamps make 13,574 images a second" in note for note in source.notes)


def test_a_recorded_desk_without_intrinsics_is_told_which_to_try() -> None:
    with pytest.raises(BadInput) as refused:
        open_log(real_data("realsense_desk_noposes"), IngestParameters())
    assert "--fx 615 --fy 615 --cx 320 --cy 240" in (refused.value.hint or "")
