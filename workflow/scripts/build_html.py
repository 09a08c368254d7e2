"""Build the self-contained HTML of the report."""

from pathlib import Path

from rotorid_lab import log, typeset

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
        typeset.html(document, snakemake.output.html)
