"""A needle followed while pictures arrive, and needles of other radii."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from scenewright.schemas.errors import BadInput
from scenewright.stages.suture import following
from scenewright.stages.suture.following import Follower, growing_pairs, name_of, named_pairs, read_rig
from scenewright.stages.suture.masks import EyeMasks, masks_in
from scenewright.stages.suture.needle.estimate import estimate
from scenewright.stages.suture.needle.estimators import ESTIMATORS
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.needle.radius import as_if_usual, in_metres
from scenewright.stages.suture.pairs import Pair
from scenewright.stages.suture.rig import NEEDLE_RADIUS, TWO_CAMERAS, NeedlePose

from tests.unit.suture.needle_cases import drawn_mask, observed, pose_at

REPOSITORY = Path(__file__).resolve().parents[3]
RIG = {
    "camera": {"width": 1280, "height": 960, "fx": 1600.0, "fy": 1600.0, "cx": 639.5, "cy": 479.5},
    "baseline": TWO_CAMERAS.baseline,
}


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("masks")
    for name in ("000000", "000001", "one"):
        for eye, side in enumerate(("left", "right")):
            mask = drawn_mask(TWO_CAMERAS, pose_at(), eye).astype(np.uint8)
            cv2.imwrite(str(folder / f"{name}_{side}.png"), mask)
    return folder


def arrive(folder: Path, name: str, size: tuple[int, int] = (960, 1280)) -> None:
    for side in ("left", "right"):
        cv2.imwrite(str(folder / f"{name}_{side}.png"), np.zeros((*size, 3), np.uint8))


def test_a_needle_of_half_the_radius_is_half_as_far_between_eyes_half_as_far_apart() -> None:
    seen = observed(pose_at())
    usual = ESTIMATORS["ours"].of_view(replace(seen, disparity=None), 0, None)
    near = replace(TWO_CAMERAS, baseline=TWO_CAMERAS.baseline / 2)
    rig = as_if_usual(near, NEEDLE_RADIUS / 2)
    assert rig.baseline == pytest.approx(TWO_CAMERAS.baseline)
    small = in_metres(ESTIMATORS["ours"].of_view(replace(seen, rig=rig, disparity=None), 0, None), NEEDLE_RADIUS / 2)
    assert usual.pose is not None and small.pose is not None and not small.abstained
    assert small.pose.centre == pytest.approx(usual.pose.centre / 2, abs=1e-6)
    lengths = np.array([0.25] * 3 + [1.0] * 3)
    assert np.diag(small.covariance) == pytest.approx(np.diag(usual.covariance) * lengths, rel=0.1)
    assert as_if_usual(near, NEEDLE_RADIUS) is near and in_metres(usual, NEEDLE_RADIUS) is usual


def test_pairs_are_taken_as_they_arrive_and_whole(tmp_path: Path) -> None:
    def camera() -> None:
        (tmp_path / "a_left.png").write_bytes(b"half")
        time.sleep(0.1)
        arrive(tmp_path, "a")
        time.sleep(0.1)
        arrive(tmp_path, "b")

    thread = threading.Thread(target=camera)
    thread.start()
    names = [files.name for files in growing_pairs(tmp_path, latest=False, idle=1.5)]
    thread.join()
    assert names == ["a", "b"]
    (last,) = growing_pairs(tmp_path, latest=True, idle=0.0)
    assert last.name == "b" and last.skipped == 1
    with pytest.raises(BadInput, match="no folder"):
        next(growing_pairs(tmp_path / "none", latest=False, idle=0.0))


def test_a_pair_becomes_a_line_and_a_broken_picture_an_abstention(masks: Path, tmp_path: Path) -> None:
    arrive(tmp_path, "one")
    arrive(tmp_path, "two", (96, 128))
    follower = Follower(TWO_CAMERAS, masks_in(masks, (960, 1280), name_of), NEEDLE_RADIUS)
    one, two = (follower.line(files) for files in growing_pairs(tmp_path, latest=False, idle=0.0))
    assert one["name"] == "one" and not one["abstained"] and np.array(one["covariance"]).shape == (6, 6)
    assert np.array(one["camera_from_needle"])[:3, 3] == pytest.approx(pose_at().centre, abs=2e-3)
    assert two["camera_from_needle"] is None and "128 x 96" in two["abstained"] and two["frame"] == 1
    assert [files.right.name for files in named_pairs(["a_left.png a_right.png\n"])] == ["a_right.png"]
    with pytest.raises(BadInput, match="line 1 of the pipe"):
        list(named_pairs(["alone.png"]))


def test_with_masks_of_ones_own_a_pair_is_read_once_and_its_pictures_are_not_decoded(
    masks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second pair that is lost near is looked at whole in the masks that were read already."""
    read: list[str] = []
    make = masks_in(masks, (960, 1280), name_of)

    def noted(pair: Any) -> EyeMasks:
        read.append(pair.name)
        return make(pair)

    follower = Follower(TWO_CAMERAS, noted, NEEDLE_RADIUS)
    follower.ready()
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("a picture that nothing is made of was decoded"))
    monkeypatch.setattr(following, "AROUND", -1.0)
    for name in ("000000", "000001"):
        arrive(tmp_path, name)
    lines = [follower.line(files) for files in growing_pairs(tmp_path, latest=False, idle=0.0)]
    assert [line["whole"] for line in lines] == [True, True] and read == ["000000", "000001"]
    assert not any(line["abstained"] for line in lines)


