"""Concealed sets judged without one rule.

- Takes, of the sets in which the rule fired, a number that the configuration states; judges them once more without it.
- With no rule named it judges every set with all rules, and notes which fired.
"""

from pathlib import Path

from rotorid import log
from rotorid.proof import ablation


def main(sets: str, answers: str, rule: str, base: str | None, most: int, out: str) -> None:
    """Judge the sets, without `rule` those in which it fired according to `base`."""
    folder, sealed = Path(sets), Path(answers)
    if base is None:
        found = [ablation.judged(path, sealed) for path in sorted(folder.iterdir()) if path.is_dir()]
    else:
        known = ablation.fires_in(ablation.read_stored(Path(base)), rule, most)
        found = [ablation.judged(folder / j.name, sealed, [rule]) for j in known]
    Path(out).write_text(ablation.stored(found), encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            sets=snakemake.input.sets,
            answers=snakemake.input.answers,
            rule=snakemake.wildcards.get("rule", ""),
            base=snakemake.input.get("base"),
            most=snakemake.params.get("most", 0),
            out=snakemake.output[0],
        )
