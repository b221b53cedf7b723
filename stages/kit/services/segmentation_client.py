"""Who answers at the address of a segmentation service (docs/SEGMENTATION.md)."""

from __future__ import annotations

from scenewright.schemas.errors import BadInput, MachineFailure, MissingDependency
from scenewright.stages.kit.services.connection import Connection
from scenewright.stages.kit.services.segmentation_protocol import INFO_PATH, ServiceInfo, parse_info

REFUSED_HINT = "is this a segmentation service? see docs/SEGMENTATION.md"


def connect(address: str, *, timeout: float = 60.0, retries: int = 3, retry_wait: float = 0.5) -> Connection:
    """Return a connection to the service at `address`; nothing is asked yet. Times in seconds, as of Connection."""
    return Connection(address, timeout=timeout, retries=retries, retry_wait=retry_wait, refused_hint=REFUSED_HINT)


def read_info(connection: Connection) -> ServiceInfo:
    """Return what a service says of itself. Raises MissingDependency when none answers, BadInput for something else."""
    try:
        answer = connection.get(INFO_PATH)
    except MachineFailure as error:
        raise MissingDependency(
            f"no segmentation service answers: {error.message}",
            hint="start one (scenewright models serve --backend ... --port ...), or check the address",
        ) from None
    try:
        return parse_info(answer.body, answer.content_type)
    except BadInput as error:
        raise BadInput(f"{connection.address}{INFO_PATH}: {error.message}", hint=REFUSED_HINT) from None


def read_identity(connection: Connection) -> str:
    """Return the name under which a service goes into keys, and close the connection. Raises as `read_info`."""
    try:
        return read_info(connection).identity
    finally:
        connection.close()
