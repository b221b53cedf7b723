"""Pose-graph optimisation: Gauss-Newton on SE(3) with switchable loop edges.

Loop edges are scaled down by their own contradiction (dynamic covariance scaling, Agarwal et al. 2013, the closed form
of the switchable constraints of Suenderhauf and Protzel 2012), so that a wrong loop cannot fold the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.rigid_motion import adjoint, exponential, inverses, logarithm, orthonormal
from scipy.sparse import coo_matrix, csc_matrix, diags_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

SWITCH = 12.0
"""Phi of dynamic covariance scaling: loop edges whose squared error is above it (6 degrees of freedom, of which two
standard deviations each) begin to lose weight."""
SWITCHES = (1e4, 1e2, SWITCH)
"""Phi from believing all loops to dropping those that contradict the others: far drift is no reason to drop one."""
ANCHOR = 1e12
"""Information with which the first node of each connected part is held."""
MAXIMUM_ITERATIONS = 50
"""Most iterations of the optimisation; by eye."""


@dataclass(frozen=True)
class Edge:
    """A measured relative pose between two nodes."""

    target: int
    source: int
    target_from_source: np.ndarray
    """(4, 4)."""
    information: np.ndarray
    """(6, 6) of a perturbation from the left."""
    switchable: bool = False
    """Loop edges are; odometry is not."""


@dataclass(frozen=True)
class Solution:
    """Optimised poses and what the edges say of them."""

    world_from_node: np.ndarray
    """(N, 4, 4)."""
    weights: np.ndarray
    """(E,) in [0, 1]: how much of each edge was believed; odometry 1."""
    squared_errors: np.ndarray
    """(E,) Mahalanobis distances squared before scaling."""
    normal_matrix: csc_matrix
    """(6N, 6N) of left perturbations of all nodes; of size 0 without nodes."""
    iterations: int

    @cached_property
    def covariances(self) -> np.ndarray:
        """(N, 6, 6) of a left perturbation of each node in the world, the first node of its part being exact."""
        return _covariances(self.normal_matrix)

    @property
    def variance_factor(self) -> float:
        """Mean squared error per degree of freedom of the believed edges: 1 when the information was honest."""
        believed = self.weights > 0.5
        freedom = 6 * max(int(believed.sum()) - len(self.world_from_node) + 1, 0)
        return float(self.squared_errors[believed].sum() / freedom) if freedom else 1.0


def parts_of(nodes: int, edges: Sequence[Edge]) -> np.ndarray:
    """Return the connected part (N,) of every node."""
    rows, columns = [e.target for e in edges], [e.source for e in edges]
    graph = coo_matrix((np.ones(len(edges)), (rows, columns)), shape=(nodes, nodes))
    return connected_components(graph, directed=False)[1]


def laid_out(poses: np.ndarray, edges: Sequence[Edge]) -> np.ndarray:
    """Return poses (N, 4, 4) in which parts that only loop edges join stand where these put them.

    The non-switchable edges make parts that are moved as a whole, the largest staying where it is.
    """
    poses = np.array(poses, dtype=float)
    part = parts_of(len(poses), [edge for edge in edges if not edge.switchable])
    placed = {int(np.argmax(np.bincount(part)))}
    waiting = [edge for edge in edges if part[edge.target] != part[edge.source]]
    waiting.sort(key=lambda edge: -float(np.linalg.eigvalsh(edge.information)[0]))
    while True:
        for edge in waiting:
            has_target, has_source = part[edge.target] in placed, part[edge.source] in placed
            if has_target == has_source:
                continue
            if has_target:
                moved = int(part[edge.source])
                motion = poses[edge.target] @ edge.target_from_source @ inverse(poses[edge.source])
            else:
                moved = int(part[edge.target])
                motion = poses[edge.source] @ inverse(edge.target_from_source) @ inverse(poses[edge.target])
            rows = part == moved
            poses[rows] = motion @ poses[rows]
            placed.add(moved)
            break
        else:
            return poses


def optimize(world_from_node: np.ndarray, edges: Sequence[Edge], *, switch: float = SWITCH) -> Solution:
    """Return the poses (N, 4, 4) that agree best with the edges, starting from `world_from_node`.

    The first node of every connected part stays where it is. Without edges the poses are returned as they are.
    """
    poses = np.array(world_from_node, dtype=float)
    if not len(poses):
        return Solution(poses, np.zeros(0), np.zeros(0), csc_matrix((0, 0)), 0)
    part = parts_of(len(poses), edges)
    anchors = np.unique(part, return_index=True)[1]
    graph = _Graph(edges)
    weights, errors = _weigh(poses, graph, switch)
    cost = _cost(errors, graph, switch)
    damping, iterations = 1e-6, 0
    while iterations < MAXIMUM_ITERATIONS and edges:
        iterations += 1
        matrix, right = _assemble(poses, graph, weights, anchors)
        damped = (matrix + diags_array(damping * matrix.diagonal())).tocsc()
        twists = splu(damped).solve(right).reshape(-1, 6)
        moved = orthonormal(exponential(twists) @ poses)
        new_weights, new_errors = _weigh(moved, graph, switch)
        new_cost = _cost(new_errors, graph, switch)
        if new_cost > cost * (1 + 1e-12):
            damping *= 10
            if damping > 1e4:
                break
            continue
        done = cost - new_cost < 1e-9 * cost + 1e-12
        poses, weights, errors, cost, damping = moved, new_weights, new_errors, new_cost, max(damping / 10, 1e-9)
        if done:
            break
    matrix, _ = _assemble(poses, graph, weights, anchors)
    return Solution(poses, weights, errors, matrix, iterations)


def optimize_gradually(world_from_node: np.ndarray, edges: Sequence[Edge]) -> Solution:
    """As `optimize`, for a start that has drifted by more than loops claim to be uncertain: at first every loop is
    believed, then those less and less that the others contradict (graduated non-convexity, Yang et al. 2020)."""
    for switch in SWITCHES:
        solution = optimize(world_from_node, edges, switch=switch)
        world_from_node = solution.world_from_node
    return solution


def squared_errors(poses: np.ndarray, edges: Sequence[Edge]) -> np.ndarray:
    """Return by how much poses (N, 4, 4) contradict the edges: Mahalanobis distances squared (E,)."""
    return _weigh(poses, _Graph(edges), SWITCH)[1]


class _Graph:
    """The edges as arrays."""

    def __init__(self, edges: Sequence[Edge]) -> None:
        self.targets = np.array([edge.target for edge in edges], dtype=int)
        self.sources = np.array([edge.source for edge in edges], dtype=int)
        self.inverse_motions = inverses(np.array([edge.target_from_source for edge in edges]).reshape(-1, 4, 4))
        self.information = np.array([edge.information for edge in edges]).reshape(-1, 6, 6)
        self.switchable = np.array([edge.switchable for edge in edges], dtype=bool)

    def residuals(self, poses: np.ndarray) -> np.ndarray:
        """Return the twists (E, 6) by which poses differ from the edges, left perturbations in the targets' frames."""
        return logarithm(inverses(poses[self.targets]) @ poses[self.sources] @ self.inverse_motions)


