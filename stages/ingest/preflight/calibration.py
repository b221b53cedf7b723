"""Intrinsics against the size of the images they are for."""

from __future__ import annotations

import math

from scenewright.schemas.scene_parts import Camera
from scenewright.stages.ingest.preflight.report import CalibrationReport, Finding, exact

CENTER_TOLERANCE = 0.15
"""Principal point off the middle, as share of the size."""
FIELD_OF_VIEW = (25.0, 130.0)
"""Horizontal, degrees: from a long lens to a wide one without distortion."""
ASPECT = (0.8, 1.25)
"""Focal lengths fx / fy between which pixels are plausible; by eye."""
RESIZES = (0.25, 1 / 3, 0.5, 2 / 3, 0.75, 1.5, 2.0, 3.0, 4.0)
"""Ratios of image sizes in which cameras are used."""


def calibration_report(camera: Camera) -> CalibrationReport:
    """Return what the intrinsics of a camera say."""
    width, height = max(camera.width, 1), max(camera.height, 1)
    field = tuple(
        exact(math.degrees(2 * math.atan(size / (2 * focal))))
        for size, focal in ((width, camera.fx), (height, camera.fy))
    )
    offset = ((camera.cx + 0.5) / width - 0.5, (camera.cy + 0.5) / height - 0.5)
    aspect = camera.fx / camera.fy
    return CalibrationReport(
        plausible=max(map(abs, offset)) <= CENTER_TOLERANCE
        and FIELD_OF_VIEW[0] <= field[0] <= FIELD_OF_VIEW[1]
        and ASPECT[0] <= aspect <= ASPECT[1],
        field_of_view=(field[0], field[1]),
        focal_aspect=exact(aspect),
        center_offset=(exact(offset[0], 3), exact(offset[1], 3)),
    )


def calibration_findings(report: CalibrationReport, camera: Camera, name: str) -> list[Finding]:
    """Return what is odd about the intrinsics."""
    findings = []

    def add(severity: str, message: str, fix: str) -> None:
        findings.append(Finding(severity=severity, check="calibration", message=message, fix=fix, camera=name))  # type: ignore[arg-type]

    give = "give --fx --fy --cx --cy"
    if max(map(abs, report.center_offset)) > CENTER_TOLERANCE:
        intrinsics = (
            f"the principal point ({camera.cx:g}, {camera.cy:g}) is far from the middle of a "
            f"{camera.width}x{camera.height} image"
        )
        resize = other_size(camera)
        if resize is not None:
            size = f"{camera.width / resize:.0f}x{camera.height / resize:.0f}"
            values = f"--fx {camera.fx * resize:.6g} --fy {camera.fy * resize:.6g} "
            values += f"--cx {(camera.cx + 0.5) * resize - 0.5:.6g} --cy {(camera.cy + 0.5) * resize - 0.5:.6g}"
            add("wasted", f"{intrinsics}: the calibration is for {size}", f"give {values}")
        elif _is_centered(camera.cy, camera.width) and _is_centered(camera.cx, camera.height):
            add("wasted", f"{intrinsics}: cx and cy are swapped", f"give --cx {camera.cy:g} --cy {camera.cx:g}")
        else:
            add("doubtful", intrinsics, f"{give}, unless the image was cropped")
    low, high = FIELD_OF_VIEW
    if not low <= report.field_of_view[0] <= high:
        add(
            "doubtful",
            f"focal length {camera.fx:g} makes a field of view of {report.field_of_view[0]:.0f} deg at "
            f"{camera.width} pixels",
            give,
        )
    if not ASPECT[0] <= report.focal_aspect <= ASPECT[1]:
        add("doubtful", f"pixels would not be square: fx / fy = {report.focal_aspect:.3g}", give)
    return findings


def other_size(camera: Camera) -> float | None:
    """Return the factor that makes the intrinsics fit the image, when they are those of a resized one."""
    for factor in RESIZES:
        centered = _is_centered((camera.cx + 0.5) * factor - 0.5, camera.width, 0.06)
        if centered and _is_centered((camera.cy + 0.5) * factor - 0.5, camera.height, 0.06):
            return factor
    return None


def _is_centered(center: float, size: int, tolerance: float = 0.1) -> bool:
    return abs((center + 0.5) / max(size, 1) - 0.5) <= tolerance
