"""Whether a capture shows what its description says, before any number is made of it."""
