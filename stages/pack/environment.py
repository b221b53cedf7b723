"""The packing environment: the world's state, what an action does to it, and whether the goal holds.

The state after an action is a value: resetting the world and executing a plan again gives the same states, so that the
states of a prefix may be kept instead (stages/pack/loop.py counts as if they were executed).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2

import numpy as np
from scenewright.schemas.packing import BASKET_TOP, TABLE_TOP
from scenewright.schemas.plan import Failure
from scenewright.stages.pack.arm import Limits, ToolPose
from scenewright.stages.pack.hand import Named, place_tool_pose, release_height, tool_over_centre
from scenewright.stages.pack.instances import Instance
from scenewright.stages.pack.motion import Motion, MotionPlanner, Stance
from scenewright.stages.pack.records import Action, BoxState
from scenewright.stages.pack.settling import Rest, SettlingTable, rest_of
from scenewright.stages.pack.solids import Block, block_over, flat_depth

GOAL_MARGIN = 0.015
"""A box is in the basket when its bounds lie within the basket's grown by this on each side [m]."""
X_RANGE, Y_RANGE, YAW_RANGE = (0.0, 1.4), (-1.0, 1.0), (-3.14, 3.14)
"""Parameters of a place are clipped into these, not refused (docs/LLM3.md)."""


@dataclass(frozen=True)
class State:
    """Where everything is between two actions."""

    rests: dict[str, Rest]
    stance: Stance
    held: str | None = None


