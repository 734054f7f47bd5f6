"""Text that UTF-8 can hold: names of files may hold bytes that are no text."""

__all__ = ["encodable", "is_encodable"]


def encodable(text: str) -> str:
    r"""Return a text with such bytes written out.

    Examples
    --------
    >>> encodable("SN\udcff")
    'SN\\udcff'
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def is_encodable(text: str) -> bool:
    """Whether a text is free of them."""
    return encodable(text) == text
