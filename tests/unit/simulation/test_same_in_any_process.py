"""Physics says the same in a fresh process, in one that did much before, and in a fork; in a pytest worker any test
may have run before."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np
import pytest
import trimesh
from scenewright.stages.kit.simulation.engine import engine
from scenewright.stages.kit.simulation.world import PhysicsWorld
from scenewright.stages.urdf.settle_report import settle_report

from tests.unit.simulation.handmade_scene import write_scene
from tests.unit.simulation.verdicts import Verdicts, rocking, verdicts

ROOT = Path(__file__).parents[3]


def begun(folder: Path, *words: str, threads: int = 1) -> subprocess.Popen[bytes]:
    """Start a fresh process that writes what physics says into `folder`."""
    count = dict.fromkeys(("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS"), str(threads))
    command = [sys.executable, "-m", "tests.unit.simulation.verdicts", str(folder), *words]
    return subprocess.Popen(command, cwd=ROOT, env=os.environ | count, stdout=subprocess.DEVNULL)


def said(process: subprocess.Popen[bytes], folder: Path) -> Verdicts:
    """Wait for the process and return what it wrote."""
    assert process.wait() == 0
    return {name: tuple(entry) for name, entry in json.loads((folder / "verdicts.json").read_text()).items()}


@contextlib.contextmanager
def lived() -> Iterator[None]:
    """A process that has simulated, cast rays, inferred and compiled; a world with other parameters stays open."""
    for _ in range(100):
        with PhysicsWorld(1 / 120) as world:
            ball = engine.createCollisionShape(engine.GEOM_SPHERE, radius=0.1, physicsClientId=world.client)
            for height in (0.0, 0.15):
                engine.createMultiBody(1.0, ball, basePosition=[0, 0, height], physicsClientId=world.client)
            world.step(10)
    mesh = trimesh.creation.icosphere(subdivisions=3)
    assert mesh.ray.intersects_any(np.zeros((50, 3)), np.ones((50, 3))).all()
    with contextlib.suppress(ImportError):
        import torch

        torch.nn.functional.conv2d(torch.ones(1, 3, 32, 32), torch.ones(4, 3, 3, 3))
    assert numba.njit(lambda value: value / 3, fastmath=True)(1e-310) >= 0.0
    with PhysicsWorld() as world:
        engine.setPhysicsEngineParameter(
            contactBreakingThreshold=0.002, contactERP=0.8, frictionERP=0.2, physicsClientId=world.client
        )
        world.step()
        yield


@pytest.mark.parametrize("execute", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_process_that_did_much_says_what_a_fresh_one_and_a_fork_say(tmp_path: Path, execute: bool) -> None:
    words = ["execute"] if execute else []
    fresh, fork = begun(tmp_path / "fresh", *words), begun(tmp_path / "fork", "fork", *words)
    with lived():
        here = verdicts(tmp_path / "here", execute=execute)
    expected = {"kitchen": "ok", "rocking": "unsettled"} | ({"execution": "executed"} if execute else {})
    assert {name: verdict for name, (verdict, _) in here.items()} == expected
    assert said(fresh, tmp_path / "fresh") == here
    assert said(fork, tmp_path / "fork") == here


@pytest.mark.slow
def test_two_threads_come_to_the_same_verdicts(tmp_path: Path) -> None:
    one, two = begun(tmp_path / "one", "execute"), begun(tmp_path / "two", "execute", threads=2)
    alone, both = said(one, tmp_path / "one"), said(two, tmp_path / "two")
    assert {name: entry[0] for name, entry in alone.items()} == {name: entry[0] for name, entry in both.items()}


def test_parameters_of_one_world_leave_the_others_alone(tmp_path: Path) -> None:
    """Contacts that break at a tenth of the distance let the bottles rock elsewhere."""
    write_scene(tmp_path, rocking())
    before = settle_report(tmp_path, 0.5)
    with lived():
        assert settle_report(tmp_path, 0.5) == before
