"""The commands of suture: the chain on one rendered scene, and what they say of bad input in one line."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scenewright.cli.main import run
from scenewright.schemas.evaluation import MetricsFile
from scenewright.schemas.sequence import SequenceFile
from scenewright.schemas.suture_needle import SutureNeedleFile
from scenewright.schemas.suture_scene import SutureScene, SutureSceneFile
from scenewright.schemas.suture_trial import SutureTrialFile
from scenewright.stages.engine.loading import load, payload
from scenewright.stages.kit.formats.frames import FrameWriter
from scenewright.stages.report.sections.suture.view import tables_of
from scenewright.stages.suture.evaluation.thread_figures import thread_error
from scenewright.stages.suture.motion_reports import motions_to_last
from scenewright.stages.suture.pairs import StereoPairs
from scenewright.stages.suture.trials.recording import KEPT_OF_A_MOTION

from tests.unit.viewing.artifacts import seal
from tests.unit.viewing.suture_artifacts import CAMERA, make_scene

QUIET = "--quiet"


def refused(capsys: pytest.CaptureFixture[str], code: int, *words: str | Path) -> str:
    assert run([*map(str, words), QUIET]) == code
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error:")]
    assert len(lines) == 1, lines
    return lines[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One rendered pair whose needle is held in the air."""
    out = tmp_path_factory.mktemp("stitch")
    assert run(["suture", "scene", "--seed", "3", "--holder", "air", "--out", str(out / "scene"), QUIET]) == 0
    return out


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A grey pair of 32 x 24 pixels, which costs nothing."""
    out = tmp_path_factory.mktemp("small")
    make_scene(out)
    return out


@pytest.mark.slow
def test_a_needle_is_rendered_found_and_judged(folder: Path) -> None:
    scene, needle, figures = (str(folder / name) for name in ("scene", "needle", "figures"))
    assert run(["suture", "needle", "--sequence", scene, "--segmentation", "spoiled", "--out", needle, QUIET]) == 0
    assert run(["suture", "evaluate", "--scene", scene, "--needle", needle, "--out", figures, QUIET]) == 0
    truth = SutureSceneFile.read(folder / "scene" / "scene.json").views[0]
    found = SutureNeedleFile.read(folder / "needle" / "needle.json")
    assert found.masks == "spoiled" and found.filter == "none" and found.filtered is None
    estimate = found.frames[0].estimate
    assert estimate.camera_from_needle is not None and estimate.covariance is not None
    apart = np.array(estimate.camera_from_needle)[:3, 3] - np.array(truth.camera_from_needle)[:3, 3]
    assert np.linalg.norm(apart) < 1e-3
    metrics = MetricsFile.read(folder / "figures" / "metrics.json").metrics
    assert metrics["ours/needle_all/within_tolerance"] == 1.0
    assert metrics["ours/needle_all/centre_error_mm"] == pytest.approx(1000 * np.linalg.norm(apart), abs=1e-3)
    assert "ours/needle_all/hertz" not in metrics
    shown = cv2.imread(str(folder / "needle" / "pictures" / "000000.png"))
    assert shown is not None and shown.shape[1] == 1440


@pytest.mark.slow
def test_masks_of_files_are_read_and_checked(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    masks, scene = tmp_path / "masks", folder / "scene"
    masks.mkdir()
    words = ("suture", "needle", "--sequence", scene, "--masks", masks, "--out", tmp_path / "needle")
    assert "000000_left.png: there is no such mask" in refused(capsys, 3, *words)
    blank = np.zeros((960, 1280), np.uint8)
    for side in ("left", "right"):
        cv2.imwrite(str(masks / f"000000_{side}.png"), blank[:100])
    assert "1280 x 100 pixels, the images have 1280 x 960" in refused(capsys, 3, *words)
    for side in ("left", "right"):
        cv2.imwrite(str(masks / f"000000_{side}.png"), blank)
    assert "sees 0 pixels of needle" in refused(capsys, 4, *words)
    for side, other in (("left", "right"), ("right", "left")):
        truth = cv2.imread(str(scene / "truth" / f"000000_{other}.png"), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(masks / f"000000_{side}.png"), truth)
    assert "Are left and right exchanged?" in refused(capsys, 4, *words)
    assert run([*map(str, words), QUIET, "--accept", "abstained"]) == 0
    assert SutureNeedleFile.read(tmp_path / "needle" / "needle.json").frames[0].estimate.camera_from_needle is None


def _pair(folder: Path, small: Path, baseline: float | None) -> Path:
    """A sequence of one grey pair with this baseline; None: no right eye."""
    folder.mkdir()
    info = json.loads((small / "suture_scene" / "sequence.json").read_text())
    SequenceFile.model_validate(info).write(folder / "sequence.json")
    baselines = {} if baseline is None else {"camera": baseline}
    grey = np.full((24, 32, 3), 90, np.uint8)
    with FrameWriter(folder / "frames.mcap", CAMERA, cameras={"camera": CAMERA}, baselines=baselines) as writer:
        writer.write(1.0, grey, None, right=None if baseline is None else grey, camera_name="camera")
    (folder / "trajectory.tum").write_text("")
    return seal(folder, "sequence")


@pytest.mark.parametrize(
    ("baseline", "said"),
    [(None, "have one eye"), (0.0, "have no baseline"), (-0.06, "left and right of 'camera' are exchanged")],
)
def test_pairs_that_are_none_are_refused(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], baseline: float | None, said: str
) -> None:
    sequence = _pair(tmp_path / "sequence", small, baseline)
    for step in ("needle", "thread"):
        words = ("suture", step, "--sequence", sequence, "--masks", tmp_path, "--out", tmp_path / step)
        assert said in refused(capsys, 3, *words)


def test_what_is_missing_is_named(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, out = small / "suture_scene", tmp_path / "out"
    sequence = _pair(tmp_path / "sequence", small, 0.06)
    seen = ("suture", "needle", "--sequence")
    truth = ("--segmentation", "truth")
    assert "no truth to take them from" in refused(capsys, 3, *seen, sequence, *truth, "--out", out)
    assert "needs --disparity" in refused(capsys, 2, *seen, scene, "--estimator", "thesis", "--out", out)
    assert "needs --masks" in refused(capsys, 2, *seen, scene, "--segmentation", "files", "--out", out)
    assert "reports no motion" in refused(capsys, 3, *seen, scene, "--filter", "kinematics", "--out", out)
    assert "no such weight file" in refused(capsys, 5, *seen, scene, "--segmenter", tmp_path / "none", "--out", out)
    simulate = ("suture", "simulate", "--out", out)
    assert "there is no arm 'nobody'" in refused(capsys, 2, *simulate, "--arms", "nobody")
    assert "named twice" in refused(capsys, 2, *simulate, "--arms", "ours", "--arms", "ours")
    assert "no such file" in refused(capsys, 3, *simulate, "--perception", tmp_path / "none.toml")
    (tmp_path / "wrong.toml").write_text("name = 'x'\n")
    line = refused(capsys, 3, *simulate, "--perception", tmp_path / "wrong.toml")
    assert "no perception model (measured: Field required)" in line
    evaluate = ("suture", "evaluate", "--out", out)
    assert "nothing to evaluate" in refused(capsys, 2, *evaluate)
    assert "judged by a scene's truth" in refused(capsys, 2, *evaluate, "--needle", scene)
    assert not out.exists()


def test_a_trial_is_recorded_and_evaluated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "trial")
    words = ("suture", "simulate", "--arms", "sensing_only", "--seed", "4", "--out", out)
    assert "sutures in" in refused(capsys, 4, *words)
    assert run([*words, "--accept", "not_closed", QUIET]) == 0  # up to date
    file = SutureTrialFile.read(tmp_path / "trial" / "trial.json")
    (one,) = file.runs
    assert one.seed == 4 and one.sutures < 6 and file.events[-1].what == f"failed {one.errors[-1]}"
    assert len(one.errors) == len(one.error_seconds) == len(one.error_sutures)
    assert one.error_seconds[-1] == pytest.approx(one.seconds, abs=1e-3)
    motions = payload(load(out), "motions.npz")
    assert np.all(np.diff(motions["seconds"][motions["arm"] == 0]) >= -1e-9)
    assert len(motions["seconds"]) > 2 * KEPT_OF_A_MOTION and np.isfinite(motions["joints"]).mean() > 0.99
    assert run(["suture", "evaluate", "--trials", out, "--out", str(tmp_path / "figures"), QUIET]) == 0
    metrics = MetricsFile.read(tmp_path / "figures" / "metrics.json").metrics
    assert metrics["sensing_only/trials/sutures_to_failure"] == one.sutures


def test_motions_are_carried_to_the_last_frame() -> None:
    random = np.random.default_rng(0)
    steps = [np.eye(4) for _ in range(3)]
    for step in steps:
        step[:3, 3] = random.normal(size=3)
        step[:3, :3] = np.linalg.qr(random.normal(size=(3, 3)))[0]
    to_last = motions_to_last(steps)
    assert len(to_last) == 4 and np.allclose(to_last[-1], np.eye(4))
    for earlier, later, step in zip(to_last[:-1], to_last[1:], steps, strict=True):
        assert np.allclose(earlier @ np.linalg.inv(step), later)


def test_a_thread_that_is_off_by_a_shift_is_off_by_it() -> None:
    true = np.stack([np.linspace(0, 0.1, 200), np.zeros(200), np.full(200, 0.3)], axis=1)
    error = thread_error(true[:100] + [0, 0.001, 0], 0.05, true)
    assert error.median == pytest.approx(0.001, rel=0.01) and error.true_length == pytest.approx(0.1)
    assert error.covered == pytest.approx(0.515, abs=0.02)
    assert np.isnan(thread_error(np.zeros((0, 3)), 0.0, true).median)


def test_tables_are_taken_out_of_markdown() -> None:
    text = "# A\n\n| x | y |\n|---|---|\n| *1* | 2 |\n\nwords\n\n| z |\n|---|\n"
    assert tables_of(text) == (("A", (("x", "y"), ("1", "2"))), ("A", (("z",),)))


def test_pairs_have_the_rig_of_the_calibration(small: Path) -> None:
    with StereoPairs(SutureScene(root=small / "suture_scene")) as pairs:
        assert (pairs.rig.focal, pairs.rig.centre) == (60.0, (15.5, 11.5))
        assert pairs.rig.baseline == pytest.approx(0.06)
        (pair,) = list(pairs)
        assert pair.left.shape == (24, 32, 3) and pair.stamp == 1_000_000_000
