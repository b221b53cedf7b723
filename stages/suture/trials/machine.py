"""The state machine of figure 3.2 over whole trials, with a scripted supervisor where the arm has one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scenewright.stages.suture.motion.constants import THROWS, cinch_length
from scenewright.stages.suture.trials.bench import CORNER, HOME, Bench, Failed, loaded
from scenewright.stages.suture.trials.extraction import cinch, extract
from scenewright.stages.suture.trials.handover import hand_over
from scenewright.stages.suture.trials.insertion import insert
from scenewright.stages.suture.trials.perception import FOLDER, Eyes, Looking, PerceptionModel, perception_model
from scenewright.stages.suture.trials.policy import Policy
from scenewright.stages.suture.trials.recording import Recorder
from scenewright.stages.suture.trials.settings import World
from scenewright.stages.suture.trials.thread import LEFT_IN_FIRST_HOLE, Thread
from scenewright.stages.suture.trials.wound import exit_


class Watching(Looking, Protocol):
    """Who sees what is rendered of the trial."""

    def watch(self, bench: Bench) -> None:
        """Look at this trial from now on."""
        ...


@dataclass
class Outcome:
    """What a trial came to. `sutures` as in section 4.1 (inserted, extracted, tensioned), `sutures_neutral` as in
    section 2.2 (also back at a neutral place without a tangle); errors with their class and reason, in order, and at
    which suture (0 first) and second each happened."""

    sutures: int = 0
    sutures_neutral: int = 0
    attempts: int = 0
    seconds: float = 0.0
    errors: list[tuple[str, str]] = field(default_factory=list)
    error_places: list[tuple[int, float]] = field(default_factory=list)
    interventions: int = 0
    looks: int = 0
    right: int = 0
    abstained: int = 0
    stopped_short: int = 0
    thread_length: float = 0.0

    @property
    def closed(self) -> bool:
        """Whether all six sutures were thrown."""
        return self.sutures >= THROWS


def run_trial(
    policy: Policy,
    seed: int,
    world: World | None = None,
    model: PerceptionModel | None = None,
    recorder: Recorder | None = None,
    eyes: Watching | None = None,
) -> Outcome:
    """Throw up to six sutures; the same seed gives every arm the same needle, thread and calibration error.

    `eyes` look at rendered views of the trial; without them the needle is seen by the error model.
    """
    world = world or World()
    model = model or perception_model(FOLDER / f"perception_{policy.perception}.toml")
    random = np.random.default_rng([seed, 0])
    length = float(random.uniform(world.thread_shortest, world.thread_longest))
    hand_eye = world.hand_eye * random.standard_normal(3)
    needle, hold = loaded(world, random)
    bench = Bench(
        world=world,
        eyes=eyes or Eyes(model, np.random.default_rng([seed, 2])),
        random=np.random.default_rng([seed, 1]),
        hand_eye=hand_eye,
        thread=Thread(length),
        needle=needle,
        hold=hold,
        recorder=recorder,
    )
    if eyes is not None:
        eyes.watch(bench)
    bench.tools["right"] = CORNER.copy()
    bench.lay_thread()
    outcome = Outcome(thread_length=length)
    while bench.suture < THROWS:
        outcome.attempts += 1
        thrown = bench.suture
        try:
            throw(bench, policy, outcome)
        except Failed as failure:
            outcome.errors.append((failure.kind, failure.reason))
            outcome.error_places.append((thrown, bench.seconds))
            bench.record(f"failed {failure.kind}")
            if outcome.interventions >= policy.interventions:
                break
            outcome.interventions += 1
            recover(bench, policy, random, thrown)
            bench.record("supervisor")
    outcome.seconds = bench.seconds
    outcome.looks, outcome.right, outcome.abstained = bench.eyes.looks, bench.eyes.right, bench.eyes.abstained
    outcome.stopped_short = bench.stopped_short
    if outcome.closed:
        bench.record("closed")
    return outcome


def throw(bench: Bench, policy: Policy, outcome: Outcome) -> None:
    """One suture: insertion, sweep and extraction with cinching, handover; then the pose correction of the next.

    The state machine enters at pose correction, where the needle is first seen.
    """
    belief = policy.pose_correction.believed(bench, policy.trust)
    insert(bench, belief, policy.coordination)
    policy.sweep.sweep(bench, policy.coordination)
    extract(bench, policy)
    cinch(bench, policy)
    outcome.sutures += 1
    bench.suture += 1
    hand_over(bench, policy)
    if bench.tangled("right"):
        raise Failed("T", "thread is wound about the right driver")
    outcome.sutures_neutral += 1


def recover(bench: Bench, policy: Policy, random: np.random.Generator, thrown: int) -> None:
    """The scripted supervisor: one motion that puts the needle back into the right driver in the corner, clears the
    thread, and draws it to the cinch length of the stitch before where there is any. A stitch that was made stays;
    one that was not is made anew.
    """
    bench.tools = {name: pose.copy() for name, pose in HOME.items()}
    bench.tools["right"] = CORNER.copy()
    bench.needle, bench.hold = loaded(bench.world, random)
    last_suture = bench.suture - 1
    bench.anchor = exit_(last_suture) if last_suture >= 0 else None
    thread = bench.thread
    thread.through = last_suture + 1
    if last_suture >= 0:
        target_length = cinch_length(last_suture, policy.constants)
        fed = min(max(0.0, target_length - thread.working), max(0.0, thread.tail - LEFT_IN_FIRST_HOLE))
        thread.working, thread.tail = thread.working + fed, thread.tail - fed
        bench.tail_reckoned -= fed
    elif thrown == 0:
        thread.working += max(0.0, thread.tail)
        thread.tail = 0.0
    bench.lay_thread()
