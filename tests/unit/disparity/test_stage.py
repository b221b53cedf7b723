"""The whole step on folders of pairs, through ingest: what it writes, and every way in which a pair can be wrong."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.schemas.disparity import Disparity
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.sequence import Sequence
from scenewright.stages.disparity.consistency import deviation_of
from scenewright.stages.disparity.parameters import DisparityParameters, check_inputs
from scenewright.stages.ingest.preflight.steps import step_reports
from scenewright.stages.kit.formats.disparity_file import DisparityReader
from scenewright.stages.kit.formats.frames import FrameReader, FrameWriter, require_depth
from scenewright.stages.report.sections.stereo.view import stereo_view

from tests.unit.disparity.pairs import BASELINE, CAMERA, pair, write_folder
from tests.unit.disparity.running import matched
from tests.unit.disparity.test_rectification import turned
from tests.unit.ingest.message_logs import FIRST, recorder
from tests.unit.ingest.running import ingest

LEFT, RIGHT, TRUTH, SEEN = pair()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Disparity:
    folder = tmp_path_factory.mktemp("pairs")
    log = write_folder(folder / "log", [(LEFT, RIGHT), pair(seed=9)[:2]])
    return matched(ingest(log, folder / "sequence"), folder / "disparity")


def test_the_artifact_is_a_sequence_with_the_depth_of_its_disparities(made: Disparity) -> None:
    assert made.outcome == "ok" and made.summary["frames"] == 2 and isinstance(made, Sequence)
    require_depth(made)
    info = made.info
    assert info.streams == ("color", "depth", "deviation")
    assert info.frame_count == 2 and info.cameras[0].baseline is None
    with FrameReader(made.path("frames.mcap")) as reader, DisparityReader(made.path("disparity.mcap")) as maps:
        frame, found = reader.read(0, ("color", "depth", "deviation")), maps.read(int(reader.stamps[0]))
    assert frame.depth is not None and frame.color is not None
    known = (frame.depth > 0) & SEEN
    assert known.mean() > 0.5
    error = frame.depth - CAMERA.fx * BASELINE / TRUTH
    assert np.median(np.abs(error[known])) < 0.04
    sure = found.confidence >= made.matching.minimum_confidence
    np.testing.assert_array_equal(frame.depth > 0, found.known & sure)
    assert frame.deviation is not None
    np.testing.assert_array_equal(frame.deviation > 0, frame.depth > 0)
    expected = frame.depth**2 / (CAMERA.fx * BASELINE) * deviation_of(found.confidence)
    np.testing.assert_allclose(frame.deviation, expected, rtol=0.02, atol=1e-3)
    assert np.mean(np.abs(error)[known] < 2 * frame.deviation[known]) > 0.95


def test_its_record_says_what_was_searched_and_found(made: Disparity) -> None:
    file = made.matching
    assert [row.verdict for row in file.rows] == ["rectified"] and file.rows[0].matches > 100
    first = file.frames[0]
    assert first.lowest <= TRUTH.min() and first.lowest + first.levels > TRUTH.max()
    assert 0.3 < first.trusted <= first.known <= 1 and first.median_disparity == pytest.approx(11, abs=2)


def test_the_report_shows_it(made: Disparity) -> None:
    view = stereo_view(made, 6, 200)
    assert len(view.frames) == 2 and all(len(frame.pictures) == 3 for frame in view.frames)
    assert view.rows[0].verdict == "rectified" and 0 < view.trusted <= view.known <= 100


def test_the_same_pairs_give_the_same_bytes(made: Disparity, tmp_path: Path) -> None:
    again = matched(Sequence(made.root.parent / "sequence"), tmp_path / "again")
    for name in ("frames.mcap", "disparity.mcap", "disparity.json", "sequence.json"):
        assert again.path(name).read_bytes() == made.path(name).read_bytes(), name


def test_a_turned_eye_is_reported_corrected_or_refused(tmp_path: Path) -> None:
    log = write_folder(tmp_path / "log", [(LEFT, turned(RIGHT, 0.012, -0.02))])
    sequence = ingest(log, tmp_path / "sequence")
    corrected = matched(sequence, tmp_path / "corrected")
    assert corrected.outcome == "ok" and corrected.matching.rows[0].verdict == "corrected"
    reported = matched(sequence, tmp_path / "reported", rectification="report")
    assert reported.outcome == "not_rectified" and reported.matching.rows[0].row_error > 1.5  # type: ignore[operator]
    assert corrected.matching.frames[0].trusted > reported.matching.frames[0].trusted + 0.1
    with pytest.raises(BadInput, match="not rectified"):
        matched(sequence, tmp_path / "refused", rectification="refuse")


def test_swapped_pictures_are_said_to_be_swapped(tmp_path: Path) -> None:
    sequence = ingest(write_folder(tmp_path / "log", [(RIGHT, LEFT)]), tmp_path / "sequence")
    with pytest.raises(BadInput, match="swapped.*further right"):
        matched(sequence, tmp_path / "disparity")


def test_a_calibration_with_the_wrong_sign_is_told_by_its_pictures(tmp_path: Path) -> None:
    sequence = ingest(write_folder(tmp_path / "log", [(LEFT, RIGHT)], baseline=-BASELINE), tmp_path / "sequence")
    assert sequence.info.cameras[0].baseline == pytest.approx(BASELINE)
    assert any("sign of the calibration is taken to be wrong" in note for note in sequence.info.notes)
    made = matched(sequence, tmp_path / "disparity")
    assert made.outcome == "ok"
    with FrameReader(made.path("frames.mcap")) as reader:
        depth = reader.read(0).depth
    known = (depth > 0) & SEEN
    assert np.median(np.abs(depth - CAMERA.fx * BASELINE / TRUTH)[known]) < 0.04


def test_pictures_and_calibration_that_are_both_exchanged_are_refused_and_the_advice_works(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="left and right are swapped.*further right") as error:
        ingest(write_folder(tmp_path / "log", [(RIGHT, LEFT)], baseline=-BASELINE), tmp_path / "a")
    assert error.value.hint == "exchange the images of left and right"
    exchanged = write_folder(tmp_path / "exchanged", [(LEFT, RIGHT)], baseline=-BASELINE)
    assert ingest(exchanged, tmp_path / "b").info.cameras[0].baseline == pytest.approx(BASELINE)


def test_pictures_that_do_not_tell_leave_it_to_the_options(tmp_path: Path) -> None:
    plain = np.full_like(LEFT, 90)
    log = write_folder(tmp_path / "log", [(plain, plain)], baseline=-BASELINE)
    with pytest.raises(BadInput, match="the images do not tell") as error:
        ingest(log, tmp_path / "a")
    assert "--baseline 0.1" in str(error.value.hint)
    assert ingest(log, tmp_path / "b", baseline=0.1).info.cameras[0].baseline == 0.1


def test_a_calibration_without_a_baseline_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no baseline"):
        ingest(write_folder(tmp_path / "zero", [(LEFT, RIGHT)], baseline=0.0), tmp_path / "b")


@pytest.mark.parametrize(("baseline", "message"), [(0.0, "no baseline"), (-0.1, "swapped")])
def test_a_sequence_with_such_a_baseline_is_refused_too(tmp_path: Path, baseline: float, message: str) -> None:
    sequence = ingest(write_folder(tmp_path / "log", [(LEFT, RIGHT)]), tmp_path / "sequence")
    with FrameWriter(sequence.path("frames.mcap"), CAMERA, baselines={"camera": baseline}) as writer:
        writer.write(0.0, LEFT, None, right=RIGHT)
    with pytest.raises(BadInput, match=message):
        matched(sequence, tmp_path / "disparity")


def test_one_eye_is_not_enough(tmp_path: Path) -> None:
    log = write_folder(tmp_path / "log", [(LEFT, RIGHT)])
    shutil.rmtree(log / "right")
    (log / "left").rename(log / "color")
    with pytest.raises(BadInput, match="one eye"):
        matched(ingest(log, tmp_path / "sequence"), tmp_path / "disparity")


def test_a_frame_without_its_right_eye_is_left_out_and_counted(tmp_path: Path) -> None:
    log = write_folder(tmp_path / "log", [(LEFT, RIGHT), (LEFT, RIGHT)])
    (log / "right" / "0001.png").unlink()
    made = matched(ingest(log, tmp_path / "sequence"), tmp_path / "disparity")
    assert made.summary["frames"] == 1 and made.info.drops == {"missing_right": 1}


def test_eyes_of_different_shapes_leave_no_frame(tmp_path: Path) -> None:
    sequence = ingest(write_folder(tmp_path / "log", [(LEFT, cv2.resize(RIGHT, (240, 100)))]), tmp_path / "sequence")
    assert sequence.outcome == "empty" and sum(sequence.info.drops.values()) == 1
    with pytest.raises(BadInput, match="no frames"):
        matched(sequence, tmp_path / "disparity")


def test_pairs_without_a_calibration_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="calibration"):
        ingest(write_folder(tmp_path / "log", [(LEFT, RIGHT)], calibrated=False), tmp_path / "sequence")


def test_blank_walls_give_an_empty_artifact_with_the_reason(tmp_path: Path) -> None:
    blank = np.full((CAMERA.height, CAMERA.width, 3), 120, np.uint8)
    made = matched(ingest(write_folder(tmp_path / "log", [(blank, blank)]), tmp_path / "sequence"), tmp_path / "out")
    assert made.outcome == "empty" and "nothing_matches" in made.summary["reason"]
    assert made.matching.rows[0].verdict == "not_checked" and made.matching.left_out == {"nothing_matches": 1}


def covered(picture: np.ndarray) -> np.ndarray:
    """What a covered camera records: noise about black."""
    noise = np.random.default_rng(0).normal(4, 3, picture.shape)
    return np.clip(noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("spoil", [np.zeros_like, covered])
def test_a_covered_eye_leaves_its_frames_out(tmp_path: Path, which: int, spoil: Callable) -> None:
    bad = [LEFT, RIGHT]
    bad[which] = spoil(bad[which])
    log = write_folder(tmp_path / "log", [(LEFT, RIGHT), (bad[0], bad[1])])
    made = matched(ingest(log, tmp_path / "sequence"), tmp_path / "disparity")
    assert made.outcome == "ok" and made.summary["frames"] == 1 and made.matching.left_out == {"blank_eye": 1}


def test_eyes_that_are_all_covered_give_an_empty_artifact(tmp_path: Path) -> None:
    log = write_folder(tmp_path / "log", [(LEFT, np.zeros_like(RIGHT))])
    made = matched(ingest(log, tmp_path / "sequence"), tmp_path / "disparity")
    assert made.outcome == "empty" and "1 blank_eye" in made.summary["reason"]


def test_one_picture_twice_gives_no_depth_and_a_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    sequence = ingest(write_folder(tmp_path / "log", [(LEFT, LEFT)]), tmp_path / "sequence")
    with caplog.at_level("WARNING"):
        made = matched(sequence, tmp_path / "disparity")
    assert made.outcome == "empty" and "one image twice" in caplog.text


@pytest.mark.parametrize("wrong", ["rows", "turn", "upside_down"])
def test_eyes_far_from_rectified_are_said_to_be(tmp_path: Path, wrong: str) -> None:
    right = {"rows": np.roll(RIGHT, 30, 0), "turn": turned(RIGHT, 0.1, 0.0), "upside_down": RIGHT[::-1, ::-1]}[wrong]
    sequence = ingest(write_folder(tmp_path / "log", [(LEFT, np.ascontiguousarray(right))]), tmp_path / "sequence")
    made = matched(sequence, tmp_path / "disparity")
    assert made.outcome in ("not_rectified", "empty")
    assert made.matching.rows[0].verdict == "not_rectified" and made.matching.rows[0].row_error > 10  # type: ignore[operator]


@pytest.mark.parametrize(
    ("options", "inputs", "message"),
    [
        ({"method": "raft-stereo"}, {}, "needs --weights"),
        ({}, {"weights": Path("x.pth")}, "reads no --weights"),
        ({"levels": 64}, {}, "go together"),
        ({"levels": 60, "lowest_disparity": 0}, {}, "multiple of 16"),
        ({"block_size": 4}, {}, "even"),
    ],
)
def test_options_that_do_not_go_together(options: dict, inputs: dict, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        check_inputs(DisparityParameters(**options), inputs)


def test_inspect_offers_the_step() -> None:
    rows = {row.step: row for row in step_reports({"usable frames", "a stereo pair with a baseline", "colour"})}
    assert rows["disparity"].ready
    assert rows["segment"].missing == ("depth (make it with `disparity`)",)


@pytest.mark.parametrize("wrong", ["sign of the calibration", "pictures"])
def test_ingest_and_disparity_do_not_send_each_other_in_a_circle(tmp_path: Path, wrong: str) -> None:
    sign, pictures = (-1, (LEFT, RIGHT)) if wrong == "sign of the calibration" else (1, (RIGHT, LEFT))
    with recorder(tmp_path) as log:
        for name, picture, x in zip(("left", "right"), pictures, (0.0, sign * BASELINE), strict=True):
            shift = -CAMERA.fx * x
            projection = [CAMERA.fx, 0, CAMERA.cx, shift, 0, CAMERA.fy, CAMERA.cy, 0, 0, 0, 1.0, 0]
            log.info(f"/{name}/camera_info", FIRST, "eyes", CAMERA, P=projection)
            log.image(f"/{name}/image_rect", FIRST, picture, "rgb8", "eyes")
    sequence = ingest(log.path, tmp_path / "sequence")
    if wrong == "pictures":
        with pytest.raises(BadInput, match="further right") as error:
            matched(sequence, tmp_path / "refused")
        assert "--color-topic and --right-topic" in str(error.value.hint)
        topics = {"color_topic": "/right/image_rect", "right_topic": "/left/image_rect"}
        sequence = ingest(log.path, tmp_path / "exchanged", **topics)
    assert sequence.info.cameras[0].baseline == pytest.approx(BASELINE)
    assert matched(sequence, tmp_path / "disparity").outcome == "ok"
