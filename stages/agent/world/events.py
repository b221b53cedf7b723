"""What truly happened, for the judge: executions as they went, and what the eyes got wrong."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Event:
    """An execution, or a failure of the eyes, as it truly went."""

    verb: str
    """`drive`, `grasp`, `release`, `pull`; `look` for what the eyes got wrong."""
    step: str
    """What was to be achieved: executions of one step are tries of the same thing."""
    ok: bool
    cause: str = ""
    replanned: bool = False
    """The same step had failed before."""


class EventLog:
    """Events in order, and which steps failed last time."""

    def __init__(self) -> None:
        self.events: list[Event] = []
        self._failed: set[str] = set()

    def done(self, verb: str, step: str, ok: bool, cause: str, held: str) -> None:
        """Log an execution. `held`: class of what is held after it; taking the right thing is another try of what
        took a wrong one of that class before."""
        same = {step}
        if verb == "grasp" and held:
            same.add(f"grasp a {held}")
        self.events.append(Event(verb, step, ok, "" if ok else cause, bool(same & self._failed)))
        if ok:
            self._failed -= same
        else:
            self._failed.add(step)

    def mistaken(self, cause: str, step: str) -> None:
        """Log once what the eyes got wrong."""
        if not any(e.cause == cause and e.step == step for e in self.events):
            self.events.append(Event("look", step, False, cause))
