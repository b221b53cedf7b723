"""A classifier of crops fills half of what masks leave to no name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.splat.language.classifier import BELIEVED, CropClassifier, labels_of, with_classifier
from scenewright.stages.splat.parameters import LabelParameters, check_classifier

LABELS = ("coffee mug", "joystick", "table lamp")
CROPS = np.array([[0.5, 0.5, 0.0], [0.3, 0.7, 0.0]], np.float32)


def test_labels_share_half_of_what_no_mask_names() -> None:
    heard = with_classifier({"book": 0.2}, CROPS, LABELS, 0.2)
    assert heard == {
        "book": 0.2,
        "coffee mug": pytest.approx(BELIEVED * 0.8 * 0.4, abs=1e-4),
        "joystick": pytest.approx(BELIEVED * 0.8 * 0.6, abs=1e-4),
    }
    assert sum(heard.values()) < 1.0


def test_what_cannot_be_so_large_is_left_out() -> None:
    assert "coffee mug" not in with_classifier({}, CROPS, LABELS, 0.6)
    assert with_classifier({}, CROPS, LABELS, 1.2) == {}
    assert with_classifier({"cup": 1.0}, CROPS, LABELS, 0.1) == {"cup": 1.0}
    assert with_classifier({"cup": 0.5}, CROPS[:0], LABELS, 0.1) == {"cup": 0.5}


def test_labels_are_the_last_column(tmp_path: Path) -> None:
    path = tmp_path / "labels.csv"
    path.write_text("0,n01,coffee_mug\n1,n02,joystick\n")
    assert labels_of(path) == ("coffee mug", "joystick")
    path.write_text("")
    for bad in (path, tmp_path / "none.csv"):
        with pytest.raises(BadInput, match="no labels|file is missing"):
            labels_of(bad)


def test_a_file_that_is_no_network_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("ai_edge_litert")
    (tmp_path / "net.tflite").write_bytes(b"not a network")
    (tmp_path / "labels.csv").write_text("cup\n")
    with pytest.raises(BadInput, match="cannot be opened"):
        CropClassifier(tmp_path / "net.tflite", tmp_path / "labels.csv")


def test_classifier_and_labels_go_together() -> None:
    with pytest.raises(UsageError, match="go together"):
        check_classifier(LabelParameters(), {"classifier": Path("net.tflite"), "classifier_labels": None})
    check_classifier(LabelParameters(), {"classifier": None, "classifier_labels": None})
