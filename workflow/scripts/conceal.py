"""Record concealed sets.

- Flies each case with code that shares nothing with the library and writes its set under a name that says nothing.
- Writes the answers to another folder, the sealed one.
"""

import sys
from pathlib import Path

from rotorid import log


def main(cases: list[str], sets: str, answers: str, root: str) -> None:
    """Record the cases of these names into `sets`, their answers into `answers`; `root` holds `tests`."""
    sys.path.insert(0, root)
    from tests.concealed import build
    from tests.concealed import cases as known

    Path(sets).mkdir(parents=True, exist_ok=True)
    for case in known.with_names(cases):
        build.build(case, Path(sets), Path(answers))


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            cases=snakemake.params.cases,
            sets=snakemake.output.sets,
            answers=snakemake.output.answers,
            root=str(Path.cwd()),
        )
