"""Edit distance between support trees, counted as the thesis counts (Han 2024, section 2.5.3, table 2.5).

Operations: insert or remove a node, insert or remove an edge, substitute a node's id (its class). A node is
inserted or removed together with the edge to its parent, for 1; substituting a class costs 1; an entity whose
parent is another one costs 2 (remove the edge, add the edge). Checked against all four rows of table 2.5:
total = 2 x wrong supports + missing + wrong detections.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.schemas.contact_graph import SCENE_NODE, ContactGraphFile
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scipy.optimize import linear_sum_assignment

WRONG_SUPPORT_COST = 2
"""Edits of a wrong support: the edge goes, and another one comes."""
EXPANSION_BUDGET = 200_000
"""Most nodes of the search tree that are expanded; by eye."""


@dataclass(frozen=True)
class SupportTree:
    """Nodes without the root, parents before children. `parents` holds node ids or the root's id."""

    names: tuple[str, ...]
    classes: tuple[str, ...]
    parents: tuple[str, ...]
    optional: frozenset[str] = frozenset()
    """True nodes that cost nothing when they are missing (the camera never saw them)."""

    def parent_rows(self) -> np.ndarray:
        """(N,) row of each node's parent, -1 for the root."""
        row = {name: index for index, name in enumerate(self.names)}
        return np.array([row.get(parent, -1) for parent in self.parents], dtype=int)


def support_tree(graph: ContactGraphFile, optional: frozenset[str] = frozenset()) -> SupportTree:
    """Return the parse tree of a contact graph in breadth-first order, children by id. Proximal edges are no part.

    Nodes without a directed edge hang on the root. Raises BadInput when the supports form a circle.
    """
    parent = {n.id: SCENE_NODE for n in graph.nodes if n.node_type != "scene"}
    for link in graph.links:
        if link.relation in TREE_RELATIONS and link.target in parent:
            parent[link.target] = link.source if link.source in parent else SCENE_NODE
    classes = {n.id: n.class_name for n in graph.nodes}
    ordered: list[str] = []
    level = sorted(name for name, above in parent.items() if above == SCENE_NODE)
    while level:
        ordered += level
        below = set(level)
        level = sorted(name for name, above in parent.items() if above in below)
    if len(ordered) != len(parent):
        circle = sorted(set(parent) - set(ordered))
        raise BadInput(f"contact graph: the supports form a circle: {', '.join(circle)}", hint="make the graph again")
    return SupportTree(tuple(ordered), tuple(classes[n] for n in ordered), tuple(parent[n] for n in ordered), optional)


@dataclass(frozen=True)
class EditDistance:
    """The distance, what it consists of, and the pairing of nodes behind it (true name, predicted name)."""

    total: int
    wrong_supports: tuple[tuple[str, str], ...]
    """Pairs whose parents differ, 2 each."""
    missing: tuple[str, ...]
    """True nodes without a partner, 1 each (optional ones are left out)."""
    extra: tuple[str, ...]
    """Predicted nodes without a partner, 1 each."""
    substituted: tuple[tuple[str, str], ...]
    """Pairs of different classes, 1 each. The thesis lists them, with `extra`, as wrong detections."""
    pairs: tuple[tuple[str, str], ...]
    exact: bool
    """Whether the total is proved minimal over the allowed pairings."""

    @property
    def wrong_detections(self) -> int:
        """The thesis's third column: extra nodes and wrong classes."""
        return len(self.extra) + len(self.substituted)


