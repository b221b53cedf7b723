"""Detector post-processing against a second, slow implementation; the real detector where its weights are."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.errors import BadInput
from scenewright.stages.segment.backends.detector.yolox import Detector, decode, letterbox, tile_windows
from scenewright.stages.segment.coco import COCO_NAMES
from scenewright.stages.segment.suppression import overlap_of_boxes, suppress

from tests.real_data import real_data


def decode_slowly(raw: np.ndarray, size: int) -> tuple[list[list[float]], list[list[float]]]:
    """The definition, cell by cell."""
    boxes, scores, row = [], [], 0
    for stride in (8, 16, 32):
        for v in range(size // stride):
            for u in range(size // stride):
                x, y = (raw[row, 0] + u) * stride, (raw[row, 1] + v) * stride
                w, h = np.exp(raw[row, 2]) * stride, np.exp(raw[row, 3]) * stride
                boxes.append([x - w / 2, y - h / 2, x + w / 2, y + h / 2])
                scores.append([raw[row, 4] * s for s in raw[row, 5:]])
                row += 1
    return boxes, scores


def test_decoding_matches_the_definition() -> None:
    random = np.random.default_rng(0)
    size = 64
    rows = sum((size // stride) ** 2 for stride in (8, 16, 32))
    raw = random.uniform(-1, 1, (rows, 5 + 3)).astype(np.float32)
    boxes, scores = decode(raw, size)
    slow_boxes, slow_scores = decode_slowly(raw, size)
    assert np.allclose(boxes, slow_boxes, atol=1e-3) and np.allclose(scores, slow_scores, atol=1e-6)
    wild = raw.copy()
    wild[:, 2:4] = 1e4
    assert np.isfinite(decode(wild, size)[0]).all()


def test_letterbox_keeps_the_aspect_and_pads_with_grey() -> None:
    image = np.full((120, 160, 3), 7, dtype=np.uint8)
    square, scale = letterbox(image, 64)
    assert scale == pytest.approx(0.4) and square.shape == (64, 64, 3)
    assert (square[:48] == 7).all() and (square[48:] == 114).all()


def test_overlap() -> None:
    boxes = np.array([[0, 0, 2, 2], [1, 1, 3, 3], [5, 5, 6, 6], [0, 0, 0, 0]], dtype=float)
    assert overlap_of_boxes(boxes[0], boxes) == pytest.approx([1, 1 / 7, 0, 0])


@given(st.integers(0, 2**32 - 1), st.integers(0, 25), st.floats(0.1, 0.9))
@settings(max_examples=40, deadline=None)
def test_suppression_keeps_what_it_must(seed: int, count: int, overlap: float) -> None:
    random = np.random.default_rng(seed)
    low = random.uniform(0, 10, (count, 2))
    boxes = np.concatenate([low, low + random.uniform(0.5, 6, (count, 2))], axis=1)
    scores, classes = np.round(random.uniform(0, 1, count), 1), random.integers(0, 3, count)
    kept = suppress(boxes, scores, classes, overlap).tolist()
    order = sorted(range(count), key=lambda i: (-scores[i], i))
    expected: list[int] = []
    for i in order:
        if all(classes[i] != classes[j] or overlap_of_boxes(boxes[j], boxes[[i]])[0] <= overlap for j in expected):
            expected.append(i)
    assert kept == expected


@pytest.mark.parametrize(
    ("width", "height", "side"), [(640, 480, 480), (1280, 960, 640), (641, 480, 480), (100, 90, 480)]
)
def test_tiles_cover_the_image_and_overlap(width: int, height: int, side: int) -> None:
    windows = tile_windows(width, height, side)
    if max(width, height) <= side:
        assert windows == []
        return
    covered = np.zeros((height, width), dtype=int)
    for x0, y0, x1, y1 in windows:
        assert 0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height
        covered[y0:y1, x0:x1] += 1
    assert covered.min() >= 1
    starts = sorted({window[0] for window in windows})
    assert all(b - a <= side * 2 / 3 + 1 for a, b in zip(starts, starts[1:], strict=False))


def detector(weights: Path, tile_side: int = 480) -> Detector:
    return Detector(weights, score_threshold=0.3, suppression_overlap=0.5, tile_side=tile_side)


def test_missing_and_broken_weights(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="not an ONNX network"):
        detector(tmp_path / "none.onnx")
    for content in (b"", b"no network at all", bytes(range(256)) * 40):
        (tmp_path / "bad.onnx").write_bytes(content)
        with pytest.raises(BadInput, match="ONNX"):
            detector(tmp_path / "bad.onnx")


def test_torn_weights(tmp_path: Path) -> None:
    data = (real_data("detectors") / "yolox_nano.onnx").read_bytes()
    (tmp_path / "torn.onnx").write_bytes(data[: len(data) // 2])
    with pytest.raises(BadInput, match="ONNX"):
        detector(tmp_path / "torn.onnx")


def test_the_kitchen_has_a_table_a_chair_and_a_cup() -> None:
    weights = real_data("detectors") / "yolox_nano.onnx"
    picture = real_data("7scenes_redkitchen") / "frame-000000.color.jpg"
    color = np.ascontiguousarray(cv2.imread(str(picture))[..., ::-1])
    whole, tiled = detector(weights, tile_side=0).detect(color), detector(weights).detect(color)
    for found in (whole, tiled):
        names = {
            COCO_NAMES[number]: score for number, score in zip(found.classes[::-1], found.scores[::-1], strict=True)
        }
        assert names["dining table"] > 0.7 and names["chair"] > 0.6 and names["cup"] > 0.5
        assert (found.boxes[:, 2:] > found.boxes[:, :2]).all()
    cup = tiled.boxes[tiled.classes == COCO_NAMES.index("cup")][0]
    # Where anyone sees it: a white mug at the table's far edge.
    assert overlap_of_boxes(cup, np.array([[366, 163, 403, 202]]))[0] > 0.5
