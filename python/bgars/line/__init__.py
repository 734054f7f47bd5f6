"""On the line: many parts, one after the other or at once, each told from the next."""

from bgars.line.batch import Batch, inspect_many
from bgars.line.naming import Naming

__all__ = ["Batch", "Naming", "inspect_many"]
