"""Addresses of services, checked before they are used or written into a manifest. Cheap to import."""

from __future__ import annotations

import ipaddress
from urllib.parse import urlsplit

SEGMENTATION = "http://HOST:PORT of a segmentation service"
"""How the address of one reads, for help and errors."""


def check_address(address: str, *, form: str) -> str:
    """Return the address without its closing slash; `form` says in errors how one reads.

    Raises ValueError for what is no http or https address of a service, and for one that carries a user, a password,
    a query or a fragment.
    """
    try:
        url = urlsplit(address)
        port_is_sound = url.port is None or url.port > 0
    except ValueError as error:  # a port that is no number, a torn IPv6 address
        raise ValueError(f"not the address of a service: {error}") from None
    sound = url.scheme in ("http", "https") and url.hostname and port_is_sound
    if not sound or not address.isascii() or not address.isprintable() or " " in address:
        raise ValueError(f"not the address of a service: it reads {form}")
    if url.username is not None or url.password is not None:
        raise ValueError("a user or password in the address would be written into every manifest")
    if url.query or url.fragment:
        raise ValueError("the address of a service ends with its path: no '?' and no '#'")
    return address.rstrip("/")


def stays_on_this_machine(address: str) -> bool:
    """Whether what is sent to an address never leaves this machine (localhost, 127.0.0.0/8, ::1)."""
    host = urlsplit(address).hostname or ""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
