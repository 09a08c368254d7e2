"""What every recording set contains and lacks, as one page of text.

- Sets that do not fit the contract are named with the reason; the others are still checked.
"""

from collections.abc import Sequence
from pathlib import Path

from rotorid.errors import InputError
from rotorid.recordings.check import as_text, check_folder
from rotorid_lab import log


def main(folders: Sequence[str], out: str) -> None:
    """Check each of `folders` that holds a vehicle.yaml and write the text to `out`."""
    pages = []
    for folder in folders:
        if not (Path(folder) / "vehicle.yaml").is_file():
            pages.append(f"{Path(folder).name}: not there; see {folder}/import_report.json\n")
            continue
        try:
            pages.append(as_text(check_folder(Path(folder))))
        except InputError as error:
            pages.append(f"{Path(folder).name}: {error}\n")
    text = "\n\n".join(pages)
    Path(out).write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(folders=snakemake.input.sets, out=snakemake.output.text)