def _weigh(poses: np.ndarray, graph: _Graph, switch: float) -> tuple[np.ndarray, np.ndarray]:
    twists = graph.residuals(poses)
    errors = np.einsum("ei,eij,ej->e", twists, graph.information, twists)
    scale = np.where(graph.switchable, np.minimum(1.0, 2.0 * switch / (switch + errors)), 1.0)
    return scale**2, errors


def _cost(errors: np.ndarray, graph: _Graph, switch: float) -> float:
    """The robust cost whose reweighted least squares these are: quadratic below `switch`, then saturating."""
    scale = np.minimum(1.0, 2.0 * switch / (switch + errors))
    return float(np.where(graph.switchable, scale**2 * errors + switch * (1 - scale) ** 2, errors).sum())


def _assemble(
    poses: np.ndarray, graph: _Graph, weights: np.ndarray, anchors: np.ndarray
) -> tuple[csc_matrix, np.ndarray]:
    """Return the normal matrix (6N, 6N) and the right side (6N,)."""
    # r = log(Ti^-1 Tj Z^-1); a left step of both nodes changes it by Ad(Ti^-1) (dj - di) to first order.
    jacobians = adjoint(inverses(poses[graph.targets]))
    weighted = weights[:, None, None] * np.swapaxes(jacobians, 1, 2) @ graph.information
    contents = weighted @ jacobians
    gradients = (weighted @ graph.residuals(poses)[..., None])[..., 0]
    right = np.zeros((len(poses), 6))
    np.add.at(right, graph.targets, gradients)
    np.subtract.at(right, graph.sources, gradients)
    i, j = graph.targets, graph.sources
    first = np.concatenate([i, j, i, j, anchors])
    second = np.concatenate([i, j, j, i, anchors])
    anchor_blocks = np.repeat(ANCHOR * np.eye(6)[None], len(anchors), axis=0)
    values = np.concatenate([contents, contents, -contents, -contents, anchor_blocks])
    row, column = np.divmod(np.arange(36), 6)
    rows, columns = 6 * first[:, None] + row, 6 * second[:, None] + column
    shape = (6 * len(poses), 6 * len(poses))
    matrix = coo_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
    return matrix.tocsc(), right.reshape(-1)


def _covariances(matrix: csc_matrix) -> np.ndarray:
    """Return the diagonal blocks (N, 6, 6) of the inverse."""
    solver = splu(matrix)
    count = matrix.shape[0] // 6
    result = np.zeros((count, 6, 6))
    for node in range(count):
        columns = np.zeros((6 * count, 6))
        columns[6 * node : 6 * node + 6] = np.eye(6)
        result[node] = solver.solve(columns)[6 * node : 6 * node + 6]
    return result
