"""Pages of a result."""
