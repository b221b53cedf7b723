"""Camera settings as other tools write them: ORB-SLAM's dotted keys and camodocal's two tables, in plain words."""

from __future__ import annotations

from typing import Any

from scenewright.schemas.errors import BadInput

ORB_SLAM = ("Camera.", "Camera1.")
"""What the keys of ORB-SLAM's settings begin with: versions 2 and 3."""
DEPTH_UNITS = ("DepthMapFactor", "RGBD.DepthMapFactor")
"""Stored depth per metre in ORB-SLAM's settings."""
RADIAL = ("k1", "k2", "p1", "p2", "k3")
CAMODOCAL = ("distortion_parameters", "projection_parameters")


def plain_camera(document: dict[Any, Any], where: str) -> dict[Any, Any]:
    """Return a document that states its camera by `fx` ... and `distortion`, as it is where it is of no other form.

    Raises BadInput for a model of camodocal that no pinhole picture can be made of.
    """
    prefix = next((prefix for prefix in ORB_SLAM if f"{prefix}fx" in document), None)
    if prefix is not None:
        camera = {key.removeprefix(prefix): value for key, value in document.items() if str(key).startswith(prefix)}
        if str(document.get("Camera.type", "")).startswith("Kannala"):
            return {**camera, **_fisheye(camera, ("k1", "k2", "k3", "k4"))}
        return {**camera, "distortion": [camera.get(name, 0.0) for name in RADIAL]}
    lens, pinhole = (document.get(name) for name in CAMODOCAL)
    if not isinstance(pinhole, dict):
        return document
    model = str(document.get("model_type", "PINHOLE")).upper()
    lens = lens if isinstance(lens, dict) else {}
    size = {name: document.get(name) for name in ("image_width", "image_height")}
    if model == "PINHOLE":
        return {**size, **pinhole, "distortion": [lens.get(name, 0.0) for name in RADIAL]}
    if model == "KANNALA_BRANDT":
        named = {"fx": "mu", "fy": "mv", "cx": "u0", "cy": "v0"}
        centre = {name: pinhole.get(theirs) for name, theirs in named.items()}
        return {**size, **centre, **_fisheye({**lens, **pinhole}, ("k2", "k3", "k4", "k5"))}
    raise BadInput(
        f"{where}: camera model {model} is not read",
        hint="calibrate with PINHOLE or KANNALA_BRANDT, or undistort first",
    )


def stated_depth_units(document: Any, where: str) -> float | None:
    """Return the stored depth per metre that ORB-SLAM's settings state, None where a document states none."""
    value = next((document[name] for name in DEPTH_UNITS if name in document), None)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e9:
        raise BadInput(f"{where}: DepthMapFactor {value!r:.40} is not a number of units per metre", hint="correct it")
    return float(value)


def _fisheye(numbers: dict[Any, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {"distortion": [numbers.get(name, 0.0) for name in names], "distortion_model": "equidistant"}
