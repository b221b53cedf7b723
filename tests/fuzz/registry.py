"""The harnesses by name. Says where they are without loading them, so that a fuzzer can instrument what they load."""

from __future__ import annotations

import importlib

from tests.fuzz.harness import Harness

MODULES = {
    "tests.fuzz.payloads": (
        "panoptic_zip panoptic_png npz ply our_ply obj stl glb urdf trajectory manifest json_payload settings journal"
    ),
    "tests.fuzz.logs": (
        "mcap rosbag1 rosbag2 rosbag2_metadata frames_mcap message ros_definition compressed_depth "
        "image_message room_mcap room_rosbag1 room_rosbag2"
    ),
    "tests.fuzz.layouts": (
        "layout_7scenes layout_redwood layout_posed_images layout_tum layout_scenenn layout_scannet "
        "layout_nerfstudio layout_replica layout_colmap layout_colmap_text layout_images layout_stray_scanner "
        "layout_record3d layout_polycam layout_scanner_app layout_arkit_scenes layout_scannetpp depth_array "
        "calibration_file pose_list"
    ),
    "tests.fuzz.models": "library_model",
    "tests.fuzz.networks": "service_reply service_info service_request label_table onnx_sidecar",
    "tests.fuzz.language": "model_reply model_answer transcript",
}
"""Module -> names of its harnesses, with blanks between them."""
NAMES = tuple(name for names in MODULES.values() for name in names.split())
INSTRUMENTED = [
    "scenewright.stages.ingest",
    "scenewright.stages.kit.labels",
    "scenewright.stages.library",
    "scenewright.stages.segment.networks",
    "scenewright.stages.segment.backends.service",
    "scenewright.stages.kit.formats",
    "scenewright.stages.kit.language",
    "scenewright.stages.kit.services",
    "scenewright.stages.engine",
    "schemas",
]
"""Packages of ours whose branches a fuzzer watches."""


def load(name: str) -> Harness:
    """Return a harness. Raises KeyError for an unknown name."""
    module = next((module for module, names in MODULES.items() if name in names.split()), None)
    if module is None:
        raise KeyError(f"no harness {name!r}; there are: {', '.join(NAMES)}")
    return importlib.import_module(module).HARNESSES[name]
