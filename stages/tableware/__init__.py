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

__getattr__ = exported(__name__)
