"""What a service says it is, for the key of an artifact: the same address may have another model tomorrow."""

from __future__ import annotations


def service_identity(address: str, *, timeout: float, retries: int, retry_wait: float) -> str:
    """Return the identity of the service at `address` now. Raises MissingDependency when none answers."""
    # Imported here: the declaration of the step, which asks for it, has to stay cheap.
    from stages.segment.service.backend import read_info
    from stages.segment.service.connection import Connection

    connection = Connection(address, timeout=timeout, retries=retries, retry_wait=retry_wait)
    try:
        return read_info(connection).identity
    finally:
        connection.close()
