"""A build that is killed goes on from its last checkpoint, to the bytes of one that was not."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from scenewright.schemas.sequence import Sequence
from scenewright.stages.engine.runner import run_stage
from scenewright.stages.splat import build_stage
from scenewright.stages.splat.checkpoints import FILE, write_checkpoint
from scenewright.stages.splat.parameters import BUILD, BuildParameters
from scenewright.stages.splat.trainer import Trainer

from tests.unit.poses.textured_room import round_walk, write_sequence
from tests.unit.viewing.artifacts import seal

PARAMETERS = BuildParameters.model_validate(
    {
        "width": 80,
        "steps": 30,
        "steps_per_second": 10.0,
        "hold_out_every": 4,
        "refine_poses": True,
        "adjust_every": 3,
        "method": "thesis",
    }
)


class Killed(BaseException):
    """As if the process had ended."""


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    folder = tmp_path_factory.mktemp("log")
    write_sequence(folder / "sequence", round_walk(49)[:13], with_pose=True)
    return Sequence(seal(folder / "sequence", "sequence"))


def build(sequence: Sequence, out: Path, *, force: bool = False) -> str:
    return run_stage(BUILD, {"sequence": sequence.root}, out, PARAMETERS, seed=3, force=force).manifest.content_digest


@pytest.fixture(scope="module")
def undisturbed(sequence: Sequence, tmp_path_factory: pytest.TempPathFactory) -> str:
    return build(sequence, tmp_path_factory.mktemp("whole") / "splat")


def killed_after(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    step = Trainer.step

    def until(self: Trainer) -> float:
        if self.steps == steps:
            raise Killed
        return step(self)

    monkeypatch.setattr(Trainer, "step", until)


@pytest.mark.parametrize("steps", [3, 24])
@pytest.mark.slow
def test_it_goes_on_to_the_same_bytes(
    steps: int, sequence: Sequence, undisturbed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "splat"
    monkeypatch.setattr(build_stage, "CHECKPOINT_EVERY", 0.0)
    with monkeypatch.context() as patch, pytest.raises(Killed):
        killed_after(steps, patch)
        build(sequence, out)
    assert not out.exists()
    (kept,) = tmp_path.glob(".splat.kept-*")
    taken: list[int] = []
    step = Trainer.step
    monkeypatch.setattr(Trainer, "step", lambda self: (taken.append(self.steps), step(self))[1])
    assert build(sequence, out) == undisturbed
    assert taken[0] == steps and not kept.exists()


@pytest.mark.slow
def test_a_torn_checkpoint_and_force_begin_anew(
    sequence: Sequence, undisturbed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "splat"
    monkeypatch.setattr(build_stage, "CHECKPOINT_EVERY", 0.0)
    with monkeypatch.context() as patch, pytest.raises(Killed):
        killed_after(10, patch)
        build(sequence, out)
    (kept,) = tmp_path.glob(".splat.kept-*")
    saved = tmp_path / "saved"
    shutil.copytree(kept, saved)
    (kept / FILE).write_bytes((kept / FILE).read_bytes()[:5000])
    assert build(sequence, out) == undisturbed
    shutil.rmtree(out)
    shutil.copytree(saved, kept)
    began: list[int] = []
    step = Trainer.step
    monkeypatch.setattr(Trainer, "step", lambda self: (began.append(self.steps), step(self))[1])
    assert build(sequence, out, force=True) == undisturbed and began[0] == 0


def test_a_full_disk_leaves_the_checkpoint_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    trainer = Trainer(build_stage.method_of("ours"), build_stage.rasterizer_of("cpu"), np.random.default_rng(0))
    write_checkpoint(tmp_path, trainer, [1.0])
    before = (tmp_path / FILE).read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez", full)
    with pytest.raises(OSError, match="No space"):
        write_checkpoint(tmp_path, trainer, [2.0])
    assert (tmp_path / FILE).read_bytes() == before and len(list(tmp_path.iterdir())) == 1
