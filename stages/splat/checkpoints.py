"""The state of a training on disk, whole or not at all, so that a build that was killed goes on from there to the
bytes of one that was not."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.formats.numpy_files import read_all_arrays
from scenewright.stages.kit.registration.pose_graph import Edge
from scenewright.stages.kit.rendering.splatting.gaussians import Gaussians
from scenewright.stages.splat.building import Arrival
from scenewright.stages.splat.trainer import Learned, Trainer, TrainerState

FILE = "checkpoint.npz"
FACTS = ("steps", "rounds", "was_reset")


def write_checkpoint(folder: Path, trainer: Trainer, losses: Sequence[float]) -> None:
    """Write all that the rest of the training depends on. Raises OSError, and then what was there before stays."""
    state = trainer.state()
    arrays = {f"gaussians.{name}": array for name, array in trainer.gaussians.arrays().items()}
    arrays |= {f"moments.{name}": array for name, array in state.moments.items()}
    arrays |= {"moved": state.moved, "pull": state.pull, "losses": np.array(losses)}
    arrays["poses"] = np.array([each.camera_from_world for each in trainer.views]).reshape(-1, 4, 4)
    arrays["pose_moments"] = np.array([(each.first, each.second) for each in trainer.views]).reshape(-1, 2, 6)
    arrays["pose_steps"] = np.array([each.steps for each in trainer.views], np.int64)
    arrays |= {"origins": state.origins, "guessed": state.guessed}
    arrays["tried"] = np.array(state.tried, np.int64).reshape(-1, 2)
    arrays["edge_ends"] = np.array([(e.target, e.source, e.switchable) for e in state.edges], np.int64).reshape(-1, 3)
    arrays["edge_motions"] = np.array([edge.target_from_source for edge in state.edges]).reshape(-1, 4, 4)
    arrays["edge_information"] = np.array([edge.information for edge in state.edges]).reshape(-1, 6, 6)
    facts = {"random": trainer.random.bit_generator.state, **{name: getattr(state, name) for name in FACTS}}
    arrays["facts"] = np.frombuffer(json.dumps(facts).encode(), np.uint8)
    folder.mkdir(exist_ok=True)
    partial = folder / f"{FILE}.partial"
    try:
        with partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, folder / FILE)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def read_checkpoint(folder: Path, trainer: Trainer, arriving: Sequence[Arrival]) -> list[float] | None:
    """Bring a new trainer to where a written one was and return the losses so far; None where there is none that can be
    read, and then nothing was changed. `arriving`: the views of both."""
    try:
        arrays = read_all_arrays(folder / FILE)
        facts = json.loads(arrays["facts"].tobytes())
        gaussians = Gaussians(**{name: arrays[f"gaussians.{name}"] for name in trainer.gaussians.arrays()})
        moments = {name: arrays[f"moments.{name}"] for name in trainer.gaussians.arrays()}
        views = [
            Learned(arrival.view, pose, first, second, int(steps))
            for arrival, pose, (first, second), steps in zip(
                arriving, arrays["poses"], arrays["pose_moments"], arrays["pose_steps"], strict=False
            )
        ]
        edges = [
            Edge(int(target), int(source), motion, information, bool(switchable))
            for (target, source, switchable), motion, information in zip(
                arrays["edge_ends"], arrays["edge_motions"], arrays["edge_information"], strict=True
            )
        ]
        tried = [(int(target), int(source)) for target, source in arrays["tried"]]
        before = (arrays["moved"], arrays["pull"], arrays["origins"], arrays["guessed"], edges, tried)
        state = TrainerState(moments, *before, **{name: facts[name] for name in FACTS})
        trainer.random.bit_generator.state = facts["random"]
        trainer.go_on(gaussians, views, state)
        return [float(loss) for loss in arrays["losses"]]
    except (BadInput, OSError, ValueError, KeyError, TypeError):
        return None
