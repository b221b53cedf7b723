"""A seeded model of what a segmentation network gets wrong, applied to true masks.

One level 0..1 stands for all rates: at level 1 a mask has a wrong class with probability 0.5, is missed with 0.3, is
merged with a neighbour with 0.3, is cut in two with 0.3, and boundaries wander by 8 pixels (standard deviation, at
640 pixels width); rates grow linearly with the level. Every frame is drawn on its own.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np
from scenewright.stages.kit.acting.spoiled_masks import displace_boundaries, touching
from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask


@dataclass(frozen=True)
class CorruptionRates:
    """Probabilities per mask and frame, and the boundary displacement [pixels at 640 width]."""

    flip: float = 0.0
    miss: float = 0.0
    merge: float = 0.0
    split: float = 0.0
    boundary: float = 0.0


AT_ONE = CorruptionRates(flip=0.5, miss=0.3, merge=0.3, split=0.3, boundary=8.0)


def rates_of_level(level: float) -> CorruptionRates:
    """Return the rates of a corruption level in 0..1; level 0 changes nothing."""
    return CorruptionRates(**{name: rate * level for name, rate in asdict(AT_ONE).items()})


def corrupt(
    frame: PanopticFrame, rates: CorruptionRates, classes: dict[bool, tuple[int, ...]], random: np.random.Generator
) -> PanopticFrame:
    """Return the frame with masks missed, merged, split, with flipped classes and noisy boundaries, in this order.

    `classes` maps is_thing to the class ids a flip may choose from; stuff is never merged or split. Masks keep their
    ids; the second half of a split mask gets a new one. The same generator state gives the same frame.
    """
    ids = frame.ids.copy()
    masks = dict(frame.masks)
    for mask_id in sorted(frame.masks):
        if random.random() < rates.miss:
            ids[ids == mask_id] = 0
            del masks[mask_id]
    for mask_id in _things(masks):
        if random.random() < rates.merge and mask_id in masks:
            beside = list(touching(ids, _things(masks), mask_id))
            if beside:
                ids[ids == mask_id] = beside[int(random.integers(len(beside)))]
                del masks[mask_id]
    for mask_id in _things(masks):
        if random.random() < rates.split:
            _split(ids, masks, mask_id, random)
    for mask_id in sorted(masks):
        if random.random() < rates.flip:
            masks[mask_id] = _flipped(masks[mask_id], classes, random)
    if rates.boundary > 0:
        ids = displace_boundaries(ids, rates.boundary * ids.shape[1] / 640, random)
    present = set(np.unique(ids).tolist())
    return PanopticFrame(ids=ids, masks={key: mask for key, mask in masks.items() if key in present})


def _things(masks: dict[int, PanopticMask]) -> list[int]:
    return sorted(mask_id for mask_id, mask in masks.items() if mask.is_thing)


def _split(ids: np.ndarray, masks: dict[int, PanopticMask], mask_id: int, random: np.random.Generator) -> None:
    """Cut the mask by a line of random direction through its middle; the far half becomes an instance of its own."""
    rows, columns = np.nonzero(ids == mask_id)
    if rows.size < 2:
        return
    angle = random.uniform(0, np.pi)
    side = (columns - columns.mean()) * np.cos(angle) + (rows - rows.mean()) * np.sin(angle) > 0
    if not side.any() or side.all():
        return
    new_id = max(masks) + 1
    ids[rows[side], columns[side]] = new_id
    masks[new_id] = masks[mask_id]


def _flipped(mask: PanopticMask, classes: dict[bool, tuple[int, ...]], random: np.random.Generator) -> PanopticMask:
    """Return the mask with another class of its own kind (thing or stuff), uniformly drawn."""
    others = [class_id for class_id in classes[mask.is_thing] if class_id != mask.class_id]
    if not others:
        return mask
    return replace(mask, class_id=others[int(random.integers(len(others)))])
