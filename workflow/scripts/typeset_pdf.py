"""Typeset the chapters: pandoc makes typst source of them, typst the PDF."""

from pathlib import Path

from rotorid_lab import log, typeset


def main(document: typeset.Document, source: str, pdf: str) -> None:
    """Write the typst document `source` and the PDF made of it."""
    typeset.without_gaps(document, source)
    typeset.pdf(source, pdf)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        document = typeset.Document(
            chapters=snakemake.input.chapters,
            title=snakemake.params.title,
            subtitle=snakemake.params.subtitle,
            parts=Path(snakemake.input.template).parent,
            left_out=snakemake.params.left_out,
            notice=snakemake.params.notice,
            origin=snakemake.params.origin,
            project=snakemake.params.project,
        )
        main(document, snakemake.output.source, snakemake.output.pdf)
