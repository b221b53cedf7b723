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
    from scenewright.stages.suture.world.clutter import cluttered, false_masks
    from scenewright.stages.suture.world.corruption import noisy_disparity
    from scenewright.stages.suture.world.render import Eye, StereoView, render
    from scenewright.stages.suture.world.sampling import seen_scene
    from scenewright.stages.suture.world.scene import NeedleScene, moved_scene, random_motions
    from scenewright.stages.suture.world.tubes import NEEDLE, THREAD, USUAL_NEEDLE, NeedleShape

_MODULES = {
    "Estimate": "scenewright.stages.suture.evaluation.judgement",
    "judged": "scenewright.stages.suture.evaluation.judgement",
    "Follower": "scenewright.stages.suture.following",
    "growing_pairs": "scenewright.stages.suture.following",
    "learned_masks": "scenewright.stages.suture.masks",
    "masks_in": "scenewright.stages.suture.masks",
    "network_masks": "scenewright.stages.suture.masks",
    "spoiled_masks": "scenewright.stages.suture.masks",
    "THROWS": "scenewright.stages.suture.motion.constants",
    "ARC_POINTS": "scenewright.stages.suture.motion.needle",
    "motions_to_last": "scenewright.stages.suture.motion_reports",
    "reported_motion": "scenewright.stages.suture.motion_reports",
    "draw_eyes": "scenewright.stages.suture.needle.drawing",
    "estimate": "scenewright.stages.suture.needle.estimate",
    "fuse": "scenewright.stages.suture.needle.filter",
    "NeedleEstimate": "scenewright.stages.suture.needle.observation",
    "NeedleObservation": "scenewright.stages.suture.needle.observation",
    "estimate_without_radius": "scenewright.stages.suture.needle.radius_fit",
    "thesis_average": "scenewright.stages.suture.needle.thesis",
    "thesis_estimate": "scenewright.stages.suture.needle.thesis",
    "ARM_NAMES": "scenewright.stages.suture.options",
    "ENDOSCOPE": "scenewright.stages.suture.rig",
    "NEEDLE_RADIUS": "scenewright.stages.suture.rig",
    "NeedlePose": "scenewright.stages.suture.rig",
    "StereoRig": "scenewright.stages.suture.rig",
    "TWO_CAMERAS": "scenewright.stages.suture.rig",
    "Masks": "scenewright.stages.suture.segmentation.infer",
    "Segmenter": "scenewright.stages.suture.segmentation.infer",
    "ThreadCurve": "scenewright.stages.suture.thread.reconstruct",
    "reconstruct_thread": "scenewright.stages.suture.thread.reconstruct",
    "CALIBRATION_ERROR": "scenewright.stages.suture.training.network.views",
    "kept_view": "scenewright.stages.suture.training.network.views",
    "read_eye": "scenewright.stages.suture.training.network.views",
    "draw_strip": "scenewright.stages.suture.trials.drawing",
    "run_trial": "scenewright.stages.suture.trials.machine",
    "BySeenEnds": "scenewright.stages.suture.trials.ours.pose_correction",
    "PerceptionModel": "scenewright.stages.suture.trials.perception",
    "Seen": "scenewright.stages.suture.trials.perception",
    "perception_model": "scenewright.stages.suture.trials.perception",
    "OURS": "scenewright.stages.suture.trials.policies",
    "POLICIES": "scenewright.stages.suture.trials.policies",
    "THESIS": "scenewright.stages.suture.trials.policies",
    "Recorder": "scenewright.stages.suture.trials.recording",
    "run_of": "scenewright.stages.suture.trials.records",
    "Looked": "scenewright.stages.suture.trials.sight",
    "LookingEyes": "scenewright.stages.suture.trials.sight",
    "PICTURED_FROM_TRIAL": "scenewright.stages.suture.trials.sight",
    "NoSweep": "scenewright.stages.suture.trials.thesis.extraction",
    "NormalUnchanged": "scenewright.stages.suture.trials.thesis.handover",
    "cluttered": "scenewright.stages.suture.world.clutter",
    "false_masks": "scenewright.stages.suture.world.clutter",
    "noisy_disparity": "scenewright.stages.suture.world.corruption",
    "Eye": "scenewright.stages.suture.world.render",
    "StereoView": "scenewright.stages.suture.world.render",
    "render": "scenewright.stages.suture.world.render",
    "seen_scene": "scenewright.stages.suture.world.sampling",
    "NeedleScene": "scenewright.stages.suture.world.scene",
    "moved_scene": "scenewright.stages.suture.world.scene",
    "random_motions": "scenewright.stages.suture.world.scene",
    "NEEDLE": "scenewright.stages.suture.world.tubes",
    "NeedleShape": "scenewright.stages.suture.world.tubes",
    "THREAD": "scenewright.stages.suture.world.tubes",
    "USUAL_NEEDLE": "scenewright.stages.suture.world.tubes",
}

__getattr__ = exported(__name__, _MODULES)
