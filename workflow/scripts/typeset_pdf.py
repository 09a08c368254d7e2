"""Typeset the chapters: pandoc makes typst source of them, typst the PDF."""

from collections.abc import Sequence
from pathlib import Path

from rotorid import log, typeset


def main(
    chapters: Sequence[str],
    title: str,
    subtitle: str,
    parts: str,
    source: str,
    pdf: str,
    left_out: Sequence[str],
    notice: str,
) -> None:
    """Write the typst document `source` and the PDF made of it."""
    typeset.without_gaps(chapters, title, subtitle, parts, source, left_out, notice)
    typeset.pdf(source, pdf)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            chapters=snakemake.input.chapters,
            title=snakemake.params.title,
            subtitle=snakemake.params.subtitle,
            parts=str(Path(snakemake.input.template).parent),
            source=snakemake.output.source,
            pdf=snakemake.output.pdf,
            left_out=snakemake.params.left_out,
            notice=snakemake.params.notice,
        )
