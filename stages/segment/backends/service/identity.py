"""What a service says it is, for the key of an artifact: the same address may have another model tomorrow."""

from __future__ import annotations

from stages.segment.backends.service import ServiceParameters
from stages.segment.backends.service.backend import connect, read_info


def service_identity(address: str, parameters: ServiceParameters) -> str:
    """Return the identity of the service at `address` now. Raises MissingDependency when none answers."""
    connection = connect(address, parameters)
    try:
        return read_info(connection).identity
    finally:
        connection.close()
