"""Landmarks of a task: atoms that every plan makes true at some time, with orders, and how many are still to do.

After Richter & Westphal 2010 ("The LAMA planner", sections 4 and 5): the heuristic counts the landmarks that a path has
not yet accepted, and those that it accepted and needs again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenewright.stages.kit.tasks.relaxed import FAR, Relaxed, costs


@dataclass(frozen=True)
class Landmarks:
    """Atoms (K,) and orders between them, (K, K) with [k, m]: m comes before k."""

    atoms: np.ndarray
    before: np.ndarray
    """All orders that acceptance asks for: necessary ones and reasonable ones."""
    needed: np.ndarray
    """Necessary ones: m is true right before k becomes true for the first time."""
    goal: np.ndarray
    """(K,) which of them are goals."""
    first: np.ndarray
    """(K,) which are accepted at the beginning."""

    def accept(self, accepted: np.ndarray, state: np.ndarray) -> np.ndarray:
        """Return what is accepted (K,) after a step to `state` (A,): landmarks that hold, all before them accepted."""
        is_true = state[self.atoms].astype(bool)
        ready = ~(self.before & ~accepted[None, :]).any(axis=1)
        return accepted | (is_true & ready)

    def left(self, accepted: np.ndarray, state: np.ndarray) -> int:
        """Return how many landmarks are not accepted, or are but have to be true again."""
        is_true = state[self.atoms].astype(bool)
        is_needed = self.goal | (self.needed & ~accepted[:, None]).any(axis=0)
        return int((~accepted | (~is_true & is_needed)).sum())

    def achievers_wanted(self, accepted: np.ndarray) -> np.ndarray:
        """Return the atoms of the landmarks that could be accepted next."""
        ready = ~(self.before & ~accepted[None, :]).any(axis=1)
        return self.atoms[ready & ~accepted]


def find_landmarks(task: Relaxed) -> Landmarks:
    """Return the landmarks of a task whose goal can be reached when nothing is deleted."""
    cost, by = np.empty(len(task.atoms), dtype=np.int64), np.empty(len(task.atoms), dtype=np.int32)

    def explore(without: int) -> np.ndarray:
        state = task.initial.copy()
        if without >= 0:
            state[without] = 0
        costs(state, task.effects, without, True, cost, by)
        return cost

    usual = explore(-1).copy()
    landmarks: list[int] = []
    possible: list[np.ndarray] = []  # for each, what (A,) can be true before it is for the first time
    for atom in range(len(task.atoms) - 1):
        if usual[atom] < FAR and (explore(atom)[task.goal] >= FAR).any():
            landmarks.append(atom)
            possible.append(cost < FAR)
    atoms = np.array(landmarks, dtype=np.int32)
    row_of = {atom: k for k, atom in enumerate(landmarks)}
    needed = np.zeros((len(landmarks), len(landmarks)), dtype=bool)
    achievers: list[list[int]] = [[] for _ in landmarks]
    for action in range(len(task.actions)):
        for added in task.add[task.add_at[action] : task.add_at[action + 1]]:
            if int(added) in row_of:
                achievers[row_of[int(added)]].append(action)
    for k, atom in enumerate(landmarks):
        if task.initial[atom]:
            continue
        common: set[int] | None = None
        for action in achievers[k]:
            needs = task.pre[task.pre_at[action] : task.pre_at[action + 1]]
            if possible[k][needs].all():
                common = set(needs.tolist()) if common is None else common & set(needs.tolist())
        for other_atom in common or ():
            if other_atom in row_of:
                needed[k, row_of[other_atom]] = True
    goal = np.isin(atoms, task.goal)
    before = needed | _reasonable_orders(task, atoms, needed, goal, achievers)
    initial = task.initial[atoms].astype(bool)
    first = initial & ~before.any(axis=1)
    return Landmarks(atoms, before, needed, goal, first)


def _reasonable_orders(
    task: Relaxed, atoms: np.ndarray, needed: np.ndarray, goal: np.ndarray, achievers: list[list[int]]
) -> np.ndarray:
    """Return orders [k, m] of goals: m had better come before k, as k in place destroys what m needs.

    Every way to make k deletes an atom that is needed, directly or over others, right before m: k would have to be
    undone. Orders that would make a cycle are left out.
    """
    count = len(atoms)
    deleted = []
    for k in range(count):
        sets = [set(task.delete[task.delete_at[a] : task.delete_at[a + 1]].tolist()) for a in achievers[k]]
        deleted.append(set.intersection(*sets) if sets else set())
    chain = needed.copy()
    while True:
        longer = chain | (chain.astype(np.int32) @ needed.astype(np.int32) > 0)
        if (longer == chain).all():
            break
        chain = longer
    reasonable = np.zeros((count, count), dtype=bool)
    closure = chain.copy()
    for k in np.flatnonzero(goal).tolist():
        for m in np.flatnonzero(goal).tolist():
            if k == m or closure[m, k]:
                continue
            if any(int(atoms[x]) in deleted[k] for x in np.flatnonzero(chain[m])):
                reasonable[k, m] = True
                reach_k = closure[:, k] | (np.arange(count) == k)
                reach_m = closure[m] | (np.arange(count) == m)
                closure |= reach_k[:, None] & reach_m[None, :]
    return reasonable
