"""Put numbers, figures and tables into a chapter's text."""

from collections.abc import Mapping
from pathlib import Path

from rotorid import log, prose


def main(text: str, files: Mapping[str, str], out: str) -> None:
    """Render `text` with the named `files` to the markdown file `out`."""
    Path(out).write_text(prose.render(text, files), encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            text=snakemake.input.prose,
            files={name: path for name, path in snakemake.input.items() if name != "prose"},
            out=snakemake.output.markdown,
        )
