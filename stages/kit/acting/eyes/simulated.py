"""A simulated segmenter: the true instances of a rendered picture, with errors that last."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.acting.errors import SegmenterErrors
from scenewright.stages.kit.acting.eyes.masks import Mask
from scenewright.stages.kit.acting.spoiled_masks import MaskView, spoiled
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply
from scenewright.stages.kit.rendering.object_views import LEAST_PIXELS, Picture


@dataclass(frozen=True)
class Shown:
    """A thing that pictures may show, as it truly is."""

    name: str
    label: str
    lies: object = 0
    """Changes when it comes to lie anew: it may look different then."""


class SimulatedSegmenter:
    """Errors last until a thing lies anew or is looked at from another region of views, or for good.

    `shown` returns the things of pictures by their instance numbers; `bare`: numbers of floor and walls.
    """

    def __init__(
        self, errors: SegmenterErrors, shown: Callable[[], Mapping[int, Shown]], bare: Collection[int] = (0,)
    ) -> None:
        self._errors, self._shown, self._bare, self._taken = errors, shown, list(bare), 0
        self.missed: frozenset[str] = frozenset()

    def masks(self, picture: Picture, map_from_camera: np.ndarray, region: object) -> list[Mask]:
        """Return the masks of things of a picture."""
        shown = self._shown()
        numbers, pixels = np.unique(picture.instance, return_counts=True)
        large = {int(k) for k, count in zip(numbers, pixels, strict=True) if count >= LEAST_PIXELS}
        things = {number: shown[number].label for number in sorted(large & set(shown))}
        seen = picture.depth > 0
        view = MaskView(
            points=apply(map_from_camera, back_project(picture.depth, picture.camera).astype(float)),
            seen=seen,
            bare=np.isin(picture.instance, self._bare),
            camera=map_from_camera[:3, 3],
            frame=self._taken,
            keys={number: shown[number].name for number in things},
            regions={number: (shown[number].lies, region) for number in things},
        )
        self._taken += 1
        ids, named = spoiled(picture.instance.astype(np.int64), things, view, self._errors, max(shown, default=0) + 1)
        self.missed = frozenset(shown[number].name for number in things if number not in named)
        told = ((label, ids == number) for number, label in sorted(named.items()))
        return [Mask(label, mask) for label, mask in told if mask.sum() >= LEAST_PIXELS]
