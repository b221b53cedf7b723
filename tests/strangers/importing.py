"""Runs `library add` on a folder and reads what became of each model; MuJoCo says what an MJCF means."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.strangers.calls import CLEAR_CODES, Said, call


@dataclass(frozen=True)
class Added:
    """What `library add` made of a folder."""

    said: Said
    models: list[dict[str, Any]]
    """Models of library.json."""
    records: list[dict[str, Any]]
    """Models of imports.json, those that were left out too."""
    out: Path

    @property
    def text(self) -> str:
        """All that was said and all findings."""
        findings = [finding for record in self.records for finding in record["findings"]]
        return " ".join([self.said.text, *findings])

    def names(self, *words: str) -> bool:
        """Return whether every word (a regular expression) is said or found."""
        return Said(0, self.text, "").names(*words)

    @property
    def only(self) -> dict[str, Any]:
        """The one model."""
        assert len(self.models) == 1, f"{[model['id'] for model in self.models]}: {self.text}"
        return self.models[0]


def add(folder: Path, out: Path, *options: str | Path) -> Added:
    """Import a folder; hollow pieces are filled by their hulls, so that it is fast."""
    said = call("library", "add", folder, "--out", out, "--decomposition", "hulls", *options)
    assert said.code == 0 or said.code in CLEAR_CODES, said.text
    models = json.loads((out / "library.json").read_text())["models"] if (out / "library.json").exists() else []
    records = json.loads((out / "imports.json").read_text())["models"] if (out / "imports.json").exists() else []
    return Added(said, models, records, out)


def right_or_named(added: Added, right: Callable[[dict[str, Any]], None], *words: str) -> None:
    """The one model is right, or what was left out is named; a library's exception is no name."""
    try:
        right(added.only)
    except AssertionError as wrong:
        for exception in ("KeyError", "IndexError", "ValueError", "list index out of range"):
            assert exception not in added.text, added.text
        assert added.names(*words), f"{wrong}\nand {words} are not named: {added.text}"


def size(model: dict[str, Any], state: int = 0) -> np.ndarray:
    """Return the bounding box of a state [m], closed first."""
    return np.subtract(model["states"][state]["box_maximum"], model["states"][state]["box_minimum"])


def is_size(model: dict[str, Any], *expected: float) -> None:
    np.testing.assert_allclose(size(model), expected, atol=1e-3)


def hinge(model: dict[str, Any], name: str, origin: tuple[float, ...] | np.ndarray, axis: tuple[float, ...]) -> None:
    """The joint's line is right within 1 mm: where along its axis its origin lies does not matter."""
    found = [joint for joint in model["joints"] if joint["name"] == name]
    assert found, f"joint {name!r} is not among {[joint['name'] for joint in model['joints']]}"
    unit = np.asarray(axis, float) / np.linalg.norm(axis)
    assert abs(abs(np.dot(found[0]["axis"], unit)) - 1) < 1e-4, found[0]["axis"]
    away = np.subtract(found[0]["origin"], origin)
    assert np.linalg.norm(away - unit * np.dot(away, unit)) < 1e-3, found[0]["origin"]


@dataclass(frozen=True)
class Compiled:
    """What MuJoCo makes of a file, in the frame of our models: the bottom's centre is the origin."""

    size: np.ndarray
    joints: dict[str, tuple[np.ndarray, np.ndarray]]
    """Name -> anchor and axis."""


def compiled(path: Path) -> Compiled:
    """Compile a file and return the box of its geoms, all of them, and its joints."""
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    corners = []
    for geom in range(model.ngeom):
        middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        corners.append((middle + signs * half) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    origin = np.array([*(low + high)[:2] / 2, low[2]])
    joints = {model.joint(k).name: (data.xanchor[k] - origin, data.xaxis[k].copy()) for k in range(model.njnt)}
    return Compiled(high - low, joints)


def like_mujoco(path: Path) -> Callable[[dict[str, Any]], None]:
    """Return a check that a model has MuJoCo's size and joints."""
    wanted = compiled(path)

    def right(model: dict[str, Any]) -> None:
        is_size(model, *wanted.size)
        for name, (anchor, axis) in wanted.joints.items():
            hinge(model, name, anchor, tuple(axis))

    return right


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path
