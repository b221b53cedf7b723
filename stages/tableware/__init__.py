"""`tableware`: clear a table of cups, bowls, plates and utensils (Srinivas 2024, chapters 5 to 7)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.tableware.actions.grasp import grasp, grasp_two
    from scenewright.stages.tableware.actions.pull import Pull
    from scenewright.stages.tableware.actions.pull_grasp import pull_grasp
    from scenewright.stages.tableware.actions.stack import Stack
    from scenewright.stages.tableware.dishes_file import estimated_setting
    from scenewright.stages.tableware.planning.action import Action
    from scenewright.stages.tableware.planning.choice import declared_policy, make_policy
    from scenewright.stages.tableware.planning.joint import JointPolicy, plan
    from scenewright.stages.tableware.planning.optimum import Optimum
    from scenewright.stages.tableware.planning.policy import Policy
    from scenewright.stages.tableware.planning.rules import Rules
    from scenewright.stages.tableware.planning.time_model import EXACT, Chances, TimeModel
    from scenewright.stages.tableware.policies.pull import PullPolicy
    from scenewright.stages.tableware.policies.random import RandomOne
    from scenewright.stages.tableware.policies.random_piles import RandomPile
    from scenewright.stages.tableware.policies.stack import StackPolicy
    from scenewright.stages.tableware.sight import Eyes, setting_seen, understood
    from scenewright.stages.tableware.simulation.arm_times import ArmTimes, arm_times
    from scenewright.stages.tableware.simulation.fast import FastWorld, run_trial
    from scenewright.stages.tableware.simulation.physics import PhysicsTable, Speeds
    from scenewright.stages.tableware.simulation.physics_trial import run_physics_trial
    from scenewright.stages.tableware.simulation.trial import Trial, run_in
    from scenewright.stages.tableware.training.thesis_times.printed import PRINTED
    from scenewright.stages.tableware.vision.detection import detect
    from scenewright.stages.tableware.vision.detections import Detection
    from scenewright.stages.tableware.vision.error_model import ErrorModel, KindErrors
    from scenewright.stages.tableware.vision.image_files import read_image
    from scenewright.stages.tableware.vision.overlay import draw_outlines, draw_sight
    from scenewright.stages.tableware.vision.photographs import Outline, find_outlines
    from scenewright.stages.tableware.vision.seeing import Sight, Sizes, see, seen_from_the_side
    from scenewright.stages.tableware.vision.size_estimation import Limits, estimated_dishes
    from scenewright.stages.tableware.vision.thesis_detection import detect_thesis
    from scenewright.stages.tableware.world.footprints import footprint
    from scenewright.stages.tableware.world.items import STANDARD, UTENSILS, Item, Kind, Table, make_item, stand_height
    from scenewright.stages.tableware.world.overhead import LEVELS, SCHEMES, Scheme, overhead_camera, render_overhead
    from scenewright.stages.tableware.world.scenes import TIERS, make_table
    from scenewright.stages.tableware.world.setting import Gripper, Setting

_MODULES = {
    "grasp": "scenewright.stages.tableware.actions.grasp",
    "grasp_two": "scenewright.stages.tableware.actions.grasp",
    "Pull": "scenewright.stages.tableware.actions.pull",
    "pull_grasp": "scenewright.stages.tableware.actions.pull_grasp",
    "Stack": "scenewright.stages.tableware.actions.stack",
    "estimated_setting": "scenewright.stages.tableware.dishes_file",
    "Action": "scenewright.stages.tableware.planning.action",
    "declared_policy": "scenewright.stages.tableware.planning.choice",
    "make_policy": "scenewright.stages.tableware.planning.choice",
    "JointPolicy": "scenewright.stages.tableware.planning.joint",
    "plan": "scenewright.stages.tableware.planning.joint",
    "Optimum": "scenewright.stages.tableware.planning.optimum",
    "Policy": "scenewright.stages.tableware.planning.policy",
    "Rules": "scenewright.stages.tableware.planning.rules",
    "Chances": "scenewright.stages.tableware.planning.time_model",
    "EXACT": "scenewright.stages.tableware.planning.time_model",
    "TimeModel": "scenewright.stages.tableware.planning.time_model",
    "PullPolicy": "scenewright.stages.tableware.policies.pull",
    "RandomOne": "scenewright.stages.tableware.policies.random",
    "RandomPile": "scenewright.stages.tableware.policies.random_piles",
    "StackPolicy": "scenewright.stages.tableware.policies.stack",
    "Eyes": "scenewright.stages.tableware.sight",
    "setting_seen": "scenewright.stages.tableware.sight",
    "understood": "scenewright.stages.tableware.sight",
    "ArmTimes": "scenewright.stages.tableware.simulation.arm_times",
    "arm_times": "scenewright.stages.tableware.simulation.arm_times",
    "FastWorld": "scenewright.stages.tableware.simulation.fast",
    "run_trial": "scenewright.stages.tableware.simulation.fast",
    "PhysicsTable": "scenewright.stages.tableware.simulation.physics",
    "Speeds": "scenewright.stages.tableware.simulation.physics",
    "run_physics_trial": "scenewright.stages.tableware.simulation.physics_trial",
    "Trial": "scenewright.stages.tableware.simulation.trial",
    "run_in": "scenewright.stages.tableware.simulation.trial",
    "PRINTED": "scenewright.stages.tableware.training.thesis_times.printed",
    "detect": "scenewright.stages.tableware.vision.detection",
    "Detection": "scenewright.stages.tableware.vision.detections",
    "ErrorModel": "scenewright.stages.tableware.vision.error_model",
    "KindErrors": "scenewright.stages.tableware.vision.error_model",
    "read_image": "scenewright.stages.tableware.vision.image_files",
    "draw_outlines": "scenewright.stages.tableware.vision.overlay",
    "draw_sight": "scenewright.stages.tableware.vision.overlay",
    "Outline": "scenewright.stages.tableware.vision.photographs",
    "find_outlines": "scenewright.stages.tableware.vision.photographs",
    "Sight": "scenewright.stages.tableware.vision.seeing",
    "Sizes": "scenewright.stages.tableware.vision.seeing",
    "see": "scenewright.stages.tableware.vision.seeing",
    "seen_from_the_side": "scenewright.stages.tableware.vision.seeing",
    "Limits": "scenewright.stages.tableware.vision.size_estimation",
    "estimated_dishes": "scenewright.stages.tableware.vision.size_estimation",
    "detect_thesis": "scenewright.stages.tableware.vision.thesis_detection",
    "footprint": "scenewright.stages.tableware.world.footprints",
    "Item": "scenewright.stages.tableware.world.items",
    "Kind": "scenewright.stages.tableware.world.items",
    "STANDARD": "scenewright.stages.tableware.world.items",
    "Table": "scenewright.stages.tableware.world.items",
    "UTENSILS": "scenewright.stages.tableware.world.items",
    "make_item": "scenewright.stages.tableware.world.items",
    "stand_height": "scenewright.stages.tableware.world.items",
    "LEVELS": "scenewright.stages.tableware.world.overhead",
    "SCHEMES": "scenewright.stages.tableware.world.overhead",
    "Scheme": "scenewright.stages.tableware.world.overhead",
    "overhead_camera": "scenewright.stages.tableware.world.overhead",
    "render_overhead": "scenewright.stages.tableware.world.overhead",
    "TIERS": "scenewright.stages.tableware.world.scenes",
    "make_table": "scenewright.stages.tableware.world.scenes",
    "Gripper": "scenewright.stages.tableware.world.setting",
    "Setting": "scenewright.stages.tableware.world.setting",
}

__getattr__ = exported(__name__, _MODULES)
