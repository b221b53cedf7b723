"""Which segments are one thing: a partition of their graph, decided by all frames together when the map is closed.

Ours, in place of the instance labels of equations 2.4 to 2.6. Those are decided frame by frame and feed on themselves:
of two cabinets that one mask covered early on, the one that is seen alone takes the other's label, and every such frame
confirms it. What frames said of each pair of segments, one thing or two, does not depend on any label.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import reduce
from heapq import heapify, heappop, heappush
from operator import or_

from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.merging import Grouping
from scenewright.stages.fuse.regularization import PairEvidence

SURE_VOTES = 3
"""Least predictions with which the leading class of a segment is believed."""
APART_WEIGHT = 1
"""Weight of a frame that saw two things beside one that saw one."""
NAMED_SHARE = 0.2
"""A thing is nameless only where the masks that did name it add up to less than this share of all scores."""
NOTHING = (0, 0)
"""Class and instance of what belongs to no thing."""
LEAST_WEIGHT = 2
"""Groups merge from this summed weight on; a single frame decides nothing."""


def pair_weights(labels: Iterable[int], evidence: PairEvidence) -> dict[int, dict[int, int]]:
    """Return {a: {b: weight}}, symmetric: how often frames saw both segments in one instance of a thing, less
    APART_WEIGHT times how often in two."""
    label_order = dict.fromkeys(sorted(labels))
    weights = {
        label: {
            neighbour: -APART_WEIGHT * count
            for neighbour, count in evidence.apart.get(label, {}).items()
            if neighbour in label_order
        }
        for label in label_order
    }
    for (first, second), count in evidence.together.items():
        if first in weights and second in weights:
            weights[first][second] = weights[second][first] = weights[first].get(second, 0) + count
    return weights


def group_segments(weights: dict[int, dict[int, int]], believed: Mapping[int, int]) -> list[list[int]]:
    """Return the groups of segment labels, each ascending, in the order of their smallest label; uses `weights` up.

    Greedy additive edge contraction (Keuper 2015): the two groups with the largest summed weight merge until no sum
    reaches LEAST_WEIGHT. Ties go to the smaller labels. One stray frame in which a mask covered two things is
    outweighed by those that saw two. Groups of different `believed` classes {label: class, 0 unknown} never merge: a
    mask that covered both in some frames gave both its class there, and was outvoted on one of them.
    """
    members = {label: [label] for label in sorted(weights)}
    classes = {label: believed.get(label, 0) for label in members}
    heap = [(-w, a, b) for a, row in weights.items() for b, w in row.items() if a < b and w >= LEAST_WEIGHT]
    heapify(heap)
    while heap:
        negative, kept, removed = heappop(heap)
        if weights.get(kept, {}).get(removed) != -negative:
            continue  # One of the two has merged since, or the sum has changed.
        if classes[kept] and classes[removed] and classes[kept] != classes[removed]:
            continue
        members[kept] += members.pop(removed)
        classes[kept] = classes[kept] or classes[removed]
        for neighbour, weight in weights.pop(removed).items():
            del weights[neighbour][removed]
            if neighbour == kept:
                continue
            total = weights[kept].get(neighbour, 0) + weight
            weights[kept][neighbour] = weights[neighbour][kept] = total
            if total >= LEAST_WEIGHT:
                heappush(heap, (-total, min(kept, neighbour), max(kept, neighbour)))
    return [sorted(members[label]) for label in sorted(members)]


def attach_unseen_pairs(groups: list[list[int]], evidence: PairEvidence, counts: TripleCounts) -> list[list[int]]:
    """Return the groups in which those that no frame ever showed together have joined by their instance labels.

    Two groups of which no pair was in one frame say nothing of each other; the instance label that leads on both
    (eq. 2.6) was carried from one to the other by frames that saw parts of both. The larger group takes the smaller.
    """
    home = {label: number for number, group in enumerate(groups) for label in group}
    votes = [_total(group, counts) for group in groups]
    leading: dict[tuple[int, int], list[int]] = {}
    for number, group in enumerate(groups):
        best = _leading_instance(group, counts)
        if best is not None:
            leading.setdefault(best, []).append(number)
    target = list(range(len(groups)))
    for numbers in leading.values():
        if len(numbers) < 2:
            continue
        main = max(numbers, key=lambda n: (votes[n], -n))
        met = {home[partner] for label in groups[main] for partner in evidence.met(label) if partner in home}
        for number in numbers:
            if number != main and number not in met:
                target[number] = main
    merged: dict[int, list[int]] = {}
    for number, group in enumerate(groups):
        merged.setdefault(target[number], []).extend(group)
    return sorted(sorted(group) for group in merged.values())


def leading_class(scores: Mapping[int, float], unnamed: int | None) -> int:
    """Return the class with the largest sum of scores; ties to the smaller number. 0 where there is none.

    A mask of the class `unnamed` has found a thing and not recognised it, which says nothing against those that have:
    it leads only where the named ones hold less than NAMED_SHARE of the sum.
    """
    named_scores = {c: s for c, s in scores.items() if c != unnamed}
    if unnamed in scores and sum(named_scores.values()) < NAMED_SHARE * sum(scores.values()):
        return int(unnamed) if unnamed is not None else 0
    return min(named_scores, key=lambda c: (-named_scores[c], c)) if named_scores else 0


def name_groups(
    groups: Iterable[list[int]],
    counts: TripleCounts,
    things: frozenset[int],
    seen_in: Mapping[int, int],
    scores: Mapping[int, Mapping[int, float]],
    unnamed: int | None = None,
) -> Grouping:
    """Give every group the class of things that the scores of its predictions say, and an instance label of its own.

    The label is the one with most predictions of that class in the group that no stronger group has, else a new one.
    A group was seen in the frames that called it what it is called now: names that came up once are mostly wrong.
    """
    best: dict[int, tuple[int, int]] = {}
    new_seen_in = dict(seen_in)
    unused = max([0, *seen_in, *(p for row in counts.by_segment.values() for _, p in row)]) + 1
    used: set[int] = set()
    for group in sorted(groups, key=lambda g: (-_total(g, counts), g)):
        class_id = leading_class(_scores_of(group, scores, things), unnamed)
        predictions = _predictions_of(group, counts, things)
        instances_of_class = [p for c, p in sorted(predictions, key=lambda k: (-predictions[k], k)) if c == class_id]
        label = next((p for p in instances_of_class if p not in used), unused)
        unused = max(unused, label + 1)
        used.add(label)
        new_seen_in[label] = reduce(or_, (seen_in.get(p, 0) for p in instances_of_class), 0)
        best.update(dict.fromkeys(group, (class_id, label)))
    return Grouping(_with_labels(counts, best), best, new_seen_in)


def _scores_of(
    group: Iterable[int], scores: Mapping[int, Mapping[int, float]], things: frozenset[int]
) -> dict[int, float]:
    result: dict[int, float] = {}
    for segment in group:
        for class_id, score in scores[segment].items():
            if class_id in things:
                result[class_id] = result.get(class_id, 0.0) + score
    return result


def _predictions_of(group: Iterable[int], counts: TripleCounts, things: frozenset[int]) -> dict[tuple[int, int], int]:
    result: dict[tuple[int, int], int] = {}
    for segment in group:
        for (class_id, instance), count in counts.by_segment[segment].items():
            if class_id in things:
                result[class_id, instance] = result.get((class_id, instance), 0) + count
    return result


def _with_labels(counts: TripleCounts, best: Mapping[int, tuple[int, int]]) -> TripleCounts:
    """The counts with the instance label of its group on every segment that has one."""
    result = TripleCounts()
    for segment, row in counts.by_segment.items():
        for (class_id, instance), count in row.items():
            result.add(segment, class_id, best[segment][1] if segment in best else instance, count)
    return result


def group_things(
    counts: TripleCounts,
    evidence: PairEvidence,
    things: frozenset[int],
    seen_in: Mapping[int, int],
    minimum_votes: int = 1,
    *,
    scores: Mapping[int, Mapping[int, float]],
    unnamed: int | None = None,
) -> Grouping:
    """Return the things of a map: the segments whose leading class is one of things, partitioned and named.

    `scores`: by segment label and class the sum of the scores of all predictions (ClassScores); `unnamed`: the class
    of things that were found and not recognised.

    Segments whose leading class is stuff stay what they are from `minimum_votes` predictions of it on, and are nothing
    below: all of a stuff class is one instance, so that a wall that was taken for a curtain here and there would add
    up to a curtain.
    """
    classes = {}
    doubtful = []
    for segment, row in counts.by_segment.items():
        best = counts.best(segment)
        if best is not None and best[0] in things:
            thing_class = leading_class({c: s for c, s in scores[segment].items() if c in things}, unnamed)
            classes[segment] = thing_class if sum(row.values()) >= SURE_VOTES and thing_class != unnamed else 0
        elif best is not None and sum(counts.instances(segment, best[0]).values()) < minimum_votes:
            doubtful.append(segment)
    groups = attach_unseen_pairs(group_segments(pair_weights(classes, evidence), classes), evidence, counts)
    named_groups = name_groups(groups, counts, things, seen_in, scores, unnamed)
    return replace(named_groups, best={**named_groups.best, **dict.fromkeys(doubtful, NOTHING)}, class_scores=scores)


def _total(group: Iterable[int], counts: TripleCounts) -> int:
    return sum(sum(counts.by_segment[segment].values()) for segment in group)


def _leading_instance(group: Iterable[int], counts: TripleCounts) -> tuple[int, int] | None:
    votes: dict[tuple[int, int], int] = {}
    for segment in group:
        for key, count in counts.by_segment[segment].items():
            votes[key] = votes.get(key, 0) + count
    return min(votes, key=lambda k: (-votes[k], k)) if votes else None
