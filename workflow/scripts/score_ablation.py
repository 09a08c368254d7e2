"""What each rule of the decision is worth, one line a rule.

- Opens the sealed answers and compares the verdicts without a rule with those of all rules on the same sets.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof import ablation
from rotorid_proof.without_rules import read_stored


def main(base: str, without: list[str], answers: str, out: str) -> None:
    """Write the table from the verdicts with all rules and those without each."""
    every = read_stored(Path(base))
    rows = [ablation.row(path.stem, every, read_stored(path), Path(answers)) for path in map(Path, without)]
    ablation.table(rows).to_csv(out, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            base=snakemake.input.base,
            without=snakemake.input.without,
            answers=snakemake.input.answers,
            out=snakemake.output.table,
        )
