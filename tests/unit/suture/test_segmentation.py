"""The network of needle and thread: what it takes and gives, its checkpoint, and that training repeats itself."""

from __future__ import annotations

import hashlib
import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.safetensors_file import read_safetensors, write_safetensors
from scenewright.stages.suture.segmentation.checkpoint import BUNDLED, load_network, save_network
from scenewright.stages.suture.segmentation.infer import Segmenter, without_specks
from scenewright.stages.suture.segmentation.model import SutureNetwork
from scenewright.stages.suture.training.network import samples as segmentation_samples
from scenewright.stages.suture.training.network.samples import CROP, Views, _cluttered, masks_of, sample
from scenewright.stages.suture.training.network.train import Plan, Run, loss_of
from scenewright.stages.suture.world.render import render
from scenewright.stages.suture.world.sampling import seen_scene
from scenewright.stages.suture.world.tubes import LEFT_DRIVER, NEEDLE, THREAD

SMALL = (4, 4, 8, 8, 8)


@pytest.fixture(scope="module")
def segmenter() -> Segmenter:
    torch.manual_seed(3)
    return Segmenter(SutureNetwork(SMALL).eval(), "untrained")


def picture(rows: int = 220, columns: int = 260) -> tuple[np.ndarray, np.ndarray]:
    """Return a picture like a rendered one and its bodies: a bright arc, a violet line, on pad colour."""
    random = np.random.default_rng(0)
    image = np.full((rows, columns, 3), (190, 150, 130), dtype=np.uint8)
    bodies = np.zeros((rows, columns), dtype=np.uint8)
    for body, colour, draw in (
        (THREAD, (105, 60, 125), lambda to, value: cv2.line(to, (20, 200), (240, 60), value, 2)),
        (NEEDLE, (200, 200, 205), lambda to, value: cv2.ellipse(to, (120, 90), (50, 40), 0, 180, 360, value, 4)),
    ):
        draw(image, colour)
        draw(bodies, body)
    noisy = image + random.normal(0.0, 3.0, image.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8), bodies


def stem_with_views(folder: Path) -> Path:
    image, bodies = picture()
    stem = folder / "cameras_00000"
    for eye in ("left", "right"):
        cv2.imwrite(str(folder / f"{stem.name}_{eye}_rgb.png"), image[..., ::-1])
        cv2.imwrite(str(folder / f"{stem.name}_{eye}_bodies.png"), bodies)
    return stem


@pytest.mark.parametrize("size", [(32, 64), (47, 70)])
def test_probabilities_have_the_pictures_size_and_do_not_depend_on_threads(segmenter, size):
    image = np.random.default_rng(1).integers(0, 255, (*size, 3), dtype=np.uint8)
    before = torch.get_num_threads()
    one = segmenter.probabilities(image)
    torch.set_num_threads(2)
    try:
        other = segmenter.probabilities(image)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert one.shape == (3, *size) and one.dtype == np.float32
    assert one.min() >= 0.0 and one.max() <= 1.0
    assert np.array_equal(one, other)


def test_what_is_no_picture_is_refused(segmenter):
    for wrong in (np.zeros((8, 8), np.uint8), np.zeros((8, 8, 3), np.float32), np.zeros((0, 8, 3), np.uint8)):
        with pytest.raises(BadInput, match="8 bits"):
            segmenter.masks(wrong)


def test_specks_are_taken_out_and_pieces_stay():
    mask = np.zeros((20, 20), dtype=bool)
    mask[2, 2:4] = True
    mask[8:14, 8:14] = True
    kept = without_specks(mask, 8)
    assert kept.sum() == 36 and not kept[2].any()
    assert not without_specks(np.zeros((5, 5), dtype=bool), 8).any()


def test_a_checkpoint_comes_back_as_it_was_to_half_precision(tmp_path, segmenter):
    file = tmp_path / "network.safetensors"
    save_network(file, segmenter.network, "a test")
    again = Segmenter.load(file)
    assert again.description == "a test"
    image = np.random.default_rng(2).integers(0, 255, (64, 64, 3), dtype=np.uint8)
    assert np.abs(again.probabilities(image) - segmenter.probabilities(image)).max() < 5e-3


def test_foreign_and_damaged_checkpoints_are_refused(tmp_path, segmenter):
    file = tmp_path / "network.safetensors"
    save_network(file, segmenter.network, "a test")
    tensors, facts = read_safetensors(file)
    wrong = tmp_path / "wrong.safetensors"
    first = sorted(tensors)[0]
    for changed, metadata, words in (
        (tensors, facts | {"format": "another"}, "no checkpoint"),
        (tensors, facts | {"version": "99"}, "version '99'"),
        (tensors, facts | {"widths": "[1e9]"}, "does not describe"),
        (tensors, facts | {"widths": "[4, 4, 8, 8, 100000]"}, "does not describe"),
        ({name: array for name, array in tensors.items() if name != first}, facts, first),
        (tensors | {first: tensors[first] * np.float16(np.nan)}, facts, "not finite"),
    ):
        write_safetensors(wrong, changed, metadata)
        with pytest.raises(BadInput, match=words):
            load_network(wrong)
    wrong.write_bytes(file.read_bytes()[:-7])
    with pytest.raises(BadInput):
        load_network(wrong)


