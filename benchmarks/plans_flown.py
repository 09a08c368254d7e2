"""Planned flights flown in RotorPy and in MuJoCo by those simulators' controllers: how far from the plan, what settles.

Run: python benchmarks/plans_flown.py [--out benchmarks/plans_flown.md] [--pictures FOLDER]

Each vehicle holds one effect and is first flown so calmly that the verdict leaves a class open. `rotorid plan` plans
for it; its trajectory.csv is flown, recorded, and judged with the first set as `rotorid together` does.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "proof"))

from rotorid.plan.candidates import Limits, read_limits
from rotorid.plan.plan import Plan, plan
from rotorid.plan.questions import known_from
from rotorid.plan.write import write
from rotorid.report.deliver import judge
from rotorid_proof import next_flight as proof
from rotorid_proof.concealed.elsewhere import InMujoco, InRotorpy, write_set
from rotorid_proof.row_by_row import as_read

ROOT = Path(__file__).resolve().parents[1]
LISTED = (
    InRotorpy("c_D", "one_way"),
    InRotorpy("c_D", "one_way", size=0.7),
    InRotorpy("c_D", "one_way", size=0.5),
    InMujoco("off_centre", seed=3, size=0.4),
    InMujoco("off_centre", seed=2, size=0.1),
)


def main(out: Path | None, pictures: Path | None) -> None:
    warnings.simplefilter("ignore")
    room = read_limits(ROOT / "workflow/proof_room.yaml")
    rows = [row for case in LISTED if (row := flown(case, room, pictures))]
    text = "\n".join(
        [
            "# Planned flights in other simulators",
            "",
            f"`python benchmarks/plans_flown.py`: RotorPy {version('rotorpy')}, MuJoCo {version('mujoco')}, each with "
            "the controller of its cases in the proof; limits of `workflow/proof_room.yaml`.",
            "",
            "| flown in, effect | left open | flight, s | farthest from the plan, m | from the flight predicted, m "
            "| fastest: predicted, flown, m/s | both sets together |",
            "| --- | --- | ---: | ---: | ---: | ---: | --- |",
            *rows,
            "",
        ]
    )
    print(text)
    if out:
        out.write_text(text, encoding="utf-8")


def flown(case: InRotorpy | InMujoco, room: Limits, pictures: Path | None) -> str:
    """A row of the table; empty where nothing was left open or planned."""
    first = as_read(case.first, write_set, "first")
    fast, slow = case.bandwidths_rad_s
    limits = room.model_copy(update={"attitude_bandwidth_rad_s": fast, "position_bandwidth_rad_s": slow})
    found = known_from(first, judge(first).model_dump(mode="json"))
    classes = proof.classes_in(found)
    made = plan(found, limits) if classes else None
    if made is None or not made.pieces:
        print(f"{case.name}: {'no plan' if classes else 'nothing is open'}", file=sys.stderr)
        return ""
    with tempfile.TemporaryDirectory() as folder:
        write(made, Path(folder) / "plan")
        trajectory = pd.read_csv(Path(folder) / "plan" / "trajectory.csv")
    recording, times, position, velocity = case.fly(trajectory)
    second = as_read(recording, write_set, "second")
    outcome, said, _ = proof.judged(first, second, classes[0], {case.truth})
    asked = np.stack([np.interp(times, trajectory["time_s"], trajectory[f"position_{a}_m"]) for a in "xyz"], axis=1)
    motion = made.flight.motion
    expected = np.stack([np.interp(times, motion.time_s, motion.position[:, i]) for i in range(3)], axis=1)
    speed = float(np.linalg.norm(velocity[:, :2], axis=1).max())
    if pictures:
        draw(made, trajectory, times, position, velocity, pictures / f"{case.name.replace('/', '-')}.png")
    return (
        f"| {case.name.split('/')[0]}, {case.truth} | {', '.join(classes[0])} | {made.duration_s:.0f} "
        f"| {farthest(position - asked):.2f} | {farthest(position - expected):.2f} "
        f"| {made.flight.speed_m_s:.2f}, {speed:.2f} | {outcome}: {said.split(': ', 1)[-1]} |"
    )


def farthest(distance: np.ndarray) -> float:
    """Largest length of vectors (n, 3)."""
    return float(np.linalg.norm(distance, axis=1).max())


def draw(made: Plan, trajectory: pd.DataFrame, times, position, velocity, path: Path) -> None:
    """Planned, predicted and flown: coordinates and speeds over time."""
    from rotorid.report.plots.style import BLUE, GREY, ORANGE, figure, use

    use()
    fig, axes = figure(7.5, 4, 1)
    motion = made.flight.motion
    for i, name in enumerate(("north", "east", "down")):
        axes[i].plot(trajectory["time_s"], trajectory[f"position_{'xyz'[i]}_m"], color=GREY, lw=2.5, label="planned")
        axes[i].plot(motion.time_s, motion.position[:, i], color=ORANGE, lw=1.0, label="predicted")
        axes[i].plot(times, position[:, i], color=BLUE, lw=0.8, label="flown")
        axes[i].set(ylabel=f"{name} [m]", xlim=(0, times[-1]))
    wanted = np.linalg.norm(trajectory[["velocity_x_m_s", "velocity_y_m_s", "velocity_z_m_s"]], axis=1)
    axes[3].plot(trajectory["time_s"], wanted, color=GREY, lw=2.5)
    axes[3].plot(motion.time_s, np.linalg.norm(made.flight.world_velocity, axis=1), color=ORANGE, lw=1.0)
    axes[3].plot(times, np.linalg.norm(velocity, axis=1), color=BLUE, lw=0.8)
    axes[3].set(xlabel="time [s]", ylabel="speed [m/s]", xlim=(0, times[-1]))
    axes[0].legend(loc="upper right", ncols=3)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, format="png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--pictures", type=Path, help="folder for a picture of each flight")
    arguments = parser.parse_args()
    main(arguments.out, arguments.pictures)
