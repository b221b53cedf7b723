"""From the outputs of the known layouts to masks of the image. Arrays of networks are not trusted: what is not
finite is dropped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from scenewright.stages.segment.networks.fitting import Fitted
from scenewright.stages.segment.networks.sidecar import END_TO_END, OBJECTNESS
from scenewright.stages.segment.suppression import suppress

MOST_CANDIDATES = 300
"""Instances of one image that are looked at, the best scored."""
MASK_THRESHOLD = 0.5
"""Least probability of a mask's pixel; the published networks' own."""
LARGEST_SHARE = 2.0
"""Boxes given in shares of the input's sides are not larger than this."""
OVERLAP_SHARE = 0.8
"""A panoptic segment of which others leave less than this is dropped (Cheng et al. 2022)."""


@dataclass(frozen=True)
class Found:
    """One instance: a mask (H, W) bool, the network's number of its label, and its score."""

    mask: np.ndarray
    number: int
    score: float


def instances_of(
    layout: str,
    outputs: Mapping[str, np.ndarray],
    fitted: Fitted,
    shape: tuple[int, int],
    *,
    score_threshold: float,
    suppression_overlap: float,
) -> list[Found]:
    """Return the instances in an image of `shape` (H, W) from what a network of any layout of instances gave, by role.

    `suppression_overlap`: for layouts whose boxes are not suppressed yet.
    """
    if layout in ("yolo-seg", "yolo-objectness"):
        raw = yolo_seg if layout == "yolo-seg" else yolo_objectness
        return raw(
            outputs["predictions"],
            outputs["prototypes"],
            fitted,
            shape,
            score_threshold=score_threshold,
            suppression_overlap=suppression_overlap,
        )
    if layout == "yolo-end-to-end":
        return yolo_end_to_end(
            outputs["predictions"], outputs["prototypes"], fitted, shape, score_threshold=score_threshold
        )
    if layout == "query-instances":
        return query_instances(outputs["classes"], outputs["masks"], fitted, shape, score_threshold=score_threshold)
    return instances(
        outputs["boxes"],
        outputs["labels"],
        outputs.get("scores"),
        outputs["masks"],
        fitted,
        shape,
        score_threshold=score_threshold,
    )


def in_pixels(rows: np.ndarray, fitted: Fitted) -> np.ndarray:
    """Return rows (N, 4 + ...) whose first four columns are pixels of the input: exports for TensorFlow Lite give
    shares of its sides. The cells of a network cover its input, so that pixels go far beyond LARGEST_SHARE."""
    boxes = rows[:, :4]
    if not rows.size or np.max(boxes, initial=0, where=np.isfinite(boxes)) > LARGEST_SHARE:
        return rows
    height, width = fitted.tensor.shape[-2:]
    return np.concatenate([boxes * np.array([width, height] * 2, np.float32), rows[:, 4:]], axis=1)


def yolo_seg(
    predictions: np.ndarray,
    prototypes: np.ndarray,
    fitted: Fitted,
    shape: tuple[int, int],
    *,
    score_threshold: float,
    suppression_overlap: float,
) -> list[Found]:
    """Return the instances of a YOLO segmentation network in an image of `shape` (H, W).

    `predictions` (1, 4 + C + M, N): centre x, y, width, height [input pixels, or shares of the input's sides], a score
    0..1 per class, M mask coefficients; `prototypes` (1, M, h, w). A mask is the sigmoid of coefficients times
    prototypes, cut by its box.
    """
    count = prototypes.shape[1]
    rows = in_pixels(predictions[0].T.astype(np.float32), fitted)
    scores = rows[:, 4 : rows.shape[1] - count]
    numbers = scores.argmax(axis=1)
    best = scores[np.arange(len(scores)), numbers]
    sound = np.isfinite(rows).all(axis=1) & (best >= score_threshold)
    order = np.flatnonzero(sound)[np.argsort(-best[sound], kind="stable")][:MOST_CANDIDATES]
    half = np.maximum(rows[order, 2:4], 0) / 2
    boxes = np.concatenate([rows[order, :2] - half, rows[order, :2] + half], axis=1)
    unsuppressed = suppress(boxes, best[order], numbers[order], suppression_overlap)
    chosen = order[unsuppressed]
    masks = _masks_of_coefficients(rows[chosen, -count:], prototypes, boxes[unsuppressed], fitted, shape)
    return [Found(mask, int(numbers[k]), _unit(best[k])) for mask, k in zip(masks, chosen, strict=True)]


