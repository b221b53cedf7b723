"""How motion planning says no: an exception that carries the typed record of schemas.plan."""

from __future__ import annotations

from schemas.plan import Failure


class MotionFailed(Exception):
    """A query that has no answer within its budget; `failure` says which condition failed, with names and numbers."""

    def __init__(
        self, kind: str, message: str, objects: tuple[str, ...] = (), numbers: dict[str, float] | None = None
    ) -> None:
        super().__init__(message)
        rounded = {name: round(float(value), 6) for name, value in (numbers or {}).items()}
        self.failure = Failure(kind=kind, message=message, objects=objects, numbers=rounded)
