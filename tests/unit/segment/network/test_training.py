"""The recipe in small: stored frames come back, changed samples keep image and targets together, and a run that was
stopped ends with the bytes of one that was not."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.training.run import rate_at
from scenewright.stages.segment.backends.network.features import CHANNELS, Mount, features
from scenewright.stages.segment.backends.network.model import Widths
from scenewright.stages.segment.training.network.drawing import drawn
from scenewright.stages.segment.training.network.drawn_colors import compressed
from scenewright.stages.segment.training.network.drawn_features import CameraBatch, MountBatch, features_of
from scenewright.stages.segment.training.network.drawn_targets import targets_of
from scenewright.stages.segment.training.network.samples import LABELS, FrameSet, Store, as_sample
from scenewright.stages.segment.training.network.shards import DEPTH_UNIT, HEIGHT, WIDTH, Sample, write_shard
from scenewright.stages.segment.training.network.targets import IGNORED, make_targets
from scenewright.stages.segment.training.network.train import PEAK_RATE, WARM_UP, Clock, Feed, Plan, Run, class_weights

TINY = Widths(encoder=(4, 4, 4, 6, 6), decoder=(4, 4, 4, 6), blocks=1)
CAMERA = Camera(width=WIDTH, height=HEIGHT, fx=260.0, fy=260.0, cx=159.5, cy=119.5)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> FrameSet:
    folder = tmp_path_factory.mktemp("frames")
    samples = []
    for k in range(4):
        label = np.ones((HEIGHT, WIDTH), dtype=np.uint8)
        label[100:200, 40 + 10 * k : 140] = 2
        depth = np.where(label == 2, 1.0, 2.5) / DEPTH_UNIT
        # The colour says which label a pixel has.
        color = np.repeat((100 * label)[..., None], 3, axis=2)
        samples.append(
            Sample(
                color, depth.astype(np.uint16), label, CAMERA, np.array([0.0, -1.0, 0.0]), 1.5, ("wall", "chair"), ""
            )
        )
    write_shard(samples, folder / "shard_000")
    return FrameSet(folder)


def test_stored_frames_come_back(frames: FrameSet) -> None:
    frame = frames[1]
    assert len(frames) == 4 and frames.class_names() == ("wall", "chair")
    assert frame.depth[150, 100] == pytest.approx(1.0) and frame.camera == CAMERA and frame.height == 1.5
    with pytest.raises(BadInput, match="no frames"):
        FrameSet(Path("/nowhere"))


def test_targets_in_closed_form() -> None:
    labels = np.zeros((20, 30), dtype=np.int64)
    labels[5:10, 4:9], labels[12:, :] = 1, 2
    labels[0, 20:25] = 3
    targets = make_targets(labels, np.array([IGNORED, 0, 1, IGNORED]), np.array([False, True, False, True]))
    assert targets.centres[7, 6] == 1 and targets.centres[5:10].argmax() == 2 * 30 + 6
    assert targets.offsets[:, 5, 4].tolist() == [2, 2] and targets.offsets[:, 9, 8].tolist() == [-2, -2]
    assert targets.classes[0, 0] == IGNORED and targets.classes[15, 3] == 1 and targets.classes[6, 6] == 0
    assert np.array_equal(targets.things, (labels == 1) | (labels == 3))
    # A thing without a name teaches where it ends; of what nobody outlined nothing is known.
    assert targets.classes[0, 22] == IGNORED and targets.offsets[:, 0, 20].tolist() == [0, 2]
    assert np.array_equal(targets.told, labels > 0)
    assert targets.weight[6, 6] == 3 and targets.weight[15, 3] == 1


@pytest.mark.parametrize("whole", [False, True])
def test_what_is_changed_stays_together(frames: FrameSet, whole: bool) -> None:
    """In every crop and mirror image the near pixels are those of the chair."""
    store, seen = Store([frames], frames.class_names(), "cpu"), 0
    inputs, targets = drawn(store.frames([(0, 0)] * 8), np.random.default_rng(3), whole=whole)
    assert inputs.shape[1:] == (len(CHANNELS), *((240, 320) if whole else (192, 256)))
    for shown, classes in zip(inputs.numpy(), targets.classes.numpy(), strict=True):
        near = shown[CHANNELS.index("inverse_depth")][::2, ::2] > 0.2
        if not np.all(shown[CHANNELS.index("has_depth")] > 0):
            continue  # the background was cut
        seen += 1
        assert np.mean(near == (classes == 1)) > 0.97
        if shown[CHANNELS.index("has_color")].all():
            red = shown[CHANNELS.index("red")][::2, ::2]
            assert red[classes == 1].mean() > red[classes == 0].mean()
    assert seen >= 3


@pytest.mark.parametrize("told", [True, False])
def test_a_batch_is_shown_as_single_frames_are(told: bool) -> None:
    """Against the network's own inputs, on a noisy slope with holes and a step."""
    random = np.random.default_rng(8)
    depth = (
        np.linspace(0.8, 3.0, WIDTH, dtype=np.float32)[None] * np.linspace(1.0, 1.4, HEIGHT, dtype=np.float32)[:, None]
    )
    depth[60:120, 100:180] *= 0.6
    depth = np.where(random.random(depth.shape) < 0.03, 0, depth * random.normal(1, 0.004, depth.shape)).astype(
        np.float32
    )
    color = random.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    up = np.array([0.1, -0.9, -0.3])
    wanted = features(depth, color if told else None, CAMERA, Mount(up / np.linalg.norm(up), 1.2) if told else Mount())
    flag = torch.tensor([told])
    given = [torch.from_numpy(array)[None] for array in (depth, color.transpose(2, 0, 1).astype(np.float32))]
    cameras = CameraBatch(*(torch.tensor([getattr(CAMERA, name)]) for name in ("fx", "fy", "cx", "cy")))
    mounts = MountBatch(torch.tensor(up[None], dtype=torch.float32), torch.tensor([1.2]), flag, flag)
    found = features_of(*given, flag, cameras, mounts)[0].numpy()
    normals = slice(CHANNELS.index("normal_right"), CHANNELS.index("normal_forward") + 1)
    assert np.quantile(np.abs(found[normals] - wanted[normals]), 0.999) < 1e-3
    others = [k for k, name in enumerate(CHANNELS) if not name.startswith("normal")]
    assert np.abs(found[others] - wanted[others]).max() < 1e-5


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_targets_of_a_batch_are_those_of_single_images(seed: int) -> None:
    random = np.random.default_rng(seed)
    labels = np.zeros((2, 24, 36), np.int64)
    for image in labels:
        for label in range(1, 7):
            top, left = random.integers(0, 20), random.integers(0, 30)
            image[top : top + random.integers(1, 15), left : left + random.integers(1, 20)] = label
    tables = random.integers(0, 3, (2, LABELS)), random.random((2, LABELS)) < 0.6
    tables[0][:, [0, 3]] = IGNORED
    tables[1][:, 0] = False
    found = targets_of(*(torch.from_numpy(array) for array in (labels, *tables)))
    for k in range(2):
        wanted = make_targets(labels[k], tables[0][k], tables[1][k])
        for name in ("classes", "weight", "centres", "offsets", "things", "told"):
            np.testing.assert_allclose(getattr(found, name)[k].numpy(), getattr(wanted, name), atol=1e-5)


