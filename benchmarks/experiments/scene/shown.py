"""What the masks alone show of a room: a bound on what can be found by name, whatever the map makes of them."""

from __future__ import annotations

from collections import Counter

import numpy as np
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.segment import (
    BackendRequest,
    PanopticFrame,
    SegmentParameters,
    choose_backend,
    geometric_settings,
    segment_depth,
)

from benchmarks.experiments.mapping.measuring import masks_of
from benchmarks.generated_rooms import error_seed
from benchmarks.graph_scores import OPTIONS

LEAST_PIXELS = 30
"""Of a thing in a picture 320 wide that counts as a view of it."""
SEVERAL = 3
"""Views in which a map that counts them believes a name."""


def shown_and_named(
    true: PanopticFrame, masks: PanopticFrame, least_pixels: float, overlap: float = OPTIONS.node_match_iou
) -> dict[int, bool]:
    """Return the true things of a frame of at least so many pixels -> whether a mask of its class shows each: by an
    `overlap` (IoU) by which things of maps count as found too."""
    found = {}
    for number, mask in true.masks.items():
        own = true.ids == number
        pixels = np.count_nonzero(own)
        if not mask.is_thing or pixels < least_pixels:
            continue
        ids, counts = np.unique(masks.ids[own], return_counts=True)
        found[number] = any(
            masks.masks[k].class_id == mask.class_id
            and count >= overlap * (np.count_nonzero(masks.ids == k) + pixels - count)
            for k, count in zip(ids.tolist(), counts.tolist(), strict=True)
            if k in masks.masks
        )
    return found


def shown_by_masks(name: str, sequence: SequenceArtifact, case: str) -> dict[str, float]:
    """Return the shares of the things in sight that views of a case of `mapping` show and name rightly: one view at
    least, and `SEVERAL`. `name`: of the room and the draw of its errors."""
    drawn, seen, shown = error_seed(name), set[int](), Counter[int]()
    settings = geometric_settings(SegmentParameters.model_validate({}))
    with FrameReader(sequence.path("frames.mcap")) as reader:
        asked = [SegmentParameters.model_validate(each) for each in ({"backend": "ground-truth"}, masks_of(case))]
        requests = [BackendRequest(each, sequence=sequence, reader=reader, seed=drawn) for each in asked]
        true_masks, spoiled_masks = map(choose_backend, requests)
        for frame in reader.frames():
            if frame.depth is None or frame.world_from_camera is None:
                continue
            geometric = segment_depth(frame.depth, reader.cameras[frame.camera_name], settings)
            true, spoiled = (
                backend(frame, geometric, np.random.default_rng([drawn, frame.index]))
                for backend in (true_masks, spoiled_masks)
            )
            found = shown_and_named(true, spoiled, LEAST_PIXELS * (frame.depth.shape[1] / 320) ** 2)
            seen |= found.keys()
            shown.update(number for number, is_shown in found.items() if is_shown)
    least = {"shown": 1, "shown_in_several": SEVERAL}
    return {key: sum(n >= views for n in shown.values()) / max(1, len(seen)) for key, views in least.items()}
