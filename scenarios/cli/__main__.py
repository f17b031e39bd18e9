"""`python -m scenarios.cli` is `dotmask`."""

from scenarios.cli import main

main()
