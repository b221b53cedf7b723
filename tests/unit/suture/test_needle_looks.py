"""What a needle's outline shows in the pictures: two rims, steel, an end; an edge of cloth or a shadow does not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scenewright.stages.suture.needle.estimate import estimate
from scenewright.stages.suture.needle.exchanged import eyes_exchanged
from scenewright.stages.suture.needle.looks import NAMES, looks_of
from scenewright.stages.suture.needle.observation import NeedleObservation
from scenewright.stages.suture.needle.radius_fit import estimate_without_radius
from scenewright.stages.suture.needle.silhouette import Outline, sheet_of
from scenewright.stages.suture.needle.windows import windows
from scenewright.stages.suture.rig import TWO_CAMERAS

from tests.unit.suture.needle_cases import observed, pose_at

TISSUE, CLOTH, STEEL = np.array([190.0, 80.0, 70.0]), np.array([120.0, 20.0, 25.0]), np.array([150.0, 150.0, 155.0])
SEEN = observed(pose_at())
MASKS = (SEEN.left_mask, SEEN.right_mask)


def ground() -> list[np.ndarray]:
    """Both eyes' pictures of mottled tissue."""
    random = np.random.default_rng(1)
    grey = 1.0 + 0.05 * random.standard_normal((TWO_CAMERAS.height, TWO_CAMERAS.width, 1))
    return [TISSUE * grey, TISSUE * grey[:, ::-1]]


def wire() -> tuple[np.ndarray, np.ndarray]:
    """Steel where the masks are."""
    pictures = ground()
    for picture, mask in zip(pictures, MASKS, strict=True):
        picture[mask] = STEEL
    return finished(pictures)


def edge(dark: float = 0.7, blur: float = 0.7) -> tuple[np.ndarray, np.ndarray]:
    """Cloth on the inner side of the needle's line, tissue on its outer side, a shadow as `dark` between them."""
    pictures, rig = ground(), TWO_CAMERAS
    around = pose_at().points(np.linspace(-0.5, np.pi + 0.5, 90))
    for picture, line in zip(pictures, (rig.left(around), rig.right(around)), strict=True):
        inside = np.zeros(picture.shape[:2], np.uint8)
        cv2.fillPoly(inside, [np.round(line).astype(np.int32)], 1)
        picture[inside > 0] = CLOTH
        shadow = np.zeros(picture.shape[:2], np.float32)
        cv2.polylines(shadow, [np.round(line).astype(np.int32)], False, dark, 3)
        picture *= 1.0 - cv2.GaussianBlur(shadow, (0, 0), 1.0)[..., None]
    return finished(pictures, blur)


def finished(pictures: list[np.ndarray], blur: float = 0.7) -> tuple[np.ndarray, np.ndarray]:
    left, right = (np.clip(cv2.GaussianBlur(p, (0, 0), blur), 0, 255).astype(np.uint8) for p in pictures)
    return left, right


def looks(pictures: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    eyes = windows(SEEN)
    outline = Outline(pose_at(), np.zeros(2), 0.0, np.eye(8))
    values = looks_of(TWO_CAMERAS, (sheet_of(eyes[0]), sheet_of(eyes[1])), pictures, outline)
    return dict(zip(NAMES, values.tolist(), strict=True))


@pytest.mark.parametrize("blur", [0.7, 2.0])
def test_no_edge_is_a_ridge_however_soft(blur: float) -> None:
    assert looks(edge(dark=0.0, blur=blur))["ridge"] < 0.1


def test_a_wire_is_a_ridge_and_grey() -> None:
    of_wire = looks(wire())
    assert of_wire["ridge"] > 0.6 and of_wire["colour"] < 0.25


def test_a_wire_is_a_needle() -> None:
    answer = estimate(NeedleObservation(TWO_CAMERAS, *MASKS, pictures=wire()))
    assert not answer.abstained
    assert answer.pose.centre == pytest.approx(pose_at().centre, abs=0.001)


def test_a_shadowed_edge_of_cloth_is_none_whatever_its_masks_say() -> None:
    """The same masks, those of a needle: alone, they are one."""
    assert not estimate(NeedleObservation(TWO_CAMERAS, *MASKS)).abstained
    observation = NeedleObservation(TWO_CAMERAS, *MASKS, pictures=edge())
    assert "hardly a needle" in estimate(observation).abstained


@pytest.mark.slow
def test_what_is_no_needle_has_no_radius() -> None:
    answer, radius = estimate_without_radius(NeedleObservation(TWO_CAMERAS, *MASKS, pictures=edge()))
    assert answer.abstained and radius is None


def test_exchanged_is_asked_only_where_the_rows_match() -> None:
    assert "exchanged" in eyes_exchanged(TWO_CAMERAS, MASKS[::-1])
    assert eyes_exchanged(TWO_CAMERAS, MASKS) == ""
    rows, columns = np.mgrid[: TWO_CAMERAS.height, : TWO_CAMERAS.width]
    spot = (rows - 300) ** 2 + (columns - 200) ** 2 < 900
    other = (rows - 620) ** 2 + (columns - 900) ** 2 < 900
    assert eyes_exchanged(TWO_CAMERAS, (spot, other)) == "", "masks of different things share no row"
    random = np.random.default_rng(2)
    specks = [cv2.dilate((random.random(rows.shape) < 2e-4).astype(np.uint8), np.ones((3, 3))) > 0 for _ in range(2)]
    specks[0][:, 700:], specks[1][:, :500] = False, False
    assert eyes_exchanged(TWO_CAMERAS, (specks[0], specks[1])) == "", "their rows agree in nothing"
