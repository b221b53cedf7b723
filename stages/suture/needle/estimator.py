"""What an estimator of the needle's pose is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scenewright.stages.suture.needle.observation import NeedleEstimate, NeedleObservation
from scenewright.stages.suture.rig import NeedlePose


@dataclass(frozen=True)
class Estimator:
    """One of the rivals."""

    whose: str
    """For people."""
    of_view: Callable[[NeedleObservation, int, NeedlePose | None], NeedleEstimate]
    """From one view of both eyes, a seed, and the pose of the frame before (where the needle hardly moved)."""
    of_frames: Callable[[Sequence[NeedleEstimate], Sequence[np.ndarray]], NeedleEstimate]
    """From the estimates of several frames, oldest first, and the motions (4, 4) that carry the needle from each to the
    last: the pose there."""
