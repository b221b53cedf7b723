"""Both eyes about the needle: the mask's outline, our circle, its ends with their 95 % ellipses, or the abstention."""

from __future__ import annotations

import textwrap

import cv2
import numpy as np
from scenewright.stages.suture.needle.observation import NeedleEstimate
from scenewright.stages.suture.rig import NeedlePose, StereoRig

GREEN, YELLOW, RED, WHITE, VIOLET = (80, 220, 80), (250, 220, 40), (250, 60, 40), (255, 255, 255), (190, 110, 255)
"""Colours (RGB) of truth, answer, abstention, text and outlines, and of outlines of thread."""
Color = tuple[int, int, int]
CHI_95 = 5.99
"""Squared 95 % radius of two degrees of freedom."""
PANEL_WIDTH, PANEL_HEIGHT, MARGIN, FOOT = 720, 600, 25, 46
"""Size of one eye's panel, the room around the needle, and the height of the line of text below [px]; by eye."""
ARC = np.linspace(0.0, np.pi, 90)
"""Angles [rad] at which the needle is drawn."""


def draw_eyes(
    images: tuple[np.ndarray, np.ndarray],
    masks: tuple[np.ndarray, np.ndarray],
    rig: StereoRig,
    answer: NeedleEstimate,
    truth: NeedlePose | None = None,
) -> np.ndarray:
    """Return the left and the right eye's cut-out side by side, a line of text below, (h, w, 3) uint8 RGB.

    `images` (H, W, 3) uint8 RGB, `masks` (H, W) bool. The mask's outline is white; the estimate yellow, red where it
    was abstained from; a ring marks its tip, a square its swage; the truth, where there is one, is green.
    """
    panels = []
    for eye in (0, 1):
        corner, size = _window(rig, masks[eye], answer.pose, truth, eye)
        scale = PANEL_WIDTH / size[0]
        window = np.s_[corner[1] : corner[1] + size[1], corner[0] : corner[0] + size[0]]
        panel = cv2.resize(images[eye][window], (PANEL_WIDTH, PANEL_HEIGHT), interpolation=cv2.INTER_LINEAR)
        large = cv2.resize(
            masks[eye][window].astype(np.uint8), (PANEL_WIDTH, PANEL_HEIGHT), interpolation=cv2.INTER_NEAREST
        )
        cv2.drawContours(panel, cv2.findContours(large, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0], -1, WHITE, 1)
        if truth is not None:
            _draw_pose(panel, rig, truth, corner, scale, eye, GREEN)
        if answer.pose is not None:
            colour = RED if answer.abstained else YELLOW
            _draw_pose(panel, rig, answer.pose, corner, scale, eye, colour)
            if np.isfinite(answer.covariance).all():
                for angle in (0.0, np.pi):
                    _draw_ellipse(panel, rig, answer, angle, corner, scale, eye, colour)
        panels.append(panel)
    return np.vstack([np.hstack(panels), _foot(answer, 2 * PANEL_WIDTH)])