@pytest.mark.parametrize("quality", [25, 60, 90])
def test_compression_is_nearly_that_of_a_library(quality: int) -> None:
    random = np.random.default_rng(quality)
    coarse = random.integers(0, 256, (12, 16, 3)).astype(np.uint8)
    picture = cv2.resize(coarse, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    encoded = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    wanted = np.asarray(cv2.imdecode(encoded, cv2.IMREAD_COLOR))[..., ::-1].astype(np.float32)
    given = torch.from_numpy(picture.transpose(2, 0, 1).astype(np.float32))[None]
    found = compressed(given, torch.tensor([float(quality)]))[0].numpy().transpose(1, 2, 0)
    assert np.abs(found - wanted).mean() < 0.25 * np.abs(wanted - picture).mean() + 0.5


def test_as_it_is_nothing_is_changed(frames: FrameSet) -> None:
    inputs, targets = as_sample(frames[2], frames.class_names(), color=True, gravity=True)
    assert np.array_equal(targets.classes == 1, frames[2].labels[::2, ::2] == 2)
    assert inputs[CHANNELS.index("red")][0, 0] == pytest.approx(100 / 127.5 - 1)


def test_the_rate_rises_and_falls() -> None:
    rates = [rate_at(step, 200, PEAK_RATE, WARM_UP) for step in range(200)]
    top = int(np.argmax(rates))
    assert rates[:top] == sorted(rates[:top]) and rates[top:] == sorted(rates[top:], reverse=True)
    assert rates[-1] < 0.02 * rates[top]


def test_a_stopped_run_ends_like_one_that_was_not(frames: FrameSet, tmp_path: Path) -> None:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        plan = Plan(4, 2, 5, frames.class_names())
        weight = class_weights(frames, plan.classes)
        feed = Feed(frames, None, plan)

        def steps(run: Run, number: int) -> None:
            for _ in range(number):
                run.train_step(feed(run.step, False), weight, run.step / plan.steps)

        straight = Run(plan, tmp_path / "straight", TINY)
        steps(straight, 4)
        straight.save()
        first = Run(plan, tmp_path / "stopped", TINY)
        steps(first, 2)
        first.save()
        second = Run(plan, tmp_path / "stopped", TINY)
        assert second.step == 2
        steps(second, 2)
        second.save()
        for name in ("panoptic.safetensors", "state.safetensors"):
            assert (tmp_path / "straight" / name).read_bytes() == (tmp_path / "stopped" / name).read_bytes()
        with pytest.raises(BadInput, match="another plan"):
            Run(Plan(9, 2, 5, plan.classes), tmp_path / "stopped", TINY)
    finally:
        torch.set_num_threads(threads)


def test_frames_that_are_written_meanwhile_are_taken(frames: FrameSet, tmp_path: Path) -> None:
    for shard in ("shard_000", "shard_001"):
        shutil.copytree(frames.folder / "shard_000", tmp_path / shard)
    (tmp_path / "shard_001" / "frames.json").rename(tmp_path / "rows.json")
    growing = FrameSet(tmp_path)
    store = Store([growing], growing.class_names(), "cpu")
    assert len(growing) == 4
    (tmp_path / "rows.json").rename(tmp_path / "shard_001" / "frames.json")
    store.grow()
    assert len(growing) == 8 and torch.equal(store.frames([(0, 7)]).color, store.frames([(0, 3)]).color)


def test_real_frames_are_a_share_of_a_batch(frames: FrameSet, monkeypatch: pytest.MonkeyPatch) -> None:
    feed = Feed(frames, frames, Plan(4, 400, 5, frames.class_names(), len(frames)))
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(feed.store, "frames", lambda chosen: asked.extend(chosen) or {}["enough"])
    with pytest.raises(KeyError, match="enough"):
        feed(1, False)
    assert 10 < sum(which for which, _ in asked) < 60


def test_the_clock_ends_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("scenewright.stages.segment.training.network.train.time.monotonic", lambda: now[0])
    clock = Clock(10, 60.0)
    assert clock.progress(3) == pytest.approx(0.3)
    now[0] = 157.0
    assert clock.progress(3) == pytest.approx(0.95)
    now[0] = 400.0
    assert clock.progress(3) == 1.0