def yolo_objectness(
    predictions: np.ndarray,
    prototypes: np.ndarray,
    fitted: Fitted,
    shape: tuple[int, int],
    *,
    score_threshold: float,
    suppression_overlap: float,
) -> list[Found]:
    """Return the instances of a YOLO segmentation network with objectness, as `yolo_seg` does.

    `predictions` (1, N, 5 + C + M): centre x, y, width, height [input pixels], objectness 0..1, a score 0..1 per
    class, M mask coefficients. A score is objectness times that of the class, as in YOLOv5.
    """
    boxes, sure, scores, coefficients = np.split(
        predictions[0].astype(np.float32), [4, OBJECTNESS, predictions.shape[2] - prototypes.shape[1]], axis=1
    )
    rows = np.concatenate([boxes, sure * scores, coefficients], axis=1)
    return yolo_seg(
        rows.T[None],
        prototypes,
        fitted,
        shape,
        score_threshold=score_threshold,
        suppression_overlap=suppression_overlap,
    )


def yolo_end_to_end(
    predictions: np.ndarray, prototypes: np.ndarray, fitted: Fitted, shape: tuple[int, int], *, score_threshold: float
) -> list[Found]:
    """Return the instances of a YOLO segmentation network that suppresses doubles itself, in an image of `shape`.

    `predictions` (1, N, 6 + M): x0, y0, x1, y1 [input pixels or shares], score, number of the class, M mask
    coefficients; `prototypes` (1, M, h, w).
    """
    rows = in_pixels(predictions[0].astype(np.float32), fitted)
    sound = np.isfinite(rows).all(axis=1) & (rows[:, 4] >= score_threshold)
    rows = rows[sound][np.argsort(-rows[sound, 4], kind="stable")][:MOST_CANDIDATES]
    masks = _masks_of_coefficients(rows[:, END_TO_END:], prototypes, rows[:, :4], fitted, shape)
    return [Found(mask, int(row[5]), _unit(row[4])) for mask, row in zip(masks, rows, strict=True)]


def _masks_of_coefficients(
    coefficients: np.ndarray, prototypes: np.ndarray, boxes: np.ndarray, fitted: Fitted, shape: tuple[int, int]
) -> Iterator[np.ndarray]:
    """Yield the masks (H, W) bool of coefficients (N, M) times prototypes (1, M, h, w), cut by boxes (N, 4)."""
    height, width = fitted.tensor.shape[-2:]
    for row, box in zip(coefficients, boxes, strict=True):
        logits = np.tensordot(row, prototypes[0].astype(np.float32), axes=1)
        input_logits = cv2.resize(logits, (width, height), interpolation=cv2.INTER_LINEAR)
        yield (_to_image(input_logits, fitted, shape) > 0) & _inside(*_scaled_box(box, fitted), shape)


def query_instances(
    classes: np.ndarray, masks: np.ndarray, fitted: Fitted, shape: tuple[int, int], *, score_threshold: float
) -> list[Found]:
    """Return the instances of a network of queries that says of each class whether it is one (RF-DETR).

    `classes` (1, Q, C) logits, each for itself; `masks` (1, Q, h, w) logits. A query is of its likeliest class.
    """
    scores = _sigmoid(np.nan_to_num(classes[0].astype(np.float64), nan=-50))
    numbers, best = scores.argmax(axis=1), scores.max(axis=1)
    order = np.argsort(-best, kind="stable")[:MOST_CANDIDATES]
    height, width = fitted.tensor.shape[-2:]
    things = []
    for k in order[best[order] >= score_threshold]:
        logits = cv2.resize(np.nan_to_num(masks[0, k].astype(np.float32), nan=-50), (width, height))
        things.append(Found(_to_image(logits, fitted, shape) > 0, int(numbers[k]), _unit(best[k])))
    return things


def instances(
    boxes: np.ndarray,
    labels: np.ndarray,
    scores: np.ndarray | None,
    masks: np.ndarray,
    fitted: Fitted,
    shape: tuple[int, int],
    *,
    score_threshold: float,
) -> list[Found]:
    """Return the instances of a Mask R-CNN in an image of `shape` (H, W).

    `boxes` (N, 4) x0, y0, x1, y1 [input pixels], `labels` (N,), `scores` (N,) or a fifth column of the boxes, `masks`
    (N, [1,] h, w) 0..1: of the size of the input, or small ones that fill their box. A leading batch axis of 1 is
    passed over.
    """
    boxes = boxes.reshape(-1, boxes.shape[-1]).astype(np.float32)
    scores = boxes[:, 4] if scores is None else scores.reshape(-1)
    boxes, labels = boxes[:, :4], labels.reshape(-1)
    masks = masks.reshape(-1, *masks.shape[-2:]).astype(np.float32)
    if not len(boxes) == len(labels) == len(scores) == len(masks):
        return []
    sound = np.isfinite(boxes).all(axis=1) & np.isfinite(masks).all(axis=(1, 2)) & (scores >= score_threshold)
    order = np.flatnonzero(sound)[np.argsort(-scores[sound], kind="stable")][:MOST_CANDIDATES]
    things = []
    for k in order:
        if masks.shape[1:] == fitted.tensor.shape[-2:]:
            mask = _to_image(masks[k], fitted, shape) > MASK_THRESHOLD
        else:
            mask = _paste_mask(masks[k], _scaled_box(boxes[k], fitted), shape)
        things.append(Found(mask, int(labels[k]), _unit(scores[k])))
    return things


