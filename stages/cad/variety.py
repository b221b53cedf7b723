"""Ours: candidates of many models, though one model that is turned and opened in many ways may rank before all others.

A round bin has a dozen equal candidates, a fridge with two doors sixty-four. What is kept of a ranking is half by rank;
for the other half the models take turns, so that none is left out because of what another looks like turned.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

Ranked = TypeVar("Ranked")


def varied(ranked: Sequence[Ranked], keep: int, model_of: Callable[[Ranked], Hashable]) -> list[Ranked]:
    """Return `keep` of a ranking, best first, in its order: the better half by rank alone, then the best that is left
    of the model with fewest there already, and so on; of equals the one that ranks first."""
    if len(ranked) <= keep:
        return list(ranked)
    chosen = list(range((keep + 1) // 2))
    model_uses: dict[Hashable, int] = defaultdict(int)
    for rank in chosen:
        model_uses[model_of(ranked[rank])] += 1
    turns = []
    for rank in range(len(chosen), len(ranked)):
        model = model_of(ranked[rank])
        turns.append((model_uses[model], rank))
        model_uses[model] += 1
    chosen += [rank for _, rank in sorted(turns)[: keep - len(chosen)]]
    return [ranked[rank] for rank in sorted(chosen)]
