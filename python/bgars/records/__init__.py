"""The records that flow from stage to stage: one frozen dataclass a file."""
