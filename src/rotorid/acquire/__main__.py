"""`python -m rotorid.acquire` is `rotorid-acquire`."""

from rotorid.acquire.cli import app

app()