def panoptic(
    classes: np.ndarray,
    masks: np.ndarray,
    fitted: Fitted,
    shape: tuple[int, int],
    *,
    score_threshold: float,
    stuff: set[int],
) -> tuple[np.ndarray, dict[int, tuple[int, float]]]:
    """Return ids (H, W) int32 and id -> (number of the label, score) from queries (Cheng et al. 2022).

    `classes` (1, Q, C + 1) logits, the last one for "nothing"; `masks` (1, Q, h, w) logits. Every pixel goes to the
    query with the largest product of class and mask probability. Queries of one label in `stuff` are one segment.
    """
    logits = np.nan_to_num(classes[0].astype(np.float64), nan=-1e4, posinf=1e4, neginf=-1e4)
    odds = np.exp(logits - logits.max(axis=1, keepdims=True))
    probability = odds / odds.sum(axis=1, keepdims=True)
    numbers = probability.argmax(axis=1)
    scores = probability.max(axis=1)
    queries = np.flatnonzero((numbers < probability.shape[1] - 1) & (scores >= score_threshold))
    ids = np.zeros(shape, dtype=np.int32)
    segments: dict[int, tuple[int, float]] = {}
    if not len(queries):
        return ids, segments
    height, width = fitted.tensor.shape[-2:]
    mask_probabilities = np.stack(
        [
            _sigmoid(
                _to_image(cv2.resize(np.nan_to_num(masks[0, k].astype(np.float32)), (width, height)), fitted, shape)
            )
            for k in queries
        ]
    )
    winner = (mask_probabilities * scores[queries, None, None]).argmax(axis=0)
    fused: dict[int, int] = {}
    for position, k in enumerate(queries):
        of_query = mask_probabilities[position] >= MASK_THRESHOLD
        pixels = (winner == position) & of_query
        if pixels.sum() <= OVERLAP_SHARE * of_query.sum():
            continue
        number, score = int(numbers[k]), float(scores[k])
        target = fused.setdefault(number, len(segments) + 1) if number in stuff else len(segments) + 1
        segments[target] = (number, max(score, segments.get(target, (0, 0.0))[1]))
        ids[pixels] = target
    return ids, segments


def _to_image(values: np.ndarray, fitted: Fitted, shape: tuple[int, int]) -> np.ndarray:
    """Return values (h, w) of the network's input as values of the image."""
    height, width = shape
    inner = values[: max(1, round(height * fitted.scale_y)), : max(1, round(width * fitted.scale_x))]
    return inner if inner.shape == shape else cv2.resize(inner, (width, height), interpolation=cv2.INTER_LINEAR)


def _scaled_box(box: np.ndarray, fitted: Fitted) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = (float(value) for value in box)
    return x0 / fitted.scale_x, y0 / fitted.scale_y, x1 / fitted.scale_x, y1 / fitted.scale_y


def _inside(x0: float, y0: float, x1: float, y1: float, shape: tuple[int, int]) -> np.ndarray:
    rows, columns = np.arange(shape[0])[:, None] + 0.5, np.arange(shape[1])[None] + 0.5
    return (rows >= y0) & (rows <= y1) & (columns >= x0) & (columns <= x1)


def _paste_mask(small: np.ndarray, box: tuple[float, float, float, float], shape: tuple[int, int]) -> np.ndarray:
    """Return the mask (H, W) of a small one (h, w) 0..1 that fills a box; its pixels are sampled at their centres."""
    x0, y0, x1, y1 = box
    mask = np.zeros(shape, dtype=bool)
    left, top = max(0, int(np.floor(x0))), max(0, int(np.floor(y0)))
    right, bottom = min(shape[1], int(np.ceil(x1))), min(shape[0], int(np.ceil(y1)))
    if right <= left or bottom <= top or x1 <= x0 or y1 <= y0:
        return mask
    u = (np.arange(left, right) + 0.5 - x0) / (x1 - x0) * small.shape[1] - 0.5
    v = (np.arange(top, bottom) + 0.5 - y0) / (y1 - y0) * small.shape[0] - 0.5
    grid_u, grid_v = np.meshgrid(u.astype(np.float32), v.astype(np.float32))
    values = cv2.remap(small, grid_u, grid_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    mask[top:bottom, left:right] = (values > MASK_THRESHOLD) & _inside(x0, y0, x1, y1, shape)[top:bottom, left:right]
    return mask


def _sigmoid(values: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-np.clip(values, -50, 50)))


def _unit(score: float) -> float:
    return float(min(max(score, 0.0), 1.0))
