"""Verdicts on sets without one rule of the decision.

- Takes, of the sets in which the rule fired, a number that the configuration states; judges them once more without it.
- With no rule named it judges every set with all rules, and notes which fired.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.without_rules import fires_in, judged, read_stored, stored


def main(sets: str, rule: str, base: str | None, most: int, out: str) -> None:
    """Judge the sets, without `rule` those in which it fired according to `base`."""
    folder = Path(sets)
    if base is None:
        found = [judged(path) for path in sorted(folder.iterdir()) if path.is_dir()]
    else:
        found = [judged(folder / j.name, [rule]) for j in fires_in(read_stored(Path(base)), rule, most)]
    Path(out).write_text(stored(found), encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            sets=snakemake.input.sets,
            rule=snakemake.wildcards.get("rule", ""),
            base=snakemake.input.get("base"),
            most=snakemake.params.get("most", 0),
            out=snakemake.output.verdicts,
        )
