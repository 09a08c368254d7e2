"""Put numbers, figures and tables into a chapter's text.

- A chapter whose kinds of recordings the index does not list becomes its heading and a sentence that says so.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from rotorid_lab import log
from rotorid_lab.typeset import not_recorded, render


def main(text: str, files: Mapping[str, str], lacking: Sequence[str], index: str, emulated: bool, out: str) -> None:
    """Render `text` with the named `files` to the markdown file `out`; `lacking` kinds are not in the `index`."""
    rendered = not_recorded(text, lacking, index) if lacking else render(text, files, emulated)
    Path(out).write_text(rendered, encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            text=snakemake.input.prose,
            files={name: path for name, path in snakemake.input.items() if name != "prose"},
            lacking=snakemake.params.lacking,
            index=snakemake.params.index,
            emulated=snakemake.params.emulated,
            out=snakemake.output.markdown,
        )
