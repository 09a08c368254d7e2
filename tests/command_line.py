"""The command line in the test's own process."""

from click.testing import Result
from typer import Typer
from typer.testing import CliRunner

from rotorid.cli import app as rotorid


def invoke(*words: object, app: Typer = rotorid) -> Result:
    """How a command ends."""
    return CliRunner().invoke(app, [str(word) for word in words])


def answer(*words: object, app: Typer = rotorid) -> str:
    """All that a command says that ends well."""
    done = invoke(*words, app=app)
    assert done.exit_code == 0, done.output
    return done.output


def refusal(*words: object, app: Typer = rotorid) -> str:
    """The sentence that is all that a command says which refuses."""
    done = invoke(*words, app=app)
    assert done.exit_code == 1 and len(done.output.strip().splitlines()) == 1, done.output
    assert "Traceback" not in done.output, done.output
    return done.output
