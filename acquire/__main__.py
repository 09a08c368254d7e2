"""`python -m acquire` in a clone is `rotorid-acquire`."""

from rotorid_acquire.cli import app

app()
