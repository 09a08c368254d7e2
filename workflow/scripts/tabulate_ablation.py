"""What each rule of the decision is worth, one line a rule.

- Compares the verdicts without a rule with those of all rules on the same sets.
"""

from pathlib import Path

from rotorid import log
from rotorid.proof import ablation


def main(base: str, without: list[str], out: str) -> None:
    """Write the table from the verdicts with all rules and those without each."""
    every = {j.name: j for j in ablation.read_stored(Path(base))}
    rows = []
    for path in map(Path, without):
        left_out = ablation.read_stored(path)
        fired = sum(bool(j.fired.get(path.stem)) for j in every.values())
        rows.append(ablation.row(path.stem, [every[j.name] for j in left_out], left_out, fired))
    ablation.table(rows).to_csv(out, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            base=snakemake.input.base,
            without=snakemake.input.without,
            out=snakemake.output.table,
        )