class WrongAction(Exception):
    """An action that is none in this state: it never reaches the motion planner."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(failure.message)
        self.failure = failure


class PackingWorld:
    """One instance with its motion planner and physics. Close it, or use it in a `with` statement."""

    def __init__(self, instance: Instance, limits: Limits = "fr3", planner: MotionPlanner | None = None) -> None:
        self.instance = instance
        self._own = planner is None
        self.planner = planner or MotionPlanner(limits)
        self._table = SettlingTable(instance)
        self._boxes = {box.name: box for box in instance.boxes}
        self._fixed = tuple(Named(obstacle.rectangle.name, obstacle.block) for obstacle in instance.obstacles)
        self._seen: dict[tuple[str, Rest], BoxState] = {}
        self._blocks: dict[tuple[str, Rest], Named] = {}
        self.initial = State({box.name: rest_of(box, TABLE_TOP) for box in instance.boxes}, self.planner.home)

    def __enter__(self) -> PackingWorld:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the physics clients (a planner that was given stays open)."""
        self._table.close()
        if self._own:
            self.planner.close()

    # --- actions ----------------------------------------------------------------------------------------------

    def check(self, state: State, action: Action) -> None:
        """Raise WrongAction for an action that names nothing, or whose turn it is not."""
        if action.box not in self._boxes:
            raise WrongAction(
                Failure(kind="unknown_object", message=f"there is no {action.box}", objects=(action.box,))
            )
        if action.name == "pick" and state.held is not None:
            raise WrongAction(_wrong_order(f"cannot pick {action.box} while holding {state.held}", action.box))
        if action.name == "place" and state.held != action.box:
            raise WrongAction(_wrong_order(f"cannot place {action.box}: it is not held", action.box))

    def step(self, state: State, action: Action) -> tuple[State, Motion]:
        """Return the state after an action, and its motion: one call of the motion planner.

        Raises WrongAction (no call was made) and MotionFailed (one was).
        """
        self.check(state, action)
        if action.name == "pick":
            return self._pick(state, action.box)
        return self._place(state, action)

    def _pick(self, state: State, name: str) -> tuple[State, Motion]:
        box = self.box(state, name)
        centre = state.rests[name].position[2]
        pose = ToolPose(box.x, box.y, centre + tool_over_centre(box.height), box.yaw)
        motion = self.planner.plan(state.stance, pose, None, self.standing(state, None))
        return State(state.rests, motion.end, name), motion

    def _place(self, state: State, action: Action) -> tuple[State, Motion]:
        box = self._boxes[action.box]
        x, y, yaw = clipped(action)
        pose = place_tool_pose(box, x, y, yaw)
        motion = self.planner.plan(state.stance, pose, box, self.standing(state, box.name))
        let_go = replace(box, x=x, y=y, yaw=yaw)
        ground = self._even_ground(let_go)
        if ground is not None and self._all_upright(state):
            return State(state.rests | {box.name: rest_of(let_go, ground)}, motion.end), motion
        rests = state.rests | {box.name: rest_of(let_go, release_height(box.height) - box.height / 2)}
        return State(self._table.settle(rests), motion.end), motion

    def confirm(self, plan: tuple[Action, ...]) -> tuple[str, ...]:
        """Let physics run after every place of a feasible plan; return the boxes that are then not in the basket."""
        rests = dict(self.initial.rests)
        for action in plan:
            if action.name == "place":
                box = self._boxes[action.box]
                x, y, yaw = clipped(action)
                bottom = release_height(box.height) - box.height / 2
                rests = self._table.settle(rests | {box.name: rest_of(replace(box, x=x, y=y, yaw=yaw), bottom)})
        return self.outside(State(rests, self.planner.home))

    def _even_ground(self, box: BoxState) -> float | None:
        """Return the height [m] of the surface under all of a box that is let go; None when it is not one surface.

        Over one surface an upright box comes straight down, as it overlaps nothing: physics would say nothing new.
        """
        under = upright_block(box, 0.0)
        low_x, low_y, high_x, high_y = under.bounds
        if any(flat_depth(under, fixed.block) > 0 for fixed in self._fixed):
            return None
        low, high = self.instance.basket.low, self.instance.basket.high
        if low_x >= low[0] and low_y >= low[1] and high_x <= high[0] and high_y <= high[1]:
            return BASKET_TOP
        apart = high_x <= low[0] or low_x >= high[0] or high_y <= low[1] or low_y >= high[1]
        return TABLE_TOP if apart else None

    def _all_upright(self, state: State) -> bool:
        return all(_upright(rest) for rest in state.rests.values())

    # --- what is seen -----------------------------------------------------------------------------------------

    def box(self, state: State, name: str) -> BoxState:
        """Return a box as it lies (its yaw that of its x axis)."""
        rest = state.rests[name]
        box = self._seen.get((name, rest))
        if box is None:
            box = self._seen[name, rest] = self._look(state, name)
        return replace(box, in_basket=False) if name == state.held else box

    def _look(self, state: State, name: str) -> BoxState:
        box, rest = self._boxes[name], state.rests[name]
        turn = _rotation(rest.quaternion)
        low, high = self.bounds(state, name)
        basket = self.instance.basket
        inside = all(
            low[k] >= basket.low[k] - GOAL_MARGIN and high[k] <= basket.high[k] + GOAL_MARGIN for k in range(2)
        )
        yaw = atan2(turn[1, 0], turn[0, 0])
        return replace(box, x=rest.position[0], y=rest.position[1], yaw=yaw, in_basket=inside)

    def bounds(self, state: State, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the axis-aligned bounds (3,), (3,) of a box as it lies [m]."""
        box, rest = self._boxes[name], state.rests[name]
        half = np.abs(_rotation(rest.quaternion)) @ (np.array([box.width, box.length, box.height]) / 2)
        return np.array(rest.position) - half, np.array(rest.position) + half

    def standing(self, state: State, held: str | None) -> tuple[Named, ...]:
        """Return all that stands on the table as blocks; a box that leans gets the block that holds it."""
        names = (name for name in self._boxes if name != held)
        return (*(self._block(state, name) for name in names), *self._fixed)

    def _block(self, state: State, name: str) -> Named:
        key = (name, state.rests[name])
        if key not in self._blocks:
            box, (low, high) = self.box(state, name), self.bounds(state, name)
            if _upright(state.rests[name]):
                block = replace(upright_block(box, float(low[2])), top=float(high[2]))
            else:
                block = block_over(low[:2].tolist(), high[:2].tolist(), float(low[2]), float(high[2]))
            self._blocks[key] = Named(name, block)
        return self._blocks[key]

    def outside(self, state: State) -> tuple[str, ...]:
        """Return the boxes that are not in the basket; none: the goal holds."""
        return tuple(name for name in self._boxes if not self.box(state, name).in_basket)


def upright_block(box: BoxState, bottom: float) -> Block:
    """Return the block of a box that stands upright with its bottom at a world height [m]."""
    return Block(box.x, box.y, box.yaw, box.width / 2, box.length / 2, bottom, bottom + box.height)


def _upright(rest: Rest) -> bool:
    x, y, _, _ = rest.quaternion
    return 2 * (x * x + y * y) < 1e-5


def clipped(action: Action) -> tuple[float, float, float]:
    """Return x, y [m] and yaw [rad] of a place, clipped into the ranges."""
    values = (action.x or 0.0, action.y or 0.0, action.yaw or 0.0)
    x, y, yaw = (
        float(min(max(value, low), high))
        for value, (low, high) in zip(values, (X_RANGE, Y_RANGE, YAW_RANGE), strict=True)
    )
    return x, y, yaw


def _wrong_order(message: str, name: str) -> Failure:
    return Failure(kind="wrong_order", message=message, objects=(name,))


def _rotation(quaternion: tuple[float, float, float, float]) -> np.ndarray:
    x, y, z, w = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