def _window(
    rig: StereoRig, mask: np.ndarray, pose: NeedlePose | None, truth: NeedlePose | None, eye: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return first pixel (column, row) and size of the part of the image to show, in the panel's form."""
    rows, columns = np.nonzero(mask)
    places = [np.stack([columns, rows], axis=1).astype(float)]
    places += [_pixels(rig, drawn, ARC, eye) for drawn in (pose, truth) if drawn is not None]
    points = np.concatenate(places)
    points = points[np.isfinite(points).all(axis=1)]
    limits = np.array([rig.width, rig.height], dtype=float)
    points = points[((points >= 0) & (points < limits)).all(axis=1)]
    if not len(points):
        points = np.array([limits / 4, 3 * limits / 4])
    low, high = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    width = max(high[0] - low[0], (high[1] - low[1]) * PANEL_WIDTH / PANEL_HEIGHT)
    width = min(max(width, 120.0), rig.width, rig.height * PANEL_WIDTH / PANEL_HEIGHT)
    size = np.array([int(width), int(width * PANEL_HEIGHT / PANEL_WIDTH)])
    corner = np.clip(np.round((low + high) / 2 - size / 2).astype(int), 0, np.array([rig.width, rig.height]) - size)
    return corner, size


def _foot(answer: NeedleEstimate, width: int) -> np.ndarray:
    """Return the line below both eyes: how sure the pose is, or why it is not answered."""
    text, colour = estimate_text(answer), RED if answer.abstained else WHITE
    foot = np.full((FOOT, width, 3), 25, np.uint8)
    cv2.putText(
        foot,
        textwrap.shorten(text, 118, placeholder=" ..."),
        (14, 30),
        cv2.FONT_HERSHEY_SIMPLEX,
        0.62,
        colour,
        1,
        cv2.LINE_AA,
    )
    return foot


def estimate_text(answer: NeedleEstimate) -> str:
    """Return an estimate in one line: where the centre is, how sure that is, how sure the tip; or the abstention."""
    if answer.abstained or answer.pose is None:
        return answer.abstained or "no pose"
    x, y, z = 1000 * answer.pose.centre
    text = f"centre ({x:.1f}, {y:.1f}, {z:.1f}) mm"
    if np.isfinite(answer.covariance).all():
        shift = 1000 * float(np.sqrt(np.linalg.eigvalsh(answer.covariance[:3, :3])[-1]))
        turn = np.degrees(float(np.sqrt(np.linalg.eigvalsh(answer.covariance[3:, 3:])[-1])))
        text += f", known to {shift:.2f} mm and {turn:.1f} degrees (1 sigma)"
    return text + f"; tip and swage {100 * answer.tip_probability:.0f} % sure"


def _pixels(rig: StereoRig, pose: NeedlePose, angles: np.ndarray, eye: int) -> np.ndarray:
    points = pose.points(angles)
    return rig.right(points) if eye else rig.left(points)


def _draw_pose(
    panel: np.ndarray, rig: StereoRig, pose: NeedlePose, corner: np.ndarray, scale: float, eye: int, colour: Color
) -> None:
    """Draw the arc, a ring about its tip and a square about its swage."""
    pixels = (_pixels(rig, pose, ARC, eye) - corner + 0.5) * scale
    if not np.isfinite(pixels).all():
        return
    points = np.clip(np.round(pixels), -10_000, 10_000).astype(np.int32)
    cv2.polylines(panel, [points.reshape(-1, 1, 2)], False, colour, 1, cv2.LINE_AA)
    tip, swage = points[0], points[-1]
    cv2.circle(panel, (int(tip[0]), int(tip[1])), 9, colour, 1, cv2.LINE_AA)
    cv2.rectangle(panel, (int(swage[0]) - 7, int(swage[1]) - 7), (int(swage[0]) + 7, int(swage[1]) + 7), colour, 1)


def _draw_ellipse(
    panel: np.ndarray,
    rig: StereoRig,
    answer: NeedleEstimate,
    angle: float,
    corner: np.ndarray,
    scale: float,
    eye: int,
    colour: Color,
) -> None:
    """Draw the 95 % ellipse of where the estimate says that the end at arc `angle` is seen."""
    assert answer.pose is not None
    point = answer.pose.points(np.array([angle]))[0]
    arm = point - answer.pose.centre
    turn = np.array([[0.0, arm[2], -arm[1]], [-arm[2], 0.0, arm[0]], [arm[1], -arm[0], 0.0]])
    of_point = np.hstack([np.eye(3), turn])
    step = 1e-5
    moved = np.vstack([point, point + step * np.eye(3)])
    pixels = rig.right(moved) if eye else rig.left(moved)
    if not np.isfinite(pixels).all():
        return
    jacobian = (pixels[1:] - pixels[0]).T / step
    covariance = jacobian @ of_point @ answer.covariance @ of_point.T @ jacobian.T
    values, vectors = np.linalg.eigh(covariance)
    axes = np.minimum(np.sqrt(np.maximum(values, 1e-6) * CHI_95) * scale, 5000.0)
    centre = np.clip((pixels[0] - corner + 0.5) * scale, -10_000, 10_000)
    degrees = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
    size = (max(int(axes[1]), 1), max(int(axes[0]), 1))
    cv2.ellipse(panel, (int(centre[0]), int(centre[1])), size, degrees, 0, 360, colour, 1, cv2.LINE_AA)
