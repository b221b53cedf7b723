"""Types by clustering features, productions by counting, as many types as eq. 6.1 likes best (section 6.2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting.corpus import Corpus
from scipy.cluster.vq import kmeans2

MOST_TYPES = 9
"""Most types that are tried; by eye."""
GAMMA = 0.28
"""Coefficient of the model's size in eq. 6.1, per production of the corpus. The thesis states neither its value nor its
sign: with fewer types productions become likelier, so that a grammar of one type would win were it not positive. At
this value as many types are taken as may be; on tuning seeds 3 to 16 made no difference beyond chance, 7 and 9 came
out best."""


@dataclass(frozen=True)
class Production:
    """alpha -> beta, with its probability (eq. 6.2)."""

    left: int
    right: tuple[int, ...]
    """Ascending."""
    chance: float


@dataclass(frozen=True)
class Grammar:
    """Types by their centres (K, 17), and productions."""

    centres: np.ndarray
    productions: tuple[Production, ...]

    @property
    def types(self) -> int:
        """How many."""
        return len(self.centres)

    def of_left(self, kind: int) -> list[int]:
        """Return the numbers of the productions that cut a type."""
        return [number for number, rule in enumerate(self.productions) if rule.left == kind]


def induce(features: np.ndarray, corpus: Corpus, seed: int) -> tuple[Grammar, np.ndarray]:
    """Return the grammar and the types (N,) of the corpus's pieces."""
    best: tuple[float, Grammar, np.ndarray] | None = None
    for count in range(2, min(MOST_TYPES, len(features) // 3) + 1):
        centres, types = kmeans2(features, count, minit="++", seed=np.random.default_rng([seed, 2, count]), iter=100)
        types_used, types = np.unique(types, return_inverse=True)
        grammar, likelihood = _count_rules(centres[types_used], types, corpus)
        score = likelihood + GAMMA * len(corpus.choices) * grammar.types
        if best is None or score > best[0]:
            best = score, grammar, types
    assert best is not None
    return best[1], best[2]


def production_of(choice_piece: int, results: tuple[int, ...], types: np.ndarray) -> tuple[int, tuple[int, ...]]:
    """Return the types before and after a cut."""
    return int(types[choice_piece]), tuple(sorted(int(types[k]) for k in results))


def _count_rules(centres: np.ndarray, types: np.ndarray, corpus: Corpus) -> tuple[Grammar, float]:
    rule_counts: dict[tuple[int, tuple[int, ...]], int] = {}
    of_left: dict[int, int] = {}
    for choice in corpus.choices:
        key = production_of(choice.piece, choice.results, types)
        rule_counts[key] = rule_counts.get(key, 0) + 1
        of_left[key[0]] = of_left.get(key[0], 0) + 1
    rules = tuple(Production(parent, right, n / of_left[parent]) for (parent, right), n in sorted(rule_counts.items()))
    likelihood = sum(n * np.log(n / of_left[parent]) for (parent, _), n in rule_counts.items())
    return Grammar(centres, rules), float(likelihood)
