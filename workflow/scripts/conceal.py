"""Record concealed sets.

- Flies each case with code that shares nothing with the library and writes its set under a name that says nothing.
- Writes the answers to another folder, the sealed one.
"""

from pathlib import Path

from rotorid_lab import log


def main(cases: list[str], sets: str, answers: str) -> None:
    """Record the cases of these names into `sets`, their answers into `answers`."""
    from rotorid_proof.concealed import build
    from rotorid_proof.concealed import cases as known

    Path(sets).mkdir(parents=True, exist_ok=True)
    for case in known.with_names(cases):
        build.build(case, Path(sets), Path(answers))


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            cases=snakemake.params.cases,
            sets=snakemake.output.sets,
            answers=snakemake.output.answers,
        )
