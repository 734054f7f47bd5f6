"""``python -m bgars`` is the command ``bgars``."""

from bgars.cli import main

main()
