"""The recipe of the small network: samples whose disparities are exact, a loss in closed form, runs that go on."""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from scenewright.schemas.errors import BadInput
from scenewright.schemas.places import HOME
from scenewright.stages.disparity.raft.architecture import SMALL
from scenewright.stages.disparity.raft.checkpoint import load_network
from scenewright.stages.disparity.raft.matching import moved_right, open_raft
from scenewright.stages.disparity.raft.network import RaftStereo
from scenewright.stages.disparity.training.raft_stereo.crops import (
    HEIGHT,
    WIDTH,
    Sample,
    counted,
    kept_sample,
    shapes_sample,
)
from scenewright.stages.disparity.training.raft_stereo.kept_pairs import NEEDLE, KeptPair, keep, kept, stems
from scenewright.stages.disparity.training.raft_stereo.shapes import shapes_pair, texture_bank
from scenewright.stages.disparity.training.raft_stereo.train import FILE, Plan, Run, Sources, loss_of, tensors_of
from scenewright.stages.suture.world import tubes

from tests.unit.disparity.pairs import pair

PLAN = Plan(steps=4, shapes=1, rooms=0, needles=0, updates=2, seed=3, pairs=0)


@pytest.fixture(scope="module")
def bank() -> list[np.ndarray]:
    return texture_bank(0, 10)


def test_shapes_are_where_their_disparity_says(bank: list[np.ndarray]) -> None:
    columns, rows = np.meshgrid(np.arange(256, dtype=np.float32), np.arange(128, dtype=np.float32))
    same = []
    for seed in range(8):
        left, right, disparity = shapes_pair(bank, np.random.default_rng(seed), 128, 256)
        assert np.isfinite(disparity).all() and disparity.min() > 0
        back = cv2.remap(right, (columns - disparity).astype(np.float32), rows, cv2.INTER_LINEAR)
        seen = columns - disparity > 2
        same.append(np.mean(np.abs(back - left).max(axis=2)[seen] < 8))
    assert np.mean(same) > 0.75  # the rest is hidden from the right eye, or an edge
    again = shapes_pair(bank, np.random.default_rng(7), 128, 256)
    np.testing.assert_array_equal(again[2], disparity)


def test_a_crop_of_a_kept_pair_keeps_its_disparities_true() -> None:
    random = np.random.default_rng(0)
    wide = cv2.GaussianBlur(random.uniform(0, 255, (300, 900, 3)).astype(np.float32), (0, 0), 3)
    wide = ((wide - wide.min()) / np.ptp(wide) * 255).astype(np.uint8)
    pair = KeptPair(
        wide[:, :700], wide[:, 150:850], np.full((300, 700), 150.0, np.float32), np.zeros((300, 700), np.uint8)
    )
    for seed in range(4):  # x_right = x_left - 150
        left, right, disparity = kept_sample(pair, np.random.default_rng(seed))
        assert left.shape == right.shape == (HEIGHT, WIDTH, 3) and left.dtype == np.uint8
        found = disparity[np.isfinite(disparity)]
        assert len(found) and np.ptp(found) == 0
        shift = round(float(found[0]))
        gray = [one.mean(axis=2) for one in (left, right)]
        inner = [gray[0][10:-10, shift + 10 : -10], gray[1][10:-10, 10 : WIDTH - shift - 10]]
        assert np.corrcoef(inner[0].ravel(), inner[1].ravel())[0, 1] > 0.8


def test_disparities_out_of_reach_do_not_count() -> None:
    row = np.full((1, 600), 5.0, np.float32)
    row[0, [10, 20, 599]] = 0.2, np.nan, 500.0
    assert np.isnan(counted(row)).nonzero()[1].tolist() == [0, 1, 2, 3, 4, 10, 20, 599]


