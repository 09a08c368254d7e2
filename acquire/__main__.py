"""`python -m acquire` is `rotorid-acquire`."""

from acquire.cli import app

app()
