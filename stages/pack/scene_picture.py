"""A picture of the arm over table, basket and boxes: pybullet's own software renderer."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgba
from scenewright.schemas.packing import BASKET_TOP, TABLE_TOP
from scenewright.stages.kit.simulation.bodies import links_and_joints
from scenewright.stages.kit.simulation.engine import engine, native_output_to_stderr
from scenewright.stages.pack.arm import FixedArm
from scenewright.stages.pack.records import Rectangle
from scenewright.stages.pack.solids import Block, block_over
from scenewright.stages.pack.solved_arm import SolvedArm

TABLE_COLOR, BASKET_COLOR = "#d8d2c4", "#a98d5f"
FACTOR = 2
"""Rendered so many times larger and averaged."""


def render_scene(
    arm: FixedArm | SolvedArm,
    joints: np.ndarray,
    blocks: list[tuple[str, Block]],
    colors: dict[str, str],
    basket: Rectangle,
    width: int,
) -> np.ndarray:
    """Return (H, W, 3) uint8 of the arm at joint values (J,) among blocks, with each block's name -> colour."""
    client = engine.connect(engine.DIRECT)
    try:
        with native_output_to_stderr():
            robot = engine.loadURDF(str(arm.description.urdf), useFixedBase=True, physicsClientId=client)
        values = dict(zip(arm.description.arm_joints, joints.tolist(), strict=True))
        values |= dict.fromkeys(arm.description.finger_joints, arm.description.opening / 2)
        for name, index in links_and_joints(robot, client)[1].items():
            if name in values:
                engine.resetJointState(robot, index, values[name], physicsClientId=client)
        _block(client, Block(0.45, 0.0, 0.0, 0.75, 0.9, TABLE_TOP - 0.01, TABLE_TOP), TABLE_COLOR)
        _block(client, block_over(basket.low, basket.high, 0.0, BASKET_TOP), BASKET_COLOR)
        for name, block in blocks:
            _block(client, block, colors[name])
        return _render(client, width)
    finally:
        engine.disconnect(physicsClientId=client)


def _block(client: int, block: Block, color: str) -> None:
    half = [block.half_width, block.half_length, (block.top - block.bottom) / 2]
    shape = engine.createVisualShape(
        engine.GEOM_BOX, halfExtents=half, rgbaColor=list(to_rgba(color)), physicsClientId=client
    )
    centre = [block.x, block.y, (block.top + block.bottom) / 2]
    turn = engine.getQuaternionFromEuler([0, 0, block.yaw])
    engine.createMultiBody(0, -1, shape, centre, turn, physicsClientId=client)


def _render(client: int, width: int) -> np.ndarray:
    height = round(width * 2 / 3)
    view = engine.computeViewMatrix([1.55, -0.75, 0.95], [0.42, 0.02, 0.12], [0, 0, 1])
    projection = engine.computeProjectionMatrixFOV(42, width / height, 0.05, 5.0)
    image = engine.getCameraImage(
        FACTOR * width,
        FACTOR * height,
        view,
        projection,
        lightDirection=[0.6, -0.9, 1.6],
        shadow=1,
        renderer=engine.ER_TINY_RENDERER,
        physicsClientId=client,
    )[2]
    pixels = np.asarray(image, dtype=np.uint8).reshape(FACTOR * height, FACTOR * width, 4)[:, :, :3]
    blocks = pixels.reshape(height, FACTOR, width, FACTOR, 3).astype(np.uint16)
    return ((blocks.sum(axis=(1, 3)) + FACTOR**2 // 2) // FACTOR**2).astype(np.uint8)
