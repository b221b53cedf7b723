"""A packing problem as JSON: the user's own in, any instance out."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.packing import TABLE_TOP, PackingArea, PackingBox, PackingInstanceFile, PackingObstacle
from scenewright.stages.kit.motion.failures import MotionFailed
from scenewright.stages.pack.arm import FixedArm, ToolPose
from scenewright.stages.pack.environment import X_RANGE, Y_RANGE, upright_block
from scenewright.stages.pack.hand import tool_over_centre
from scenewright.stages.pack.instances import Instance, Obstacle
from scenewright.stages.pack.records import BoxState, Rectangle
from scenewright.stages.pack.solids import overlap
from scenewright.stages.pack.solved_arm import SolvedArm

LARGEST_FILE = 1_000_000
"""Largest file that is read [bytes]; by eye."""
FORM = "docs/LLM3.md shows the form"


def read_problem(path: Path, arm: FixedArm | SolvedArm) -> Instance:
    """Read and check a problem. Raises BadInput: unreadable, a wrong field, boxes in each other, a box out of reach, a
    basket in which nothing can be placed."""
    instance = from_file(PackingInstanceFile.read(path, largest=LARGEST_FILE, hint=FORM), path.stem)
    _check_basket(instance, path)
    _check_starts(instance, path, arm)
    return instance


def from_file(file: PackingInstanceFile, name: str) -> Instance:
    """Return the instance that a file tells."""
    boxes = tuple(
        BoxState(box.name, box.width, box.length, box.height, box.x, box.y, box.yaw, False) for box in file.boxes
    )
    obstacles = tuple(
        Obstacle(Rectangle(obstacle.name, obstacle.low, obstacle.high), obstacle.top) for obstacle in file.obstacles
    )
    return Instance(name, boxes, Rectangle("basket", file.basket.low, file.basket.high), obstacles)


def to_file(instance: Instance) -> PackingInstanceFile:
    """Return the payload instance.json of an instance."""
    return PackingInstanceFile(
        boxes=tuple(
            PackingBox(
                name=box.name, width=box.width, length=box.length, height=box.height, x=box.x, y=box.y, yaw=box.yaw
            )
            for box in instance.boxes
        ),
        basket=PackingArea(low=instance.basket.low, high=instance.basket.high),
        obstacles=tuple(
            PackingObstacle(
                name=entry.rectangle.name, low=entry.rectangle.low, high=entry.rectangle.high, top=entry.top
            )
            for entry in instance.obstacles
        ),
    )


def _check_basket(instance: Instance, path: Path) -> None:
    for axis, (least, most) in zip((0, 1), (X_RANGE, Y_RANGE), strict=True):
        # Parameters of a place are clipped: every plan would fail without a reason that says why.
        if instance.basket.high[axis] <= least or instance.basket.low[axis] >= most:
            raise BadInput(
                f"{path}: basket: places are within x {X_RANGE}, y {Y_RANGE} m, and none of them is in it",
                hint="move the basket",
            )


def _check_starts(instance: Instance, path: Path, arm: FixedArm | SolvedArm) -> None:
    blocks = [(box.name, upright_block(box, TABLE_TOP)) for box in instance.boxes]
    blocks += [(obstacle.rectangle.name, obstacle.block) for obstacle in instance.obstacles]
    for number, (name, block) in enumerate(blocks[: len(instance.boxes)]):
        for other_name, other_block in blocks[number + 1 :]:
            depth = overlap(block, other_block)
            if depth > 1e-6:
                raise BadInput(
                    f"{path}: {name} and {other_name} start {1000 * depth:.1f} mm in each other",
                    hint="move one of them",
                )
    for box in instance.boxes:
        pose = ToolPose(box.x, box.y, TABLE_TOP + box.height / 2 + tool_over_centre(box.height), box.yaw)
        try:
            arm.solve(pose, arm.home)
        except MotionFailed as failed:
            raise BadInput(
                f"{path}: {box.name} cannot be picked where it starts: {failed.failure.message}",
                hint="the arm stands at (0, 0); move the box nearer or farther",
            ) from None