def test_the_bundled_network_is_the_one_described_and_finds_needle_and_thread():
    facts = tomllib.loads(BUNDLED.with_suffix(".toml").read_text())
    assert hashlib.sha256(BUNDLED.read_bytes()).hexdigest() == facts["sha256"]
    assert BUNDLED.stat().st_size < 3_000_000
    eye = render(seen_scene(461)[0]).left
    assert eye.image is not None
    found = Segmenter.load().masks(eye.image)
    for mask, body in ((found.needle, NEEDLE), (found.thread, THREAD)):
        true = eye.bodies == body
        assert (mask & true).sum() > 0.6 * true.sum()
        assert (mask & true).sum() > 0.4 * (mask | true).sum()


def test_to_the_bundled_network_an_evenly_bright_arc_is_a_highlight():
    image, bodies = picture()
    found = Segmenter.load().masks(image)
    assert (found.needle & (bodies == NEEDLE)).sum() < 0.3 * (bodies == NEEDLE).sum()
    assert not found.driver.any()


def test_samples_repeat_themselves_and_keep_masks_and_picture_together():
    image, bodies = picture()
    one, masks = sample(image, bodies, np.random.default_rng([4, 1]))
    other, _ = sample(image, bodies, np.random.default_rng([4, 1]))
    assert np.array_equal(one, other)
    assert one.shape == (CROP, CROP, 3) and masks.shape == (3, CROP, CROP)
    assert masks.min() >= 0.0 and masks.max() <= 1.0
    whole = masks_of(bodies)
    assert whole[0].sum() == (bodies == NEEDLE).sum() and whole[1].sum() == (bodies == THREAD).sum()
    # needle, thread and pad keep their different looks in most samples
    differences = []
    for number in range(6):
        crop, targets = sample(image, bodies, np.random.default_rng(number))
        if (targets[1] > 0.9).sum() > 30:
            grey = crop.astype(float).mean(axis=2)
            differences.append(abs(grey[targets[1] > 0.9].mean() - grey[targets.max(axis=0) == 0].mean()))
    assert np.median(differences) > 8.0


def test_highlights_are_no_needle_and_what_they_hide_is_none(monkeypatch):
    """A bright arc over everything brings no mask, and takes the mask of what lies under it."""
    image, masks = np.full((CROP, CROP, 3), 0.4, np.float32), np.zeros((3, CROP, CROP), np.float32)
    masks[0, 90:100] = 1.0
    random = np.random.default_rng(3)
    changed, kept = _cluttered(image, masks, random)
    assert (kept[1:] == 0.0).all() and (kept[0] <= masks[0]).all() and changed.max() > image.max() + 0.1
    monkeypatch.setattr(segmentation_samples, "_highlight", lambda _: np.ones((CROP, CROP)))
    hidden = min(_cluttered(image, masks, np.random.default_rng(seed))[1].sum() for seed in range(4))
    assert hidden == 0.0


def test_a_share_of_the_crops_is_about_needles_before_jaws():
    """Of two stretches of needle, far from each other, one touches a driver."""
    image, bodies = np.full((800, 800, 3), 128, np.uint8), np.zeros((800, 800), np.uint8)
    bodies[100:140, 100:104] = bodies[700:740, 700:704] = NEEDLE
    bodies[100:140, 104:120] = LEFT_DRIVER

    def held(before_jaws: float) -> int:
        crops = (sample(image, bodies, np.random.default_rng(seed), 0.75, before_jaws)[1] for seed in range(16))
        return sum(bool((masks[2] > 0.5).any()) for masks in crops)

    assert held(1.0) > held(0.0) + 2


def test_the_loss_is_small_for_the_truth_only():
    targets = (torch.rand(2, 3, 16, 16, generator=torch.Generator().manual_seed(1)) < 0.2).float()
    weights = (1.0, 1.0, 0.3)
    right, wrong = (loss_of(logits, targets, weights) for logits in ((targets - 0.5) * 30, (0.5 - targets) * 30))
    assert float(right) < 0.05 < 3.0 < float(wrong)


def test_a_training_that_was_stopped_ends_with_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.setattr("scenewright.stages.suture.training.network.train.SutureNetwork", lambda: SutureNetwork(SMALL))
    monkeypatch.setattr("scenewright.stages.suture.training.network.samples.CROP", 64)
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        views = Views([stem_with_views(tmp_path)])
        plan = Plan(steps=2, batch=2, seed=0, pictures=len(views))
        straight = Run(plan, tmp_path / "straight")
        for _ in range(2):
            straight.train_step(views)
        straight.save()
        stopped = Run(plan, tmp_path / "stopped")
        stopped.train_step(views)
        stopped.save()
        again = Run(plan, tmp_path / "stopped")
        assert again.step == 1
        again.train_step(views)
        again.save()
    finally:
        torch.set_num_threads(before)
    files = [tmp_path / name / "segmentation.safetensors" for name in ("straight", "stopped")]
    assert files[0].read_bytes() == files[1].read_bytes()
    with pytest.raises(BadInput, match="another plan"):
        Run(Plan(steps=4, batch=2, seed=0, pictures=len(views)), tmp_path / "stopped")
