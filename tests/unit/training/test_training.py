"""The recipe in small: stored frames come back, changed samples keep image and targets together, and a run that was
stopped ends with the bytes of one that was not."""

from __future__ import annotations

import operator
from pathlib import Path

import numpy as np
import pytest
import torch

from benchmarks.training.data import DEPTH_UNIT, HEIGHT, WIDTH, Sample, papered, write_shard
from benchmarks.training.feeding import fed
from benchmarks.training.run import rate_at
from benchmarks.training.samples import FrameSet, as_sample, varied
from benchmarks.training.sensors import coarse_depth, lose_things
from benchmarks.training.shapes import MAKERS, SMALL_MAKERS, Maker
from benchmarks.training.targets import IGNORED, make_targets
from benchmarks.training.train import PEAK_RATE, WARM_UP, Clock, Feed, Plan, Run, class_weights
from schemas.errors import BadInput
from schemas.scene_parts import Camera
from schemas.vocabulary import load_vocabulary
from stages.segment.backends.network.features import CHANNELS
from stages.segment.backends.network.model import Widths

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
    seen = 0
    for seed in range(8):
        inputs, targets = varied(frames[0], frames.class_names(), np.random.default_rng(seed), whole=whole)
        assert inputs.shape[0] == len(CHANNELS) and inputs.shape[1:] == ((240, 320) if whole else (192, 256))
        near = inputs[CHANNELS.index("inverse_depth")][::2, ::2] > 0.2
        known = inputs[CHANNELS.index("has_depth")][::2, ::2] > 0
        if not known.all():
            continue  # the background was cut
        seen += 1
        assert np.mean(near == (targets.classes == 1)) > 0.97
    assert seen >= 3


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
        plan = Plan(4, 2, 5, frames.class_names(), len(frames))
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
            Run(Plan(9, 2, 5, plan.classes, plan.frames), tmp_path / "stopped", TINY)
    finally:
        torch.set_num_threads(threads)


@pytest.mark.parametrize("workers", [0, 2])
def test_batches_come_in_the_order_they_were_asked_for(workers: int) -> None:
    assert list(fed(operator.sub, ((k, 3) for k in range(20)), workers)) == [k - 3 for k in range(20)]


def test_another_process_reads_the_same_frames(frames: FrameSet) -> None:
    (again,) = fed(operator.getitem, [(frames, 2)], 1)
    assert np.array_equal(again.color, frames[2].color)


def test_real_frames_are_a_share_of_a_batch(frames: FrameSet) -> None:
    plan = Plan(4, 2, 5, frames.class_names(), len(frames), len(frames))
    assert np.array_equal(Feed(frames, frames, plan)(1, False).classes, Feed(frames, frames, plan)(1, False).classes)


def test_the_clock_ends_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("benchmarks.training.train.time.monotonic", lambda: now[0])
    clock = Clock(10, 60.0)
    assert clock.progress(3) == pytest.approx(0.3)
    now[0] = 157.0
    assert clock.progress(3) == pytest.approx(0.95) and list(clock.orders(8)) == [(8, True), (9, True)]
    now[0] = 400.0
    assert clock.progress(3) == 1.0


@pytest.mark.parametrize("maker", {(m.class_name, m.make.__name__): m for m in (*MAKERS, *SMALL_MAKERS)}.values())
def test_every_shape_is_of_a_class_and_can_be_drawn(maker: Maker) -> None:
    assert load_vocabulary().by_name(maker.class_name)
    for seed in range(5):
        mesh = maker.make(np.random.default_rng(seed))
        assert np.isfinite(mesh.vertices).all() and 0.01 < np.ptp(mesh.bounds, axis=0).max() < 7.0
        again = maker.make(np.random.default_rng(seed))
        assert np.array_equal(mesh.vertices, again.vertices)


def test_prints_change_colours_of_things_alone() -> None:
    instance = np.zeros((HEIGHT, WIDTH), np.int32)
    instance[50:150, 60:200] = 4
    color = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    printed = papered(color, instance, np.random.default_rng(2))
    assert np.array_equal(printed[instance == 0], color[instance == 0]) and printed[instance == 4].std() > 5


def test_other_sensors_lose_depth_and_never_invent_much() -> None:
    true = np.full((HEIGHT, WIDTH), 2.0, np.float32)
    true[:, 160:] = 1.2
    instance = np.where(true < 1.5, 2, 1)
    for seed in range(12):
        random = np.random.default_rng(seed)
        seen = coarse_depth(true, random)
        assert seen.shape == true.shape and np.all((seen == 0) | ((seen > 1.1) & (seen < 2.1)))
        lost = lose_things(true, instance, random)
        assert np.all((lost == 0) | (lost == true))
