"""What a service says it is, for the key of an artifact: the same address may have another model tomorrow."""

from __future__ import annotations


def service_identity(address: str, *, timeout: float, retries: int, retry_wait: float) -> str:
    """Return the identity of the service at `address` now. Raises MissingDependency when none answers."""
    # Imported here: the declaration of the step, which asks for it, has to stay cheap.
    from stages.kit.services.connection import Connection
    from stages.segment.backends.service.backend import REFUSED_HINT, read_info

    connection = Connection(address, timeout=timeout, retries=retries, retry_wait=retry_wait, refused_hint=REFUSED_HINT)
    try:
        return read_info(connection).identity
    finally:
        connection.close()