def test_a_pair_that_was_passed_over_takes_its_masks_along(masks: Path, tmp_path: Path) -> None:
    """The first pair that is taken has no masks; those of the one before it, which was skipped, are not its own."""
    for name in ("000000", "000002"):
        arrive(tmp_path, name)
    (files,) = growing_pairs(tmp_path, latest=True, idle=0.0)
    line = Follower(TWO_CAMERAS, masks_in(masks, (960, 1280), name_of), NEEDLE_RADIUS).line(files)
    assert files.skipped == 1 and line["frame"] == 0
    assert line["camera_from_needle"] is None and "000002_left.png" in line["abstained"]


def test_with_an_abstention_comes_no_pose(masks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The estimator's best guess is kept by `suture needle` for looking at; here a robot may act on it."""
    monkeypatch.setattr(
        following, "estimate", lambda *given, **near: replace(estimate(*given, **near), abstained="hardly a needle")
    )
    arrive(tmp_path, "000000")
    (files,) = growing_pairs(tmp_path, latest=False, idle=0.0)
    line = Follower(TWO_CAMERAS, masks_in(masks, (960, 1280), name_of), NEEDLE_RADIUS).line(files)
    assert line["abstained"] == "hardly a needle"
    assert line["camera_from_needle"] is None and line["covariance"] is None


def test_a_needle_is_looked_for_where_it_was_and_everywhere_when_lost(tmp_path: Path) -> None:
    """Of three pairs the needle moves a little before the second and far away before the third."""
    poses = [pose_at()]
    for shift in ([0.002, 0.001, 0.0], [-0.035, 0.02, 0.0]):
        moved = poses[-1].camera_from_needle.copy()
        moved[:3, 3] += shift
        poses.append(NeedlePose(moved))
    looked: list[tuple[int, ...]] = []

    def white_is_needle(pair: Pair) -> EyeMasks:
        looked.append(pair.left.shape[:2])
        eyes = (pair.left[..., 0] > 0, pair.right[..., 0] > 0)
        return EyeMasks(eyes, (np.zeros_like(eyes[0]), np.zeros_like(eyes[1])), (None, None))

    for number, pose in enumerate(poses):
        for eye, side in enumerate(("left", "right")):
            mask = drawn_mask(TWO_CAMERAS, pose, eye)
            gleaming = np.where(mask, 160 + 90 * np.sin(np.arange(mask.shape[1]) / 20.0), 0).astype(np.uint8)
            cv2.imwrite(str(tmp_path / f"{number}_{side}.png"), np.repeat(gleaming[..., None], 3, axis=2))
    follower = Follower(TWO_CAMERAS, white_is_needle, NEEDLE_RADIUS, cuts=True)
    lines = [follower.line(files) for files in growing_pairs(tmp_path, latest=False, idle=0.0)]
    assert [line["whole"] for line in lines] == [True, False, True] and len(looked) == 4
    assert looked[0] == looked[3] == (960, 1280) and looked[1][0] * looked[1][1] < 960 * 1280 / 4
    for line, pose in zip(lines, poses, strict=True):
        assert not line["abstained"]
        assert np.array(line["camera_from_needle"])[:3, 3] == pytest.approx(pose.centre, abs=1e-3)


def test_an_answer_near_that_is_far_from_where_it_was_is_looked_at_whole(
    masks: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few starts may end in another outline of the same masks; it gives itself away by its distance."""

    def astray(*given: object, near: bool = False) -> NeedleEstimate:
        answer = estimate(*given)  # type: ignore[arg-type]
        assert answer.pose is not None
        off = answer.pose.camera_from_needle.copy()
        off[:3, 3] += [0.0, 0.0, 0.008]
        return replace(answer, pose=NeedlePose(off)) if near else answer

    monkeypatch.setattr(following, "estimate", astray)
    for name in ("000000", "000001"):
        arrive(tmp_path, name)
    follower = Follower(TWO_CAMERAS, masks_in(masks, (960, 1280), name_of), NEEDLE_RADIUS)
    lines = [follower.line(files) for files in growing_pairs(tmp_path, latest=False, idle=0.0)]
    assert [line["whole"] for line in lines] == [True, True]
    assert np.array(lines[1]["camera_from_needle"])[:3, 3] == pytest.approx(pose_at().centre, abs=2e-3)


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({}, "camera"),
        (RIG | {"baseline": 0}, "baseline"),
        (RIG | {"needle_radius": 12.0}, "needle_radius"),
        (RIG | {"camera": RIG["camera"] | {"fy": 9.0}}, "square"),  # type: ignore[operator]
    ],
)
def test_a_rig_that_cannot_be_is_refused(told: dict[str, object], said: str, tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text(json.dumps(told))
    with pytest.raises(BadInput, match=said):
        read_rig(tmp_path / "rig.json")


def test_a_rig_may_name_the_needle(tmp_path: Path) -> None:
    for told, radius in (({}, NEEDLE_RADIUS), ({"needle_radius": 0.0085}, 0.0085)):
        (tmp_path / "rig.json").write_text(json.dumps(RIG | told))
        assert read_rig(tmp_path / "rig.json") == (TWO_CAMERAS, radius)


def test_the_command_writes_lines(masks: Path, tmp_path: Path) -> None:
    arrive(tmp_path, "000000")
    (tmp_path / "rig.json").write_text(json.dumps(RIG))
    command = [
        sys.executable,
        "-m",
        "scenewright",
        "suture",
        "follow",
        str(tmp_path),
        "--rig",
        str(tmp_path / "rig.json"),
    ]
    done = subprocess.run(
        [*command, "--masks", str(masks), "--idle", "0"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    assert json.loads(line)["tip_probability"] >= 0.5
