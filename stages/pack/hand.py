"""The hand and what it holds as upright blocks, where they are at a tool pose, and what they hit there."""

from __future__ import annotations

from dataclasses import dataclass

from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.pack.arm import ToolPose
from scenewright.stages.pack.hand_shape import PUBLISHED, HandShape
from scenewright.stages.pack.records import BoxState
from scenewright.stages.pack.solids import Block, overlap

TOOL_OVER_TOP = 0.015
"""The tool stays this far over the upper face of the box it takes [m]; 5 cm over the centre of a box of 7 cm."""
TOOL_OVER_CENTRE = 0.05
"""Height of the tool over the centre of the box that it takes [m], more over high boxes."""
PLACE_CENTRE = 0.05
"""World z [m] at which a box's centre is let go; higher boxes are let go as far above the basket as those of 7 cm."""
RELEASE_BOTTOM = 0.015
"""Height of the underside of a high box at which it is let go [m]."""


@dataclass(frozen=True)
class Named:
    """Something that stands in the way."""

    name: str
    block: Block


def tool_over_centre(height: float) -> float:
    """Return how far [m] the tool is above the centre of a box of a height when it holds it."""
    return max(TOOL_OVER_CENTRE, height / 2 + TOOL_OVER_TOP)


def release_height(height: float) -> float:
    """Return the world z [m] of the centre of a box of a height when it is let go over the basket."""
    return max(PLACE_CENTRE, RELEASE_BOTTOM + height / 2)


def place_tool_pose(box: BoxState, x: float, y: float, yaw: float) -> ToolPose:
    """Return the tool's pose when a box is let go at (x, y) [m] and a yaw [rad]."""
    return ToolPose(x, y, release_height(box.height) + tool_over_centre(box.height), yaw)


def hand_blocks(pose: ToolPose, hand: HandShape = PUBLISHED) -> tuple[Block, ...]:
    """Return palm and both fingers at a tool pose; the fingers lie along the tool's y axis."""
    half_x, half_y, low, high = hand.palm
    half_width, half_length, tip, top = hand.finger
    palm = Block(pose.x, pose.y, pose.yaw, half_x, half_y, pose.z + low, pose.z + high)
    fingers = []
    for side in (-1, 1):
        x, y = palm.moved(0.0, side * hand.finger_offset)
        fingers.append(Block(x, y, pose.yaw, half_width, half_length, pose.z + tip, pose.z + top))
    return (palm, *fingers)


def held_block(pose: ToolPose, width: float, length: float, height: float) -> Block:
    """Return where a held box is when the tool is at a pose (the box has the tool's yaw)."""
    centre = pose.z - tool_over_centre(height)
    return Block(pose.x, pose.y, pose.yaw, width / 2, length / 2, centre - height / 2, centre + height / 2)


def end_collision(
    pose: ToolPose, held: Named | None, others: tuple[Named, ...], hand: HandShape = PUBLISHED
) -> MotionFailed | None:
    """Return the deepest collision of the held box (at its block), palm and fingers at a pose, None when it is free.

    `goal_in_collision`: objects what is hit and what hits it (`hand` or the held box), numbers depth [m].
    """
    worst: tuple[float, str, str] | None = None
    carried_blocks = [(held.name, held.block)] if held is not None else []
    carried_blocks += [("hand", block) for block in hand_blocks(pose, hand)]
    for part, block in carried_blocks:
        for obstacle in others:
            depth = overlap(block, obstacle.block)
            if depth > 1e-9 and (worst is None or depth > worst[0]):
                worst = (depth, part, obstacle.name)
    if worst is None:
        return None
    depth, part, other_name = worst
    who = "the hand" if part == "hand" else part
    return MotionFailed(
        "goal_in_collision",
        f"at the goal, {who} is in collision with {other_name} (depth {1000 * depth:.1f} mm)",
        (other_name, part),
        {"depth": depth},
    )
