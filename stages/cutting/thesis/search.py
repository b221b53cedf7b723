"""Monte-Carlo tree search for the parse tree of greatest posterior (section 6.3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from scenewright.stages.cutting.thesis.induction import Grammar
from scipy.optimize import linear_sum_assignment

ROUNDS = 160
"""Rollouts a decision; the thesis does not say."""
EXPLORATION = 0.7
"""Weight of exploration; by eye."""
ANNEALED = 6
"""Rollouts, the best by prior and shapes, that are annealed for the layout: all of them would take minutes a cut."""
SWAPS = 60
"""Swaps of an annealing of the layout; by eye."""
UNMATCHED = math.log(1e-4)
"""Logarithm of the likelihood of a terminal without a fragment, or a fragment without a terminal; by eye."""


@dataclass
class ParseTree:
    """A forest over the present fragments: types of nodes, the production that each was expanded by, children."""

    kinds: list[int]
    rules: dict[int, int] = field(default_factory=dict)
    children: dict[int, tuple[int, ...]] = field(default_factory=dict)
    leaves: list[int] = field(default_factory=list)
    log_prior: float = 0.0

    @staticmethod
    def over(kinds: list[int]) -> ParseTree:
        """Return the forest whose nodes are the present fragments."""
        return ParseTree(list(kinds), leaves=list(range(len(kinds))))

    def copy(self) -> ParseTree:
        """Return a tree that can grow by itself."""
        return ParseTree(list(self.kinds), dict(self.rules), dict(self.children), list(self.leaves), self.log_prior)

    def expand(self, leaf: int, rule: int, grammar: Grammar) -> None:
        """Apply a production to a leaf."""
        production = grammar.productions[rule]
        first = len(self.kinds)
        self.kinds += production.right
        new_leaves = tuple(range(first, len(self.kinds)))
        self.rules[leaf], self.children[leaf] = rule, new_leaves
        self.leaves.remove(leaf)
        self.leaves += new_leaves
        self.log_prior += math.log(production.chance)


@dataclass
class _Node:
    tree: ParseTree
    untried: list[tuple[int, int]]
    children: list[_Node] = field(default_factory=list)
    visits: int = 0
    total: float = 0.0


class Search:
    """Looks for parse trees of one goal: log p(c|z) (G, K) of its fragments and their positions (G, 3) [m]."""

    def __init__(
        self, grammar: Grammar, log_types: np.ndarray, positions: np.ndarray, random: np.random.Generator
    ) -> None:
        self._grammar, self._log_types, self._positions, self._random = grammar, log_types, positions, random
        self._of_left = [grammar.of_left(kind) for kind in range(grammar.types)]
        self._weights = [np.array([grammar.productions[rule].chance for rule in rules]) for rules in self._of_left]

    def best(self, chances: np.ndarray) -> ParseTree:
        """Return the best tree found over fragments whose types have these chances (N, K)."""
        roots: dict[tuple[int, ...], _Node] = {}
        valued: list[tuple[float, int, ParseTree]] = []
        low, high = math.inf, -math.inf
        cumulated = chances.cumsum(axis=1)
        for number in range(ROUNDS):
            drawn = self._random.random(len(chances))[:, None] * cumulated[:, -1:]
            kinds = tuple((cumulated < drawn).sum(axis=1).tolist())
            if kinds not in roots:
                roots[kinds] = self._node(ParseTree.over(list(kinds)))
            path = self._descend(roots[kinds], low, high)
            tree = self._rollout(path[-1].tree.copy())
            value = tree.log_prior + self._shape(tree)[0]
            low, high = min(low, value), max(high, value)
            for node in path:
                node.visits += 1
                node.total += value
            valued.append((value, -number, tree))
        finalists = sorted(valued, key=lambda entry: entry[:2], reverse=True)[:ANNEALED]
        return max(finalists, key=lambda entry: entry[0] + self._layout(entry[2]))[2]

    def _node(self, tree: ParseTree) -> _Node:
        if len(tree.leaves) >= len(self._log_types):
            return _Node(tree, [])
        first_of_kind = {tree.kinds[leaf]: leaf for leaf in reversed(tree.leaves)}
        options = [(leaf, rule) for kind, leaf in sorted(first_of_kind.items()) for rule in self._of_left[kind]]
        return _Node(tree, [options[k] for k in self._random.permutation(len(options))])

    def _descend(self, node: _Node, low: float, high: float) -> list[_Node]:
        path = [node]
        while not node.untried and node.children:
            spread = max(high - low, 1e-9)
            log_visits = math.log(node.visits)
            node = max(
                node.children,
                key=lambda child: (
                    (child.total / child.visits - low) / spread + EXPLORATION * math.sqrt(log_visits / child.visits)
                ),
            )
            path.append(node)
        if node.untried:
            leaf, rule = node.untried.pop()
            tree = node.tree.copy()
            tree.expand(leaf, rule, self._grammar)
            node.children.append(self._node(tree))
            path.append(node.children[-1])
        return path

    def _rollout(self, tree: ParseTree) -> ParseTree:
        while len(tree.leaves) < len(self._log_types):
            open_leaves = [leaf for leaf in tree.leaves if self._of_left[tree.kinds[leaf]]]
            if not open_leaves:
                break
            leaf = open_leaves[int(self._random.integers(len(open_leaves)))]
            kind = tree.kinds[leaf]
            weights = self._weights[kind].cumsum()
            rule = int(np.searchsorted(weights, self._random.random() * weights[-1]))
            tree.expand(leaf, self._of_left[kind][min(rule, len(weights) - 1)], self._grammar)
        return tree

    def _shape(self, tree: ParseTree) -> tuple[float, dict[int, int]]:
        """Return the logarithm of eq. 6.5 under the best assignment, and that assignment leaf -> goal fragment."""
        kinds = [tree.kinds[leaf] for leaf in tree.leaves]
        gain = self._log_types[:, kinds].T
        rows, columns = linear_sum_assignment(-gain)
        unmatched = abs(len(kinds) - len(self._log_types))
        assigned = {tree.leaves[r]: c for r, c in zip(rows.tolist(), columns.tolist(), strict=True)}
        return float(gain[rows, columns].sum()) + UNMATCHED * unmatched, assigned

    def _layout(self, tree: ParseTree) -> float:
        """Return the logarithm of eq. 6.6, annealed by swapping fragments between terminals of one type."""
        _, assigned = self._shape(tree)
        leaves = [leaf for leaf in tree.leaves if leaf in assigned]
        places = {leaf: self._positions[assigned[leaf]] for leaf in leaves}
        energy = best = self._energy(tree, places)
        by_kind: dict[int, list[int]] = {}
        for leaf in leaves:
            by_kind.setdefault(tree.kinds[leaf], []).append(leaf)
        pools = [pool for pool in by_kind.values() if len(pool) > 1]
        for step in range(SWAPS if pools else 0):
            pool = pools[int(self._random.integers(len(pools)))]
            a, b = (pool[k] for k in self._random.permutation(len(pool))[:2])
            places[a], places[b] = places[b], places[a]
            after = self._energy(tree, places)
            if after <= energy or self._random.random() < math.exp((energy - after) / (0.05 * (1 - step / SWAPS))):
                energy = after
                best = min(best, energy)
            else:
                places[a], places[b] = places[b], places[a]
        return -best

    def _energy(self, tree: ParseTree, places: dict[int, np.ndarray]) -> float:
        """Return the sum of distances [m] of nodes to the node that they came from, each the mean of its fragments."""
        means: dict[int, tuple[np.ndarray, int]] = {leaf: (position, 1) for leaf, position in places.items()}
        total = 0.0
        for node in sorted(tree.children, reverse=True):  # children have greater numbers: from below
            child_means = [means[child] for child in tree.children[node] if child in means]
            if not child_means:
                continue
            count = sum(n for _, n in child_means)
            middle = sum((mean * n for mean, n in child_means), np.zeros(3)) / count
            means[node] = middle, count
            total += sum(float(np.linalg.norm(mean - middle)) for mean, _ in child_means)
        return total
