"""A grounded task as arrays, and compiled loops over it: successors, h_FF with its preferred actions, h_max, landmarks.

h_FF is the size of a relaxed plan read off the additive costs (Hoffmann & Nebel 2001; Keyder & Geffner 2008); preferred
(helpful) actions are those of the relaxed plan that can be done now. Landmarks are the atoms without which nothing that
ignores deletions reaches the goal: an atom is one when the goal becomes unreachable without the actions that add it
(Richter & Westphal 2010, section 4, uses a subset that is cheaper to find; here all of them are tested).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import types
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.kit.tasks.strips import Atom, GroundAction, Problem

FAR = 1 << 30
"""Cost of what cannot be reached."""


class Effects(NamedTuple):
    """What compiled loops read of a grounded task, see Relaxed."""

    pre_at: np.ndarray
    add: np.ndarray
    add_at: np.ndarray
    user: np.ndarray
    user_at: np.ndarray


_EFFECTS = types.NamedUniTuple(types.int32[::1], len(Effects._fields), Effects)
"""Type of `Effects` for numba."""


@dataclass(frozen=True)
class Relaxed:
    """A grounded task as index arrays (CSR: rows of `values` between `offsets`)."""

    atoms: tuple[Atom, ...]
    actions: tuple[GroundAction, ...]
    initial: np.ndarray
    """(A,) uint8"""
    goal: np.ndarray
    """(G,) int32"""
    pre: np.ndarray
    pre_at: np.ndarray
    """Preconditions of the actions: values and offsets (N + 1,), int32."""
    add: np.ndarray
    add_at: np.ndarray
    delete: np.ndarray
    delete_at: np.ndarray
    user: np.ndarray
    user_at: np.ndarray
    """Actions that need an atom."""

    @cached_property
    def effects(self) -> Effects:
        """What `costs` reads."""
        return Effects(self.pre_at, self.add, self.add_at, self.user, self.user_at)


def _rows(rows: list[list[int]]) -> tuple[np.ndarray, np.ndarray]:
    offsets = np.zeros(len(rows) + 1, dtype=np.int32)
    offsets[1:] = np.cumsum([len(row) for row in rows])
    return np.array([value for row in rows for value in row], dtype=np.int32), offsets


def relax(problem: Problem, actions: list[GroundAction]) -> Relaxed:
    """Return the arrays of a task, atoms and actions in a fixed order; an empty precondition is one that always holds.

    Atoms that no action changes are left out where they hold, and actions that need one that does not.
    """
    changed = {atom for action in actions for atom in (*action.add, *action.delete)}
    static = problem.initial - changed
    usable = [action for action in actions if action.preconditions <= changed | static]
    atoms = sorted((problem.initial - static) | changed | problem.goal)
    number = {atom: index for index, atom in enumerate(atoms)}
    always = len(atoms)
    atoms.append(("",))
    pre = [sorted(number[a] for a in action.preconditions - static) or [always] for action in usable]
    add = [sorted(number[a] for a in action.add) for action in usable]
    delete = [sorted(number[a] for a in action.delete) for action in usable]
    users: list[list[int]] = [[] for _ in atoms]
    for index, needs in enumerate(pre):
        for atom in needs:
            users[atom].append(index)
    initial = np.zeros(len(atoms), dtype=np.uint8)
    initial[[number[atom] for atom in problem.initial if atom in number] + [always]] = 1
    goal = np.array(sorted(number[atom] for atom in problem.goal), dtype=np.int32)
    return Relaxed(tuple(atoms), tuple(usable), initial, goal, *_rows(pre), *_rows(add), *_rows(delete), *_rows(users))


def successor(task: Relaxed, state: np.ndarray, action: int) -> np.ndarray:
    """Return the state (A,) after an action."""
    after = state.copy()
    after[task.delete[task.delete_at[action] : task.delete_at[action + 1]]] = 0
    after[task.add[task.add_at[action] : task.add_at[action + 1]]] = 1
    return after


@compiled("int32[::1](uint8[::1], int32[::1], int32[::1])")
def applicable(state, pre, pre_at):  # type: ignore[no-untyped-def]
    """Return the actions whose preconditions hold in a state (A,)."""
    actions = np.empty(len(pre_at) - 1, dtype=np.int32)
    count = 0
    for action in range(len(pre_at) - 1):
        holds = True
        for index in range(pre_at[action], pre_at[action + 1]):
            if state[pre[index]] == 0:
                holds = False
                break
        if holds:
            actions[count] = action
            count += 1
    return actions[:count]


@compiled(types.void(types.uint8[::1], _EFFECTS, types.int64, types.boolean, types.int64[::1], types.int32[::1]))
def costs(state, effects, without, use_max, cost, by):  # type: ignore[no-untyped-def]
    """Write the cost of every atom when nothing is ever deleted, and the action that gives it so (-1: none).

    Sums of precondition costs, or maxima with `use_max`. Actions that add the atom `without` are left out (-1: none).
    Dijkstra with a list of atoms for every whole cost, so that no heap is needed.
    """
    pre_at, add, add_at, user, user_at = effects
    atoms, actions = len(state), len(pre_at) - 1
    waiting = np.empty(actions, dtype=np.int32)
    total = np.zeros(actions, dtype=np.int64)
    for action in range(actions):
        waiting[action] = pre_at[action + 1] - pre_at[action]
    # The lists begin in `head` and are linked through `following`; an entry whose atom got cheaper is passed over.
    size = 64
    head = np.full(size, -1, dtype=np.int32)
    entry_atom = np.empty(4 * atoms + 16, dtype=np.int32)
    following = np.empty(4 * atoms + 16, dtype=np.int32)
    used = 0
    highest = 0
    for atom in range(atoms):
        cost[atom] = FAR
        by[atom] = -1
        if state[atom] == 1:
            cost[atom] = 0
            entry_atom[used] = atom
            following[used] = head[0]
            head[0] = used
            used += 1
    done = np.zeros(atoms, dtype=np.uint8)
    level = 0
    while level <= highest:
        while head[level] >= 0:
            entry = head[level]
            head[level] = following[entry]
            atom = entry_atom[entry]
            if done[atom] == 1 or cost[atom] != level:
                continue
            done[atom] = 1
            for index in range(user_at[atom], user_at[atom + 1]):
                action = user[index]
                if use_max:
                    total[action] = max(total[action], level)
                else:
                    total[action] += level
                waiting[action] -= 1
                if waiting[action] > 0:
                    continue
                if without >= 0:
                    gives = False
                    for added in range(add_at[action], add_at[action + 1]):
                        if add[added] == without:
                            gives = True
                    if gives:
                        continue
                price = total[action] + 1
                for added in range(add_at[action], add_at[action + 1]):
                    added_atom = add[added]
                    if price < cost[added_atom]:
                        cost[added_atom] = price
                        by[added_atom] = action
                        if price >= size:
                            grown = np.full(2 * price, -1, dtype=np.int32)
                            grown[:size] = head
                            head, size = grown, 2 * price
                        if used == len(entry_atom):
                            longer = np.empty(2 * used, dtype=np.int32)
                            longer[:used] = entry_atom
                            entry_atom = longer
                            longer = np.empty(2 * used, dtype=np.int32)
                            longer[:used] = following
                            following = longer
                        entry_atom[used] = added_atom
                        following[used] = head[price]
                        head[price] = used
                        used += 1
                        highest = max(highest, price)
        level += 1


@compiled("int64(uint8[::1], int32[::1], int32[::1], int32[::1], int64[::1], int32[::1], uint8[::1])")
def relaxed_plan(state, pre, pre_at, goal, cost, by, preferred):  # type: ignore[no-untyped-def]
    """Return the number of actions of a relaxed plan (FAR: there is none) and mark those that can be done now.

    `cost` and `by` come from `costs`; `preferred` (N,) is written.
    """
    preferred[:] = 0
    for index in range(len(goal)):
        if cost[goal[index]] >= FAR:
            return FAR
    is_needed = np.zeros(len(state), dtype=np.uint8)
    chosen = np.zeros(len(pre_at) - 1, dtype=np.uint8)
    stack = np.empty(len(state), dtype=np.int32)
    depth = 0
    for index in range(len(goal)):
        if is_needed[goal[index]] == 0:
            is_needed[goal[index]] = 1
            stack[depth] = goal[index]
            depth += 1
    count = 0
    while depth > 0:
        depth -= 1
        action = by[stack[depth]]
        if action < 0 or chosen[action] == 1:
            continue
        chosen[action] = 1
        count += 1
        now = True
        for index in range(pre_at[action], pre_at[action + 1]):
            atom = pre[index]
            if state[atom] == 0:
                now = False
            if is_needed[atom] == 0:
                is_needed[atom] = 1
                stack[depth] = atom
                depth += 1
        if now:
            preferred[action] = 1
    return count
