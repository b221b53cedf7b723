"""What trainings have in common: rate, steps, moving average of the weights, state on disk, log.

A run that was stopped and started again ends with the bytes of one that was not, on the same machine with one thread,
when its samples depend on the seed and the step's number alone.
"""

from __future__ import annotations

import json
import logging
import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scenewright.schemas.errors import BadInput
from scenewright.stages.kit.training.run_state import read_state, write_state

_LOGGER = logging.getLogger("scenewright")
FACTS, LOG = "state.json", "log.jsonl"
LOGGED_EVERY = 50
"""Steps between two lines of the log."""


def rate_at(step: int, steps: int, peak: float, warm_up: float) -> float:
    """Return the learning rate: a linear rise to `peak` over the share `warm_up`, then half a cosine to a hundredth."""
    warm = max(1, round(warm_up * steps))
    if step < warm:
        return peak * (step + 1) / warm
    share = (step - warm) / max(1, steps - warm)
    return peak * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * share)))


class TrainingRun:
    """A network in training: its moving average, its optimiser (AdamW), the steps taken, and all of it in a folder.

    `plan` is what the run is, as JSON holds it: a folder goes on with the same plan alone. A subclass says its
    `average_decay` and `gradient_norm`; `keeps_gradients` gives a parameter that nothing used a state as well.
    `single_precision`: the loss comes of no bfloat16; oneDNN's gradients of convolutions in it write past their ends on
    processors with AVX-512 of AMD, so that they are computed without oneDNN there, six times as slowly.
    """

    average_decay: float
    gradient_norm: float
    keeps_gradients = False
    single_precision = False

    def __init__(
        self, network: torch.nn.Module, plan: Mapping[str, Any], out: Path, peak_rate: float, weight_decay: float
    ) -> None:
        """Begin, or go on from the state in `out`. Raises BadInput when that is of another plan, or damaged."""
        self.network = network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.average = {name: value.clone() for name, value in network.state_dict().items()}
        self.optimizer = torch.optim.AdamW(network.parameters(), lr=peak_rate, weight_decay=weight_decay, fused=True)
        self.record, self.out, self.step, self.seconds = dict(plan), out, 0, 0.0
        if self.keeps_gradients:
            for parameter in network.parameters():
                parameter.grad = torch.zeros_like(parameter)
        if (out / FACTS).is_file():
            self._restore()

    def descend(self, loss: torch.Tensor, rate: float) -> None:
        """Take one step down a loss, at a learning rate."""
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.optimizer.zero_grad(set_to_none=not self.keeps_gradients)
        with torch.backends.mkldnn.flags(enabled=self.single_precision):  # type: ignore[attr-defined]
            loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), self.gradient_norm)
        self.optimizer.step()
        self.step += 1
        decay = min(self.average_decay, self.step / (self.step + 10))
        with torch.no_grad():
            now = self.network.state_dict()
            moving = [name for name, value in now.items() if value.is_floating_point()]
            torch._foreach_lerp_([self.average[name] for name in moving], [now[name] for name in moving], 1 - decay)
            for name in now.keys() - set(moving):
                self.average[name].copy_(now[name])

    def save(self) -> None:
        """Write the state, whole or not at all, and the facts about it."""
        write_state(self.out, self.network, self.average, self.optimizer, self.step)
        facts = {"step": self.step, "cpu_seconds": round(self.seconds, 1), "plan": self.record}
        (self.out / FACTS).write_text(json.dumps(facts, indent=1) + "\n")

    def _restore(self) -> None:
        facts = json.loads((self.out / FACTS).read_text())
        if facts["plan"] != self.record:
            raise BadInput(f"{self.out}: holds a run of another plan", hint="take another --out, or the same settings")
        self.average, self.step = read_state(self.out, self.network, self.optimizer)
        self.seconds = facts["cpu_seconds"]


def take_steps(
    run: TrainingRun,
    steps: int,
    step: Callable[[], Mapping[str, float | torch.Tensor]],
    save_every: float,
    held_out: Callable[[], Mapping[str, Any]] | None = None,
    held_out_every: int = 500,
    over: Callable[[], bool] = lambda: False,
) -> None:
    """Take the steps that are left, or those until `over` says so. `step` takes one and returns what to log of it, as
    means over the steps since the line before; `held_out` adds to the log what it finds. The state is saved every
    `save_every` seconds and at the end.
    """
    run.out.mkdir(parents=True, exist_ok=True)
    saved, seen = time.perf_counter(), list[Mapping[str, float | torch.Tensor]]()
    while run.step < steps:
        started = time.process_time()
        seen.append(step())
        run.seconds += time.process_time() - started
        last = run.step == steps or over()
        line: dict[str, Any] = {}
        if run.step % LOGGED_EVERY == 0 or last:
            means = {name: round(float(np.mean([float(one[name]) for one in seen])), 5) for name in seen[0]}
            line, seen = {"step": run.step, "cpu_seconds": round(run.seconds), **means}, []
        if held_out is not None and (run.step % held_out_every == 0 or last):
            line |= held_out()
        if line:
            with (run.out / LOG).open("a") as log:
                log.write(json.dumps(line) + "\n")
            _LOGGER.info("%s", json.dumps(line))
        if time.perf_counter() - saved > save_every or last:
            run.save()
            saved = time.perf_counter()
        if last:
            break
    _LOGGER.info("%d steps in %.1f CPU min: %s", run.step, run.seconds / 60, run.out)
