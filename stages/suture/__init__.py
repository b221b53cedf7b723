"""Suturing: a needle seen by two eyes, its pose and how sure it is, the thread, and trials of whole sutures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.suture.evaluation.judgement import Estimate, judged
    from scenewright.stages.suture.following import Follower, growing_pairs
    from scenewright.stages.suture.masks import learned_masks, masks_in, network_masks, spoiled_masks
    from scenewright.stages.suture.motion.constants import THROWS
    from scenewright.stages.suture.motion.needle import ARC_POINTS
    from scenewright.stages.suture.motion_reports import motions_to_last, reported_motion
    from scenewright.stages.suture.needle.drawing import draw_eyes
    from scenewright.stages.suture.needle.estimate import estimate
    from scenewright.stages.suture.needle.filter import fuse
    from scenewright.stages.suture.needle.observation import NeedleEstimate, NeedleObservation
    from scenewright.stages.suture.needle.radius_fit import estimate_without_radius
    from scenewright.stages.suture.needle.thesis import thesis_average, thesis_estimate
    from scenewright.stages.suture.options import ARM_NAMES
    from scenewright.stages.suture.rig import ENDOSCOPE, NEEDLE_RADIUS, TWO_CAMERAS, NeedlePose, StereoRig
    from scenewright.stages.suture.robot.arms import REMOTE_CENTRES
    from scenewright.stages.suture.robot.psm import YAW_TO_TIP
    from scenewright.stages.suture.segmentation.infer import Masks, Segmenter
    from scenewright.stages.suture.thread.reconstruct import ThreadCurve, reconstruct_thread
    from scenewright.stages.suture.training.network.views import CALIBRATION_ERROR, kept_view, read_eye
    from scenewright.stages.suture.trials.drawing import draw_strip
    from scenewright.stages.suture.trials.machine import run_trial
    from scenewright.stages.suture.trials.ours.pose_correction import BySeenEnds
    from scenewright.stages.suture.trials.perception import PerceptionModel, Seen, perception_model
    from scenewright.stages.suture.trials.policies import OURS, POLICIES, THESIS
    from scenewright.stages.suture.trials.recording import Recorder
    from scenewright.stages.suture.trials.records import run_of
    from scenewright.stages.suture.trials.sight import PICTURED_FROM_TRIAL, Looked, LookingEyes
    from scenewright.stages.suture.trials.thesis.extraction import NoSweep
    from scenewright.stages.suture.trials.thesis.handover import NormalUnchanged
    from scenewright.stages.suture.trials.wound import RIDGE_HALF_WIDTH, RIDGE_HEIGHT
    from scenewright.stages.suture.world.clutter import cluttered, false_masks
    from scenewright.stages.suture.world.corruption import noisy_disparity
    from scenewright.stages.suture.world.render import Eye, StereoView, render
    from scenewright.stages.suture.world.sampling import seen_scene
    from scenewright.stages.suture.world.scene import NeedleScene, moved_scene, random_motions
    from scenewright.stages.suture.world.tubes import NEEDLE, THREAD, USUAL_NEEDLE, NeedleShape

__getattr__ = exported(__name__)
