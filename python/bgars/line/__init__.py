"""On the line: many parts, one after the other or at once, each told from the next."""
