"""A lens cap or night: one line says so, and what depth shows is kept."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scenewright.stages.ingest.stage import brightness_of


@pytest.mark.parametrize("level", [0, 3, 120])
def test_brightness_is_the_same_of_pixels_and_of_files(level):
    picture = np.full((64, 80, 3), level, np.uint8)
    assert brightness_of(picture) == pytest.approx(level)
    assert brightness_of(cv2.imencode(".png", picture)[1].tobytes()) == pytest.approx(level, abs=1)
    assert brightness_of(cv2.imencode(".jpg", picture)[1].tobytes()) == pytest.approx(level, abs=2)
    assert brightness_of(b"no picture") == 255.0, "the reader says what is wrong with that"
