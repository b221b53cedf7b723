"""Types of fragments and rules over them, as many as describe the demonstrations shortest.

Two-part code over the demonstrations: each piece's edges given its type (a Gaussian whose numbers are paid for), each
object's type, and each cut (axis of the piece, types of what came of it) given the type of what was cut. Rules are
coded with what was seen so far (Krichevsky and Trofimov 1981), so that they need no prices of their own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scenewright.stages.cutting.demonstrations.cutter import Demonstration
from scenewright.stages.cutting.demonstrations.recipes import CATEGORIES
from scenewright.stages.cutting.ours.items import features, item_of
from scenewright.stages.cutting.world.canonical import axis_across
from scenewright.stages.kit.compiled import compiled
from scipy.cluster.vq import kmeans2

MOST_TYPES = 12
"""Most types that are tried; by eye."""
LEAST_DEVIATION = 0.05
"""Least standard deviation of a logarithm of an edge within a type; by eye."""
PIECES_OF_TYPE = 4
"""Pieces that a type has on average at least; by eye."""
AXES = 3
"""Axes along which a rule may cut."""


@dataclass(frozen=True)
class Rule:
    """A piece of type `parent` was cut across its axis (0 the shortest) into pieces of two types, in order."""

    parent: int
    axis: int
    children: tuple[int, int]
    seen: int


@dataclass(frozen=True)
class Grammar:
    """What was learned."""

    means: np.ndarray
    """(K, 3): logarithms of the edges [m], shortest first."""
    deviations: np.ndarray
    """(K, 3)."""
    shares: np.ndarray
    """(K,): how common a type is."""
    rules: tuple[Rule, ...]
    named: np.ndarray
    """(K, categories): fragments of a type that were called so."""
    ratios: np.ndarray
    """(categories, 2, 2): mean and deviation of log(edge / next shorter edge) of fragments of a category."""
    scatter: np.ndarray
    """(4,): deviation of features among fragments that were meant to be alike."""
    bits: float
    """Description length of the demonstrations."""

    @property
    def types(self) -> int:
        """How many."""
        return len(self.means)

    def log_likelihoods(self, edges: np.ndarray) -> np.ndarray:
        """Return log p(edges, type) (N, K) of logarithms of edges (N, 3)."""
        off = (edges[:, None] - self.means) / self.deviations
        density = -0.5 * (off**2).sum(axis=2) - np.log(self.deviations).sum(axis=1)
        return np.asarray(density + np.log(self.shares))

    def type_of(self, edges: np.ndarray) -> np.ndarray:
        """Return the likeliest types (N,)."""
        return np.asarray(self.log_likelihoods(edges).argmax(axis=1))

    def type_of_box(self, edges: Sequence[float]) -> int:
        """Return the likeliest type of one box with these edges [m], in any order."""
        return int(_type_of_box(*edges, *self._plain))  # type: ignore[call-arg, arg-type]

    @cached_property
    def _plain(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.log(self.shares) - np.log(self.deviations).sum(axis=1), self.means, self.deviations

    @cached_property
    def _rule_counts(self) -> dict[int, dict[tuple[int, tuple[int, int]], int]]:
        counts_of_parent: dict[int, dict[tuple[int, tuple[int, int]], int]] = {}
        for rule in self.rules:
            counts_of_parent.setdefault(rule.parent, {})[rule.axis, rule.children] = rule.seen
        return counts_of_parent

    def rule_bits(self, parent: int, axis: int, children: tuple[int, int]) -> float:
        """Return the code length of a rule [bits]: short for what was often seen of a type."""
        pair = (min(children), max(children))
        counts = self._rule_counts.get(parent, {})
        possible = AXES * self.types * (self.types + 1) / 2
        return -math.log2((counts.get((axis, pair), 0) + 0.5) / (sum(counts.values()) + 0.5 * possible))

    def category_of(self, edges: np.ndarray) -> np.ndarray:
        """Return the likeliest category (N,) of fragments, through their types."""
        likelihood = self.log_likelihoods(edges)
        weights = np.exp(likelihood - likelihood.max(axis=1, keepdims=True))
        chances = (self.named + 0.1) / (self.named + 0.1).sum(axis=1, keepdims=True)
        return np.asarray((weights @ chances).argmax(axis=1))


@compiled
def _type_of_box(a: float, b: float, c: float, constants: np.ndarray, means: np.ndarray, deviations: np.ndarray) -> int:
    logs = np.log(np.sort(np.array([a, b, c])))
    return int(np.argmax(constants - 0.5 * (((logs - means) / deviations) ** 2).sum(axis=1)))


@dataclass(frozen=True)
class _Corpus:
    """Demonstrations as arrays: pieces (N, 4) of features, cuts (parent, axis, first, second)."""

    pieces: np.ndarray
    roots: np.ndarray
    cuts: np.ndarray


def learn(demonstrations: Sequence[Demonstration], seed: int) -> Grammar:
    """Return types and rules. Demonstrations that stop midway teach their cuts, but not what fragments are called.

    Raises ValueError where too little was cut for one type.
    """
    corpus = _corpus(demonstrations)
    if len(corpus.cuts) == 0:
        raise ValueError("no demonstration cuts anything")
    if len(corpus.pieces) < PIECES_OF_TYPE:
        raise ValueError(f"{len(corpus.pieces)} pieces, whole ones too; at least {PIECES_OF_TYPE} are needed")
    most = min(MOST_TYPES, len(corpus.pieces) // PIECES_OF_TYPE)
    tried = [_fit(corpus, count, seed) for count in range(1, most + 1)]
    best = min(tried, key=lambda grammar: grammar.bits)
    return _with_names(best, demonstrations)


def _corpus(demonstrations: Sequence[Demonstration]) -> _Corpus:
    rows: list[np.ndarray] = []
    roots: list[int] = []
    cuts: list[tuple[int, int, int, int]] = []
    for demonstration in demonstrations:
        start = len(rows)
        rows += list(features([item_of(body, k) for k, body in enumerate(demonstration.pieces)]))
        roots += [start + k for k in range(len(demonstration.objects))]
        for cut in demonstration.cuts:
            axis = axis_across(demonstration.pieces[cut.piece], cut.plane.normal)
            largest = sorted(cut.results, key=lambda n: -demonstration.pieces[n].volume)[:2]
            cuts.append((start + cut.piece, axis, start + largest[0], start + largest[1]))
    return _Corpus(np.array(rows).reshape(-1, 4), np.array(roots, int), np.array(cuts, int).reshape(-1, 4))


def _fit(corpus: _Corpus, count: int, seed: int) -> Grammar:
    edges = corpus.pieces[:, :3]
    _, types = kmeans2(edges, count, minit="++", seed=np.random.default_rng([seed, count]), iter=50)
    types = np.unique(types, return_inverse=True)[1]
    type_count = types.max() + 1
    means = np.stack([edges[types == k].mean(axis=0) for k in range(type_count)])
    deviations = np.stack([np.maximum(edges[types == k].std(axis=0), LEAST_DEVIATION) for k in range(type_count)])
    shares = np.bincount(types, minlength=type_count) / len(types)
    off = (edges - means[types]) / deviations[types]
    nats = 0.5 * (off**2).sum() + np.log(deviations[types] * np.sqrt(2 * np.pi)).sum()
    prices = 0.5 * means.size * 2 * np.log2(len(edges))
    root_bits = -np.log2(shares[types[corpus.roots]]).sum()
    rule_counts: dict[tuple[int, int, int, int], int] = {}
    of_parent = np.zeros(type_count)
    possible = AXES * type_count * (type_count + 1) / 2
    rule_bits = 0.0
    for parent, axis, first, second in corpus.cuts:
        low, high = sorted((int(types[first]), int(types[second])))
        key = (int(types[parent]), int(axis), low, high)
        rule_bits -= np.log2((rule_counts.get(key, 0) + 0.5) / (of_parent[key[0]] + 0.5 * possible))
        rule_counts[key] = rule_counts.get(key, 0) + 1
        of_parent[key[0]] += 1
    rules = tuple(
        Rule(parent, axis, (low, high), times) for (parent, axis, low, high), times in sorted(rule_counts.items())
    )
    empty = np.zeros((type_count, len(CATEGORIES)))
    bits = float(nats / np.log(2) + prices + root_bits + rule_bits)
    return Grammar(means, deviations, shares, rules, empty, np.zeros((len(CATEGORIES), 2, 2)), np.ones(4), bits)


def _with_names(grammar: Grammar, demonstrations: Sequence[Demonstration]) -> Grammar:
    """Return the grammar with what fragments are called, and how far those that were meant to be alike differ."""
    category_counts = np.zeros((grammar.types, len(CATEGORIES)))
    ratios: list[list[np.ndarray]] = [[] for _ in CATEGORIES]
    spread: list[np.ndarray] = []
    for demonstration in demonstrations:
        if not demonstration.finished:
            continue
        for number, category in enumerate(CATEGORIES):
            pieces = [
                demonstration.pieces[k] for k in demonstration.final if demonstration.categories.get(k) == category
            ]
            if not pieces:
                continue
            rows = features([item_of(body, k) for k, body in enumerate(pieces)])
            category_counts[:, number] += np.bincount(grammar.type_of(rows[:, :3]), minlength=grammar.types)
            ratios[number].append(np.diff(rows[:, :3], axis=1))
            spread.append(rows - rows.mean(axis=0))
    shapes = np.tile([[0.0, 0.0], [1.0, 1.0]], (len(CATEGORIES), 1, 1))  # of what was never shown, anything
    for number, ratios_of_type in enumerate(ratios):
        if ratios_of_type:
            together = np.concatenate(ratios_of_type)
            shapes[number] = together.mean(axis=0), np.maximum(together.std(axis=0), LEAST_DEVIATION)
    together = np.concatenate(spread) if spread else np.full((1, 4), 0.2)
    scatter = np.maximum(np.sqrt((together**2).mean(axis=0)), LEAST_DEVIATION)
    return replace(grammar, named=category_counts, ratios=shapes, scatter=scatter)
