"""How motion planning says no: an exception that carries the typed record of scenewright.schemas.plan."""

from __future__ import annotations

from collections import Counter

import numpy as np
from scenewright.schemas.plan import Failure


class MotionFailed(Exception):
    """A query that has no answer within its budget; `failure` says which condition failed, with names and numbers."""

    def __init__(
        self, kind: str, message: str, objects: tuple[str, ...] = (), numbers: dict[str, float] | None = None
    ) -> None:
        super().__init__(message)
        rounded = {name: round(float(value), 6) for name, value in (numbers or {}).items()}
        self.failure = Failure(kind=kind, message=message, objects=objects, numbers=rounded)


def joint_limit(end: str, values: np.ndarray, outside: np.ndarray) -> MotionFailed:
    """Return the failure of an end of a path (D,) of which the joints are `outside` (D,) their limits [rad or m]."""
    joint = int(outside.argmax())
    return MotionFailed(
        "joint_limit",
        f"the {end} puts joint {joint} {outside[joint]:.4f} outside its limits",
        numbers={"joint": joint, "value": values[joint], "outside": outside[joint]},
    )


def end_in_collision(end: str, part: str, other: str, depth: float) -> MotionFailed:
    """Return the failure of a path whose start or goal (`end`) is in collision: what with what, and how deep [m]."""
    return MotionFailed(
        f"{end}_in_collision",
        f"at the {end}, {part} is in collision with {other} (depth {1000 * depth:.1f} mm)",
        (part, other),
        {"depth": depth},
    )


def no_path(samples: int, hits: Counter[str]) -> MotionFailed:
    """Return the failure of a search that used up its samples, with what blocked most often."""
    worst, count = hits.most_common(1)[0] if hits else ("", 0)
    return MotionFailed(
        "no_path",
        f"no path within {samples} samples; {worst or 'nothing'} blocked most ({count} of {hits.total()} collisions)",
        (worst,) if worst else (),
        {"samples": samples, "hits": count},
    )
