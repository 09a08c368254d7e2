"""What every stage uses: the checked configuration and the code of the library as a parameter."""

from pathlib import Path

from snakemake.exceptions import WorkflowError

from rotorid import codehash
from rotorid.config import ConfigError, check

ROOT = Path(workflow.basedir)

try:
    CONFIG = check(config)
except ConfigError as error:
    raise WorkflowError(str(error)) from None


def code_of(script):
    """Hash of the code that a script (its name without .py) or a notebook (its path) runs."""
    path = script if script.endswith(".ipynb") else f"workflow/scripts/{script}.py"
    return codehash.code_of(path, ROOT)


def code_of_chapter(name):
    """Hash of the code of a chapter's notebook and of what runs it."""
    return code_of("run_notebook") + code_of(f"notebooks/{name}.ipynb")


wildcard_constraints:
    chapter="[a-z][a-z0-9_]*",
