"""Classes and instances tracked apart, as in Voxblox++ (Grinvald 2019) and the thesis's "w/o joint fusion" (2.5.2)."""

from __future__ import annotations

from collections.abc import Sequence

from stages.fuse.association import Prediction
from stages.fuse.counts import TripleCounts


class SeparateCounts(TripleCounts):
    """The two pairwise counts, label with class and label with instance: the sums of the triple-wise count over the
    other index. An instance may then win on a segment whose class was predicted with another instance."""

    def instances(self, segment: int, class_id: int) -> dict[int, int]:
        """Return {p: count} of a segment label, whatever class was predicted with it; `class_id` has no say."""
        result: dict[int, int] = {}
        for (_, instance), count in self.by_segment.get(segment, {}).items():
            result[instance] = result.get(instance, 0) + count
        return result


def associate_separately(
    predictions: Sequence[Prediction], unpredicted: Sequence[int], counts: SeparateCounts, next_instance: int
) -> tuple[dict[tuple[int, int], int], int]:
    """Return {(frame instance, class): global instance} and the next unused global instance label.

    The rule of Voxblox++: the first segment of a frame instance decides for all of them, by the instance that was
    counted most on its label and that no other frame instance has; without one a new label is made. An instance that
    leads on a segment without a prediction in this frame (`unpredicted`, global labels) is taken too.
    """
    taken: set[int] = set()
    for label in unpredicted:
        known = counts.instances(label, 0)
        if known:
            taken.add(min(known, key=lambda p: (-known[p], p)))
    result: dict[tuple[int, int], int] = {}
    for prediction in predictions:
        key = (prediction.frame_instance, prediction.class_id)
        if key in result:
            continue
        known = {p: n for p, n in counts.instances(prediction.segment, 0).items() if p not in taken}
        if known:
            result[key] = min(known, key=lambda p: (-known[p], p))
            taken.add(result[key])
        else:
            result[key] = next_instance
            next_instance += 1
    return result, next_instance
