"""Rates of real segmenters on frames of three annotated logs (`python -m benchmarks.segmenter_rates`, 2026-11-26).

41 frames, 154 sights of things that the detector (yolox_nano) has a word for, 117 of our network's. Boxes of the
annotation are rough, so that missed and merged are upper bounds. Where two regions of views came out more alike than
one, which only few sights can do, both have the greater value.
"""

from __future__ import annotations

from scenewright.stages.segment.backends.ground_truth.lasting import Alike, LastingRates

RATES = {
    "detector": LastingRates(
        missed=0.461,
        merged=0.260 / (1 - 0.461),
        split=0.0,
        wrong_name=0.070,
        false_masks=0.098,
        missed_alike=Alike(0.711, 0.411),
        name_alike=Alike(0.391, 0.391),
        confusion={"chair": {"object": 1}, "table": {"chair": 1, "monitor": 1}},
        false_names={"plant": 2, "object": 1, "chair": 1},
    ),
    "network": LastingRates(
        missed=0.137,
        merged=0.436 / (1 - 0.137),
        split=0.034 / (1 - 0.137 - 0.436),
        wrong_name=0.429,
        false_masks=0.146,
        missed_alike=Alike(0.459, 0.087),
        name_alike=Alike(0.574, 0.428),
        confusion={"cabinet": {"object": 5}, "chair": {"object": 14}, "table": {"object": 2}},
        false_names={"object": 6},
    ),
}
