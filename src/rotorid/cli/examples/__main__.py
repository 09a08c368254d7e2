"""Make the files of the example anew, into the package's own folder."""

from pathlib import Path

import numpy as np

from rotorid.cli.examples import CONCEALED, EVERY, FLIGHTS, SECONDS, SEED
from rotorid.recordings import templates, write_vehicle
from rotorid.recordings.tables import write_table
from rotorid.vehicle.control import swings

_HEADING = """\
# Two flights of {seconds:g} s of the thesis's quadrotor, simulated by rotorid with seed {seed}. What the vehicle
# really does is not all in this file: `rotorid verdict` is to find it.
"""


def main(folder: Path) -> None:
    """Fly and write `vehicle.yaml` and a table a flight, packed; the same bytes in every run."""
    vehicle = templates.read("thesis").model_copy(update={"effects": CONCEALED})
    flown = swings(vehicle, "example", SECONDS, FLIGHTS, SEED, every=EVERY)
    write_vehicle(flown.vehicle, folder / "vehicle.yaml")
    path = folder / "vehicle.yaml"
    path.write_text(_HEADING.format(seconds=SECONDS, seed=SEED) + path.read_text(encoding="utf-8"), encoding="utf-8")
    for run in flown.runs:
        table = run.table.astype(np.float32).assign(time_s=run.time_s.round(6))
        write_table(table, folder / f"{run.name}.csv.gz")


if __name__ == "__main__":
    main(Path(__file__).parent)
