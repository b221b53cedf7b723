"""How talking to a language model fails: a typed record with numbers, and the exit code of each kind."""

from __future__ import annotations

from scenewright.schemas.errors import BadInput, MachineFailure, MissingDependency, ScenewrightError, UsageError
from scenewright.schemas.plan import Failure

EXIT_CODES = {
    "unreadable_reply": BadInput.exit_code,
    "declined": BadInput.exit_code,
    "refused": BadInput.exit_code,
    "unreachable": MachineFailure.exit_code,
    "call_budget": UsageError.exit_code,
    "token_budget": UsageError.exit_code,
    "not_recorded": MissingDependency.exit_code,
}
"""Kind -> exit code when a command ends by it (docs/ARCHITECTURE.md). `unreadable_reply`: no reply followed the schema
within the re-prompts; `declined`: the model would not answer; `refused`: the service said no (address, key, model);
`unreachable`: no usable answer within the retries; the budgets are options; `not_recorded`: a prompt without a
transcript."""


class LanguageFailed(ScenewrightError):
    """A question without an answer; `failure` is the record that goes to people, artifacts and other planners."""

    def __init__(
        self,
        kind: str,
        message: str,
        *,
        numbers: dict[str, float] | None = None,
        objects: tuple[str, ...] = (),
        hint: str = "",
    ) -> None:
        super().__init__(message, hint=hint)
        self.exit_code = EXIT_CODES[kind]
        self.failure = Failure(kind=kind, message=message, objects=objects, numbers=numbers or {})
