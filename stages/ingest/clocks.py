"""Are the stamps of pictures a clock's: what their order, their repeats and their rate say."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scenewright.stages.ingest.folders.files import natural_key
from scenewright.stages.ingest.parameters import IngestParameters

FASTEST = 1000.0
"""Pictures a second that no camera of a log takes: depth cameras reach 300."""
NO_RATE = "as no camera takes"
MOST_WRONG = 0.05
"""Share of the pictures whose stamps may repeat or run backward: a clock that was set, or a picture listed twice."""


def stamps_problem(stamps: Sequence[int], names: Sequence[str] = ()) -> str | None:
    """Return why stamps (N,) [ns], in file order, are no clock's, None where they may be one's.

    `names` (N,) are those of the files. A list whose names are not in order either is a shuffled one, and its stamps
    say the order.
    """
    times = np.asarray(stamps, dtype=np.int64)
    count, distinct = len(times), np.unique(times)
    if count < 3:
        return None
    if len(distinct) == 1:
        return f"all {count} stamps are the same"
    rate = 1e9 / float(np.median(np.diff(distinct)))
    if rate > FASTEST:
        return f"stamps make {rate:,.0f} images a second, {NO_RATE}"
    latest = np.maximum.accumulate(times)[:-1]
    behind, repeated = int((times[1:] < latest).sum()), count - len(distinct)
    keys = [natural_key(name) for name in names]
    in_order = bool(keys) and all(first < second for first, second in pairwise(keys))
    if in_order and behind > MOST_WRONG * count:
        return f"{behind} of {count} stamps lie before an earlier image's"
    if 2 * repeated >= count or (in_order and repeated > MOST_WRONG * count):
        return f"{count} images have {len(distinct)} stamps"
    return None


def in_file_order(count: int, frame_rate: float) -> np.ndarray:
    """Return stamps (N,) int64 [ns] of pictures that are so many a second, from 0 on."""
    return np.rint(np.arange(count) * 1e9 / frame_rate).astype(np.int64)


def order_note(problem: str, parameters: IngestParameters) -> str:
    """Return what is taken in the place of stamps that are no clock's: a warning, unless the rate was given."""
    taken = f"{problem}: taken is the order in the file, {parameters.frame_rate:g} images a second"
    return taken if "frame_rate" in parameters.model_fields_set else f"WARNING: {taken} (--frame-rate RATE if known)"
