"""Address of a broker, and user and password: from the environment or a file, never from an address or an option."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import SplitResult, urlsplit

from bgars.errors import InputError

__all__ = ["credentials", "holds_user", "split_address"]


def credentials(user: str, password: str) -> tuple[str, str]:
    """Return user and password ("" = none) from these environment variables.

    ``{password}_FILE`` names a file that holds the password instead, as container platforms mount secrets.

    Raises
    ------
    InputError
        The file cannot be read.
    """
    name = os.environ.get(user, "")
    file = os.environ.get(f"{password}_FILE", "")
    if not file:
        return name, os.environ.get(password, "")
    try:
        return name, Path(file).read_text(encoding="utf-8").strip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        msg = f"{password}_FILE: {file}: cannot be read ({getattr(error, 'strerror', None) or 'not UTF-8'})"
        raise InputError(msg) from None


def split_address(url: str, name: str) -> SplitResult:
    """Return the parts of an address.

    Raises
    ------
    InputError
        It cannot be one; the message does not hold it, as there may be a password in it.
    """
    try:
        parts = urlsplit(url)
        _ = parts.port  # looked at when it is asked for
    except ValueError:
        # What urllib says holds pieces of the address, such as a password before an @.
        msg = f"{name}: is no address: must be SCHEME://HOST[:PORT]/..., with a port of 1 to 65535"
        raise InputError(msg) from None
    return parts


def holds_user(parts: SplitResult) -> bool:
    """Whether there is a user or a password in an address: also one with / in it, which then looks like port and path.

    Examples
    --------
    >>> holds_user(split_address("amqp://ada:12/34@host/results", "amqp"))
    True
    """
    return parts.username is not None or (parts.port is not None and "@" in parts.path)
