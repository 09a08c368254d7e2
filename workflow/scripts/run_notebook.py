"""Run one chapter's notebook by papermill.

- The names of the rule's inputs, outputs and params become the notebook's parameters, paths made absolute.
- A name that the notebook's `parameters` cell does not set is an error (papermill itself only warns).
- The executed notebook is kept as a log, also when it fails; its figures and tables are the outputs.
"""

import logging
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import nbformat
import papermill
from traitlets.config import Config

from rotorid_lab import log

LOGGER = logging.getLogger("rotorid.notebook")
PATIENCE_S = 600
"""A kernel may take long to start where the machine is busy."""


def main(notebook: str, parameters: Mapping[str, Any], outputs: Mapping[str, str], executed: str) -> None:
    """Execute `notebook` with `parameters` and leave the run in `executed`.

    Raises
    ------
    ValueError
        A parameter is not in the notebook's parameters cell.
    FileNotFoundError
        The notebook ended without writing one of `outputs`.
    """
    unknown = sorted(set(parameters) - set(papermill.inspect_notebook(notebook)))
    if unknown:
        raise ValueError(f"{notebook}: the cell tagged parameters does not set {', '.join(unknown)}.")
    Path(executed).parent.mkdir(parents=True, exist_ok=True)
    LOGGER.info("running %s", notebook)
    # Sockets in a folder of their own: by default two chapters that run at once would share them.
    with tempfile.TemporaryDirectory() as sockets:
        papermill.execute_notebook(
            notebook,
            executed,
            parameters=dict(parameters),
            kernel_name="python3",
            cwd=Path(notebook).parent,
            progress_bar=False,
            log_output=True,
            start_timeout=PATIENCE_S,
            config=Config({"KernelManager": {"transport": "ipc", "ip": f"{sockets}/kernel"}}),
        )
    without_the_run(Path(executed))
    missing = [path for path in outputs.values() if not Path(path).is_file()]
    if missing:
        raise FileNotFoundError(f"{notebook}: ended without writing {', '.join(missing)}.")


def without_the_run(executed: Path) -> None:
    """Leave out of an executed notebook when, how long and in which folder it ran: two builds give the same file."""
    notebook = nbformat.read(executed, as_version=4)
    notebook.metadata.pop("papermill", None)
    for number, cell in enumerate(notebook.cells, 1):
        cell.id = f"cell-{number}"
        cell.source = cell.source.replace(f"{Path.cwd()}/", "")
        for key in ("papermill", "execution"):
            cell.metadata.pop(key, None)
    nbformat.write(notebook, executed)


def absolute(files: Mapping[str, Any]) -> dict[str, Any]:
    """Named files as absolute paths; a name that stands for several files gives a list."""
    return {
        name: str(Path(files[name]).resolve())
        if isinstance(files[name], str)
        else [str(Path(path).resolve()) for path in files[name]]
        for name in files
    }


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        inputs = absolute({name: path for name, path in snakemake.input.items() if name != "notebook"})
        outputs = absolute(dict(snakemake.output.items()))
        settings = {name: value for name, value in snakemake.params.items() if name != "code"}
        main(
            notebook=snakemake.input.notebook,
            parameters={**inputs, **outputs, **settings},
            outputs=outputs,
            executed=snakemake.log.notebook,
        )
