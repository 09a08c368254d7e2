"""`python -m rotorid`: the command line, where the command `rotorid` is not on the path."""

from rotorid.cli import app

if __name__ == "__main__":
    app(prog_name="rotorid")
