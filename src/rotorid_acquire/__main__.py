"""`python -m rotorid_acquire` is `rotorid-acquire`."""

from rotorid_acquire.cli import app

app()