class _Problem:
    """The search: true nodes in breadth-first order, each takes one free allowed predicted node or none.

    A parent is decided before its children, so the cost of every edge is known when its child is decided.
    """

    def __init__(self, true: SupportTree, predicted: SupportTree, affinity: np.ndarray) -> None:
        self.true, self.predicted, self.affinity = true, predicted, affinity
        self.true_parent = true.parent_rows()
        self.predicted_parent = predicted.parent_rows()
        self.substitution = np.array(
            [[int(a != b) for b in predicted.classes] for a in true.classes], dtype=int
        ).reshape(len(true.names), len(predicted.names))
        self.skip = np.array([0 if name in true.optional else 1 for name in true.names], dtype=int)
        self.candidates = [
            sorted((int(j) for j in np.nonzero(affinity[i] > 0)[0]), key=lambda j: (-affinity[i, j], j))
            for i in range(len(true.names))
        ]

    def edge_cost(self, mapping: list[int], i: int, j: int) -> int:
        """2 when the parents of true node i and predicted node j are no pair."""
        above, below = self.true_parent[i], self.predicted_parent[j]
        partner = -1 if above < 0 else mapping[above]
        agree = (above < 0 and below < 0) or (above >= 0 and below >= 0 and partner == below)
        return 0 if agree else WRONG_SUPPORT_COST

    def cost(self, mapping: list[int]) -> tuple[int, float]:
        """(edit cost, minus the summed affinity): the second breaks ties towards pairs that lie over each other."""
        total, closeness = 0, 0.0
        for i, j in enumerate(mapping):
            if j < 0:
                total += int(self.skip[i])
            else:
                total += int(self.substitution[i, j]) + self.edge_cost(mapping, i, j)
                closeness += float(self.affinity[i, j])
        return total + len(self.predicted.names) - sum(j >= 0 for j in mapping), -closeness

    def first_guess(self) -> list[int]:
        """The assignment that is optimal for the nodes alone (Jonker-Volgenant; Riesen and Bunke 2009)."""
        n, m = self.affinity.shape
        if not n or not m:
            return [-1] * n
        forbidden = 1e6
        cost = np.full((n + m, n + m), forbidden)
        pair = self.substitution - 1e-3 * self.affinity
        cost[:n, :m] = np.where(self.affinity > 0, pair, forbidden)
        cost[:n, m:][np.arange(n), np.arange(n)] = self.skip
        cost[n:, :m][np.arange(m), np.arange(m)] = 1.0
        cost[n:, m:] = 0.0
        rows, columns = linear_sum_assignment(cost)
        mapping = [-1] * n
        for i, j in zip(rows, columns, strict=True):
            if i < n and j < m and self.affinity[i, j] > 0:
                mapping[i] = int(j)
        return mapping

    def search(self, mapping: list[int], budget: int) -> tuple[list[int], bool]:
        """Depth-first branch and bound from a first guess. Returns the best mapping and whether it is minimal."""
        n, m = self.affinity.shape
        best, best_cost = list(mapping), self.cost(mapping)
        cheapest = [
            min([int(self.skip[i])] + [int(self.substitution[i, j]) - 1 for j in self.candidates[i]]) for i in range(n)
        ]
        bound_below = np.concatenate([np.cumsum(cheapest[::-1])[::-1], [0]]).astype(int)
        closest = [max([0.0] + [float(self.affinity[i, j]) for j in self.candidates[i]]) for i in range(n)]
        closeness_below = np.concatenate([np.cumsum(closest[::-1])[::-1], [0.0]])
        used = [False] * m
        current = [-1] * n
        steps_left = budget

        def descend(i: int, cost: int, closeness: float) -> None:
            nonlocal best, best_cost, steps_left
            if steps_left <= 0:
                return
            steps_left -= 1
            # `cost` counts every free predicted node as extra; a pair takes one off, hence the -1 in `cheapest`.
            if (cost + bound_below[i], -closeness - closeness_below[i] + 1e-9) >= best_cost:
                return
            if i == n:
                best, best_cost = list(current), (cost, -closeness)
                return
            for j in self.candidates[i]:
                if not used[j]:
                    used[j], current[i] = True, j
                    step = int(self.substitution[i, j]) + self.edge_cost(current, i, j) - 1
                    descend(i + 1, cost + step, closeness + float(self.affinity[i, j]))
                    used[j], current[i] = False, -1
            descend(i + 1, cost + int(self.skip[i]), closeness)

        descend(0, m, 0.0)
        return best, steps_left > 0


def graph_edit_distance(
    true: SupportTree, predicted: SupportTree, affinity: np.ndarray | None = None, *, budget: int = EXPANSION_BUDGET
) -> EditDistance:
    """Fewest operations that turn `predicted` into `true`, with the thesis's costs.

    `affinity` (N, M): > 0 where a true and a predicted node may be the same entity (their IoU, say); ties in the
    cost go to the higher sum. None allows all pairs. The assignment that is optimal for the nodes alone is
    improved by branch and bound over at most `budget` expansions; `exact` says whether the search was completed.
    Without completion the total is an upper bound of the distance.
    """
    shape = (len(true.names), len(predicted.names))
    affinity = np.ones(shape) if affinity is None else np.asarray(affinity, dtype=float).reshape(shape)
    problem = _Problem(true, predicted, affinity)
    mapping, exact = problem.search(problem.first_guess(), budget)
    return describe_mapping(true, predicted, mapping, exact=exact)


def describe_mapping(
    true: SupportTree, predicted: SupportTree, mapping: list[int], *, exact: bool = False
) -> EditDistance:
    """Break a pairing down. `mapping` (N,) row of the predicted node of each true node, -1 for none."""
    problem = _Problem(true, predicted, np.ones((len(true.names), len(predicted.names))))
    pairs = tuple((true.names[i], predicted.names[j]) for i, j in enumerate(mapping) if j >= 0)
    wrong = tuple(
        (true.names[i], predicted.names[j])
        for i, j in enumerate(mapping)
        if j >= 0 and problem.edge_cost(mapping, i, j)
    )
    substituted = tuple(
        (true.names[i], predicted.names[j]) for i, j in enumerate(mapping) if j >= 0 and problem.substitution[i, j]
    )
    missing = tuple(true.names[i] for i, j in enumerate(mapping) if j < 0 and problem.skip[i])
    used = {j for j in mapping if j >= 0}
    extra = tuple(name for j, name in enumerate(predicted.names) if j not in used)
    total = WRONG_SUPPORT_COST * len(wrong) + len(missing) + len(extra) + len(substituted)
    return EditDistance(total, wrong, missing, extra, substituted, pairs, exact)