def test_kept_pairs_come_back(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    left, right = (random.integers(0, 255, (6, 8, 3), np.uint8) for _ in range(2))
    disparity = np.array([[300.25, np.nan] * 4] * 6, np.float32)
    keep(tmp_path / "needle_00001", KeptPair(left, right, disparity, np.ones((6, 8), np.uint8)))
    found = kept(tmp_path / "needle_00001")
    np.testing.assert_array_equal(found.left, left)
    np.testing.assert_array_equal(found.right, right)
    np.testing.assert_array_equal(found.disparity, disparity)
    (tmp_path / "needle_00001_right.png").write_bytes(b"")
    with pytest.raises(BadInput, match="cannot be read"):
        kept(tmp_path / "needle_00001")


def test_the_loss_is_a_weighted_mean_of_distances() -> None:
    truth = torch.full((1, 16, 16), 8.0)
    truth[0, :, 8:] = torch.nan
    full, coarse = torch.full((1, 16, 16), 9.0), [torch.full((1, 2, 2), 0.5), torch.full((1, 2, 2), 1.25)]
    expected = (1.0 + 0.85**2 * 4.0 + 0.85 * 2.0) / (1 + 0.85**2 + 0.85)
    assert loss_of(full, coarse, truth).item() == pytest.approx(expected)


def test_several_pairs_at_once_give_what_each_gives_alone() -> None:
    torch.manual_seed(0)
    network = RaftStereo(SMALL).eval()
    left, right = torch.rand(2, 3, 64, 96) * 255, torch.rand(2, 3, 64, 96) * 255
    with torch.no_grad():
        both, coarse = network.updates(left, right, 3)
    assert both.shape == (2, 64, 96) and len(coarse) == 3 and coarse[0].shape == (2, 16, 24)
    for number in range(2):
        torch.testing.assert_close(both[number], network(left[number], right[number], 3), atol=1e-4, rtol=1e-4)


def test_a_moved_right_eye_has_smaller_disparities() -> None:
    picture = np.arange(24, dtype=np.uint8).reshape(1, 8, 3)
    moved = moved_right(picture, 3)
    assert moved.shape == picture.shape and moved_right(picture, 0) is picture
    np.testing.assert_array_equal(moved[:, 3:], picture[:, :5])
    assert moved_right(picture, 99).shape == picture.shape


class OnlyShapes(Sources):
    """Samples without rendered pairs."""

    def __init__(self, bank: list[np.ndarray]) -> None:
        self.bank = bank

    def samples(self, plan: Plan, step: int) -> list[Sample]:
        return [shapes_sample(self.bank, np.random.default_rng([plan.seed, step]))]


@pytest.mark.slow
def test_a_stopped_run_ends_with_the_bytes_of_one_that_was_not(tmp_path: Path, bank: list[np.ndarray]) -> None:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    sources = OnlyShapes(bank)
    whole = Run(PLAN, tmp_path / "whole")
    for _ in range(PLAN.steps):
        whole.train_step(sources)
    whole.save()
    first = Run(PLAN, tmp_path / "stopped")
    for _ in range(2):
        first.train_step(sources)
    first.save()
    second = Run(PLAN, tmp_path / "stopped")
    assert second.step == 2
    for _ in range(2):
        second.train_step(sources)
    second.save()
    torch.set_num_threads(threads)
    assert (tmp_path / "whole" / FILE).read_bytes() == (tmp_path / "stopped" / FILE).read_bytes()
    assert load_network(tmp_path / "whole" / FILE).sizes == SMALL
    with pytest.raises(BadInput, match="another plan"):
        Run(Plan(steps=9, shapes=1, rooms=0, needles=0, updates=2, seed=3, pairs=0), tmp_path / "stopped")


def test_samples_are_those_of_their_step(bank: list[np.ndarray]) -> None:
    first, second = (tensors_of(OnlyShapes(bank).samples(PLAN, step)) for step in (0, 0))
    other = tensors_of(OnlyShapes(bank).samples(PLAN, 1))
    assert torch.equal(first[0], second[0]) and not torch.equal(first[0], other[0])
    assert first[0].shape == (1, 3, HEIGHT, WIDTH) and first[2].shape == (1, HEIGHT, WIDTH)


def test_the_checkpoint_that_comes_with_it_is_the_one_its_record_describes() -> None:
    path = HOME / "data" / "disparity" / "raft_stereo_small.safetensors"
    facts = tomllib.loads(path.with_suffix(".toml").read_text())
    assert hashlib.sha256(path.read_bytes()).hexdigest() == facts["sha256"]
    network = load_network(path)
    assert network.sizes == SMALL and path.stat().st_size < 5e6
    assert sum(parameter.numel() for parameter in network.parameters()) == facts["parameters"]


def test_the_checkpoint_that_comes_with_it_finds_a_wall() -> None:
    left, right, truth, seen = pair()
    matcher, detail = open_raft(HOME / "data" / "disparity" / "raft_stereo_small.safetensors", None, 1.0, "cpu")
    found = matcher(left, right, (0, 48))
    error = np.abs(found.disparity - truth)[found.known & seen]
    assert "5 updates at 1/4" in detail and found.known.mean() > 0.6
    assert np.median(error) < 0.5 and np.mean(error > 2) < 0.1


def test_kept_pairs_are_found_by_kind_in_their_order(tmp_path: Path) -> None:
    assert NEEDLE == tubes.NEEDLE, "pairs of the needle world keep its bodies"
    with pytest.raises(BadInput, match="no kept pairs of room"):
        stems(tmp_path, "room")
    blank = np.zeros((4, 6, 3), np.uint8)
    for name in ("needle_00002", "endoscope_00001", "needle_00001"):
        keep(tmp_path / name, KeptPair(blank, blank, np.ones((4, 6), np.float32), blank[..., 0]))
    found = [stem.name for stem in stems(tmp_path, "needle", "endoscope")]
    assert found == ["needle_00001", "needle_00002", "endoscope_00001"]
