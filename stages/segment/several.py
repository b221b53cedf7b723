"""Several networks judge a frame, each by itself; what they say of one thing is one mask with several witnesses."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.segments import Witness
from scenewright.schemas.vocabulary import UNNAMED, load_vocabulary
from scenewright.stages.kit.formats.frames import Frame
from scenewright.stages.segment.geometric import GeometricFrame
from scenewright.stages.segment.naming import KEPT_SHARE
from scenewright.stages.segment.panoptic import Backend, PanopticFrame, PanopticMask
from scenewright.stages.segment.same_things import BoxedMask, groups_of, mean_mask, not_nested

Layer = tuple[BoxedMask, PanopticMask]


class SeveralBackends:
    """Backends that judge every frame, as one."""

    def __init__(self, name: str, backends: Sequence[Backend]) -> None:
        self.name = name
        self._backends = tuple(backends)
        self._networks = [tuple(getattr(backend, "networks", ())) or (backend.label,) for backend in backends]
        self.networks = tuple(network for of_backend in self._networks for network in of_backend)
        self.label = " + ".join(backend.label for backend in backends)
        self.streams = tuple(dict.fromkeys(stream for backend in backends for stream in backend.streams))
        self.says_object_in_doubt = any(getattr(backend, "says_object_in_doubt", False) for backend in backends)
        self.corruption = max(getattr(backend, "corruption", 0.0) for backend in backends)
        self._unnamed = load_vocabulary().by_name(UNNAMED).id

    def __call__(self, frame: Frame, geometric: GeometricFrame, random: np.random.Generator) -> PanopticFrame:
        """Return the masks of a frame. Raises what a backend raises, and BadInput for masks of another size."""
        frames = []
        first = 0
        for backend, networks in zip(self._backends, self._networks, strict=True):
            judged = backend(frame, geometric, random)
            if judged.ids.shape != geometric.labels.shape:
                (high, wide), (rows, columns) = geometric.labels.shape, judged.ids.shape
                raise BadInput(
                    f"{backend.label}: its masks are {columns}x{rows}, the frame is {wide}x{high}",
                    hint="leave this backend out",
                )
            frames.append(numbered(judged, first))
            first += len(networks)
        return agreed(frames, unnamed=self._unnamed)


def numbered(frame: PanopticFrame, first: int) -> PanopticFrame:
    """Return a frame whose masks say which network gave them, counted from `first`."""
    masks = {}
    for number, mask in frame.masks.items():
        said = mask.witnesses or (Witness(network=0, class_id=mask.class_id, score=mask.score),)
        masks[number] = PanopticMask(
            mask.class_id,
            mask.is_thing,
            mask.score,
            tuple(witness.model_copy(update={"network": first + witness.network}) for witness in said),
        )
    return PanopticFrame(frame.ids, masks)


def agreed(frames: Sequence[PanopticFrame], *, unnamed: int) -> PanopticFrame:
    """Return one frame of the masks of several networks, each of which says who gave it (`numbered`).

    Masks of things whose IoU is over .5 are one, their mean, and so are masks of stuff: a wall that somebody sees
    everywhere takes no thing away. All of a stuff class is one. Of things of one class of which one
    lies in the other the weaker goes. Stuff lies below things, large things below small ones; a thing that keeps less
    than half is dropped. Class and score are the leading sum over the witnesses, at most 1; `unnamed` leads where
    nobody has a name.
    """
    masks = [(frame.ids == number, mask) for frame in frames for number, mask in sorted(frame.masks.items())]
    masks = [(pixels, mask) for pixels, mask in masks if pixels.any()]
    things = _one_each([(pixels, mask) for pixels, mask in masks if mask.is_thing], unnamed)
    stuff: dict[int, list[Layer]] = defaultdict(list)
    for one, led in _one_each([(pixels, mask) for pixels, mask in masks if not mask.is_thing], unnamed):
        stuff[led.class_id].append((one, led))
    below = [
        (BoxedMask(np.any([one.mask for one, _ in parts], axis=0)), leading([mask for _, mask in parts], unnamed))
        for parts in stuff.values()
    ]
    kept = not_nested(
        [one for one, _ in things], [mask.score for _, mask in things], [mask.class_id for _, mask in things]
    )
    below.sort(key=lambda layer: layer[1].score)
    above = sorted((things[k] for k in kept), key=lambda layer: -layer[0].area)
    return _painted([*below, *above], frames[0].ids.shape)


def _one_each(masks: Sequence[tuple[np.ndarray, PanopticMask]], unnamed: int) -> list[Layer]:
    boxed, scores = [BoxedMask(pixels) for pixels, _ in masks], [mask.score for _, mask in masks]
    return [
        (
            mean_mask([boxed[k] for k in group], [scores[k] for k in group]),
            leading([masks[k][1] for k in sorted(group)], unnamed),
        )
        for group in groups_of(boxed, scores)
    ]


def leading(masks: Sequence[PanopticMask], unnamed: int) -> PanopticMask:
    """Return the mask that several come to: the class with the largest sum of scores over their witnesses."""
    witnesses = tuple(dict.fromkeys(witness for mask in masks for witness in mask.witnesses))
    sums: dict[int, float] = defaultdict(float)
    for witness in witnesses:
        sums[witness.class_id] += witness.score
    named = [class_id for class_id in sums if class_id != unnamed] or [unnamed]
    best = max(named, key=lambda class_id: sums[class_id])  # of equals the first network's
    is_thing = next((mask.is_thing for mask in masks if mask.class_id == best), masks[0].is_thing)
    return PanopticMask(best, is_thing, min(1.0, sums[best]), witnesses)


def _painted(layers: Sequence[Layer], shape: tuple[int, ...]) -> PanopticFrame:
    ids = np.zeros(shape, dtype=np.int32)
    for number, (boxed, _) in enumerate(layers, start=1):
        ids[boxed.mask] = number
    visible = np.bincount(ids.ravel(), minlength=len(layers) + 1)
    masks = {}
    kept = np.zeros(shape, dtype=np.int32)  # painted again: what is dropped must not hide what lies below
    for number, (boxed, mask) in enumerate(layers, start=1):
        if visible[number] and (not mask.is_thing or visible[number] >= KEPT_SHARE * boxed.area):
            masks[number] = mask
            kept[boxed.mask] = number
    return PanopticFrame(kept, masks)
