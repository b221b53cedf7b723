"""Why frames of a log are left out, and what helps."""

from __future__ import annotations

ADVICE = {
    "no_depth_within_tolerance": "compare the clocks of colour and depth; "
    "--maximum-time-difference SECONDS pairs what is further apart",
    "missing_pose": "ingest has --maximum-transform-gap, --pose-topic and --world-frame",
    "size_mismatch": "colour and depth of a frame must have one shape",
    "depth_not_16_bit": "pictures of depth for people are no depth: record 16-bit or float images",
    "no_valid_depth": "is the depth unit right (--depth-scale)?",
    "missing_color": "colour and depth files must pair",
    "missing_depth": "colour and depth files must pair",
}
"""Reason for which frames are lost -> what to do."""
