"""`python -m acquire` in a clone is `rotorid-acquire`."""

from rotorid.acquire.cli import app

app()
