"""What every stage uses: the checked configuration and the code of the library as a parameter."""

import atexit
import os
import sys
import time
from functools import cache
from pathlib import Path

from snakemake.persistence import PersistenceBase

from rotorid_lab import log as logs
from rotorid.report.provenance import Code
from rotorid_lab.config import check, from_command_line
from rotorid.errors import InputError
from rotorid.io.text.files import read_yaml

# Jobs run side by side: threads of the linear algebra in each of them cost processor time and save none.
for library in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(library, "1")

# Snakemake imports pandas at every start to hash the tables among a rule's params. Here there are none.
PersistenceBase._serialize_param = PersistenceBase._serialize_param_builtin

STARTED = time.time()
ROOT = Path(workflow.basedir)
CODE = Code(ROOT, memory=".snakemake/code.json")
atexit.register(CODE.remember)


def refuse(sentence):
    """End the run with one sentence, the last thing on the screen.

    An exception that Snakemake catches is printed with the lines of the rule file below it. Nothing is locked yet
    while files are being asked for, so that nothing is left behind.
    """
    sys.exit(f"rotorid: {sentence}")


def say_refusals():
    """Print the sentence of each job of this run that refused its input."""
    for path in sorted(Path("results/logs").rglob("*.log")):
        if path.stat().st_mtime >= STARTED and (sentence := logs.refusal(path)):
            print(f"rotorid: {sentence}", file=sys.stderr)


try:
    for configured in workflow.configfiles:
        read_yaml(
            Path(configured)
        )  # Snakemake's own reader takes 0652 for 426 and the last of two equal keys
    CONFIG = check(from_command_line(config, workflow.config_settings.config))
except InputError as error:
    refuse(error)


def code_of(script):
    """Hash of the code that a script (its name without .py) runs, once a job asks for it: most rules have none today."""
    return lambda wildcards: CODE.of(f"workflow/scripts/{script}.py")


def code_of_chapter(name):
    """The same of a chapter's notebook and of what runs it."""
    return lambda wildcards: CODE.of("workflow/scripts/run_notebook.py") + CODE.of(f"notebooks/{name}.ipynb")


@cache
def producers_of(path):
    """Rules that make a file, each with the results that it needs for that; asked when all rules are known."""
    made_by = []
    for producer in (known for known in workflow.rules if known.is_producer(path)):
        made_by.append(
            (producer.name, results_read(producer.name, tuple(producer.get_wildcards(path).items())))
        )
    return made_by


@cache
def results_read(name, wildcards):
    """Results that a rule reads, by its wildcards: most rules make several files of the same."""
    inputs, *_ = workflow.get_rule(name).expand_input(dict(wildcards))
    return [str(file) for file in inputs if str(file).startswith("results/")]


def results_behind(*files):
    """The files and every result that they hang on, for a target to ask for by name.

    Snakemake does not miss a deleted result while what was made of it is still there. For functions of a rule's input
    alone: then only what is asked for is looked up, and with every rule known.
    """
    found, waiting = set(), list(files)
    while waiting:
        path = waiting.pop()
        found.add(path)
        for _, inputs in producers_of(path):
            waiting += set(inputs) - found
    return sorted(found)


wildcard_constraints:
    chapter="[a-z][a-z0-9_]*",
