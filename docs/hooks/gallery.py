"""The gallery: a page for each kind of log, made by the commands that it shows.

    ROTORID_PUBLIC_DATA=DIR python docs/hooks/gallery.py docs/gallery

Each page is a public or shipped log, three commands with what they print, a picture, and what to do next. A log that is
not in the folder of public recordings leaves its page as it is, and is named.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import pandas as pd

from rotorid.errors import InputError

_WIDTH = 160
_MOST_LINES = 3
"""Of what a command prints so many lines are shown from either end."""


class _GalleryPage(NamedTuple):
    """One page."""

    name: str
    title: str
    log: tuple[str, ...]
    """Paths in the folder of public recordings; none for what is shipped."""
    source: str
    commands: tuple[str, ...]
    """As typed in a folder that holds the logs; `set` is the recording set, `answer` the verdict's folder."""
    after: str
    """What to do next, apart from what the verdict proposes."""


KINDS = (
    _GalleryPage(
        "example", "A table of one's own (shipped)", (),
        "Two simulated flights with a rotor drag, shipped with rotorid.",
        ("rotorid init set --example", "rotorid check set", "rotorid verdict set -o answer --series -q"),
        "Fly the improved vehicle: `rotorid simulate answer/improved_vehicle.yaml`.",
    ),
    _GalleryPage(
        "px4", "PX4 ULog", ("px4-ulog/sample_px4_events.ulg",),
        "PX4/pyulog, `test/sample_px4_events.ulg` (BSD-3-Clause): 6.5 s in the air, flown in jMAVSim.",
        (
            "rotorid import sample_px4_events.ulg --mass-kg 0.8 -o set --csv",
            "rotorid check set",
            "rotorid parameters set --to px4",
        ),
        "A single flight of less than 9 s is not judged: import a second one into the same set, then "
        "`rotorid verdict set`.",
    ),
    _GalleryPage(
        "ardupilot", "ArduPilot DataFlash", ("logs/ardupilot/copter-3.4_22.BIN",),
        "erlerobot/logs, `erlebrain/APM/22.BIN` (Copter 3.4; no licence stated, not shipped). Its mass is not known: "
        "1.5 kg is a guess.",
        (
            "rotorid import copter-3.4_22.BIN --mass-kg 1.5 --like x500 -o set",
            "rotorid verdict set -o answer --series -q",
            "rotorid parameters set --to ardupilot",
        ),
        "Log faster (`LOG_BITMASK` with fast attitude and raw IMU) and state mass and geometry: what is only "
        "proposed is listed above.",
    ),
    _GalleryPage(
        "betaflight", "Betaflight blackbox", ("logs/betaflight/shortLog.BFL",),
        "Ricardo-Marques/betaflight-tuning-helper, `test-logs/shortLog.BFL` (4.5.1 with eRPM; no licence stated, not "
        "shipped). Its mass is not known: 0.65 kg is a guess.",
        (
            "rotorid import shortLog.BFL --mass-kg 0.65 --like five-inch -o set",
            "rotorid verdict set -o answer --series -q",
            "rotorid parameters set --to betaflight",
        ),
        "Record a minute in place of seconds, and state mass and geometry.",
    ),
    _GalleryPage(
        "crazyflie", "Crazyflie uSD log",
        ("imrc-crazyflie-rpm/brushless_flights/eckart00", "imrc-crazyflie-rpm/brushless_flights/eckart01"),
        "IMRCLab/crazyflie-data-collection, two flights of a brushless Crazyflie of 37 g with measured rotor speeds "
        "(no licence stated, not shipped).",
        (
            "rotorid import eckart00 eckart01 --mass-kg 0.037 --like crazyflie-2.1-brushless -o set",
            "rotorid verdict set -o answer --series -q",
            "rotorid model set --to mjcf -o simulator -q",
        ),
        "The last command says what MuJoCo's form leaves out, and what that costs over half a second.",
    ),
    _GalleryPage(
        "csv", "Any CSV, by a mapping", ("logs/csv-ddd/quadrotor_model.csv",),
        "ethz-asl/data-driven-dynamics, `resources/quadrotor_model.csv` (BSD-3-Clause).",
        (
            "rotorid import quadrotor_model.csv --write-mapping mapping.yaml",
            "rotorid import quadrotor_model.csv --mapping mapping.yaml --like x500 --mass-kg 1.5 -o set",
            "rotorid check set",
        ),
        "Answer what is open (`?`) in `mapping.yaml`: nothing is imported that was only guessed at.",
    ),
    _GalleryPage(
        "ros", "ROS 2 bag", ("logs/ros2-plotjuggler",),
        "facontidavide/PlotJuggler, `datasamples/rosbag2_test` (MPL-2.0): a bag as a folder. "
        "It holds attitudes and no rotors, and that is said.",
        ("rotorid import ros2-plotjuggler --mass-kg 1.5 --like x500 -o set",),
        "A bag with `sensor_msgs/Imu`, an odometry or pose, and `Actuators` or `ESCStatus` is imported by the same "
        "command.",
    ),
)  # fmt: skip


def run(command: str, folder: Path) -> str:
    """What a command prints, paths of the folder left out; a refusal is part of a page, too."""
    words = shlex.split(command)
    environment = os.environ | {"COLUMNS": str(_WIDTH), "NO_COLOR": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "rotorid", *words[1:]], cwd=folder, env=environment, capture_output=True, text=True
    )
    if done.returncode not in (0, 1) or "fault of rotorid" in done.stderr:
        raise InputError(f"{command}: {done.stderr.strip()}")
    return (done.stdout + done.stderr).replace(f"{folder}/", "").strip()


def _page(kind: _GalleryPage, outputs: Sequence[str], picture: str, following: str) -> str:
    """The page as Markdown."""
    parts = [f"# {kind.title}", kind.source]
    for command, said in zip(kind.commands, outputs, strict=True):
        lines = [line[:_WIDTH] + (" …" if len(line) > _WIDTH else "") for line in said.splitlines()]
        more = len(lines) - 2 * _MOST_LINES
        between = [f"… ({more} more lines)", *lines[-_MOST_LINES:]] if more > 1 else lines[_MOST_LINES:]
        shown = lines[:_MOST_LINES] + between
        parts.append("\n".join(["```", command, "```"]))
        parts.append("\n".join(["```text", *shown, "```"]))
    if picture:
        parts.append(f"![{picture}]({kind.name}.png)\n\n*{picture}*")
    parts.append("\n".join(["## Next", "", *(f"- {text}" for text in (following, kind.after) if text)]))
    return "\n\n".join(parts) + "\n"


def _next_of(folder: Path) -> str:
    """What the verdict proposes to fly next; empty without a verdict or a proposal."""
    path = folder / "answer" / "verdict.json"
    if not path.is_file():
        return ""
    proposed = json.loads(path.read_text(encoding="utf-8")).get("next_experiment")
    return f"The verdict proposes: {proposed['manoeuvre']}." if proposed and proposed["manoeuvre"] else ""


def _gain(table: pd.DataFrame, channel: str) -> float:
    """How many times larger the residual of a channel is before than after; 0 for one without values."""
    before, after = (float(np.sqrt(np.nanmean(table[f"{channel}_{w}"] ** 2))) for w in ("before", "after"))
    return before / after if after > 0 else 0.0


def with_gaps(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n,) with NaN after each gap of more than ten usual steps, so that no line is drawn across it."""
    step = np.diff(time_s, prepend=time_s[0])
    return np.where(step > 10 * np.median(np.diff(time_s)), np.nan, values)


def draw(folder: Path, target: Path) -> str:
    """A picture of what came out, as PNG, and its caption; empty where nothing was imported."""
    from rotorid.report.plots import style

    series = folder / "answer" / "series.parquet"
    if series.is_file():
        table, verdict = pd.read_parquet(series), json.loads((folder / "answer" / "verdict.json").read_text())
        channel = max(
            (c.removesuffix("_before") for c in table if c.endswith("_before")), key=lambda c: _gain(table, c)
        )
        own = table[table["run"] == table["run"].iloc[0]].dropna(subset=[f"{channel}_before"])
        lines = {word: own[f"{channel}_{word}"].to_numpy() for word in ("before", "after")}
        unit = verdict["channels"].get(channel, {}).get("unit", "")
        words = channel.replace("_", " ")
        of = f"Residual of {words} in {own['run'].iloc[0]}"
        caption = f"{of}, with the believed vehicle (before) and the improved one (after)."
        label = f"residual, {words}, {unit}"
    else:
        runs = sorted((folder / "set").glob("*.csv"))
        if not runs:
            return ""
        own = pd.read_csv(runs[0])
        up = own[["time_s", "specific_force_z_m_s2"]].dropna()
        own, lines = up, {"measured": -up["specific_force_z_m_s2"].to_numpy()}
        caption, label = f"Specific force upward in {runs[0].stem}, the part in the air.", "specific force upward, m/s²"
    fig, ax = style.figure(2.2)
    for word, values in lines.items():
        ax.plot(
            own["time_s"],
            with_gaps(own["time_s"].to_numpy(), np.asarray(values)),
            color=style.COLOUR[word],
            lw=0.7,
            label=word,
        )
    ax.set(xlabel="time, s", ylabel=label)
    ax.legend()
    style.save(fig, target)
    return caption


def make(kind: _GalleryPage, data: Path | None, target: Path) -> str:
    """Write a page and its picture into `target`; a sentence where its log is not there, else nothing."""
    with TemporaryDirectory() as name:
        folder = Path(name).resolve()
        for log in kind.log:
            source = None if data is None else data / log
            if source is None or not source.exists():
                return f"{kind.name}: {log} is not there: its page stays as it is"
            if source.is_dir():
                shutil.copytree(source, folder / source.name)
            else:
                shutil.copyfile(source, folder / source.name)
        outputs = [run(command, folder) for command in kind.commands]
        caption = draw(folder, target / f"{kind.name}.png")
        text = _page(kind, outputs, caption, _next_of(folder))
    (target / f"{kind.name}.md").write_text(text, encoding="utf-8")
    return ""


def index() -> str:
    """The page that lists the others."""
    rows = [f"- [{kind.title}]({kind.name}.md)" for kind in KINDS]
    head = (
        "# Gallery\n\nFor each kind of log: the log, the commands with what they print, a picture, and what to do next."
    )
    return f"{head} Made by\n`python docs/hooks/gallery.py docs/gallery`.\n\n" + "\n".join(rows) + "\n"


def main(target: Path, names: Sequence[str]) -> None:
    """Make the pages of these kinds (all without any) and the list."""
    where = os.environ.get("ROTORID_PUBLIC_DATA")
    target.mkdir(parents=True, exist_ok=True)
    for kind in KINDS:
        if not names or kind.name in names:
            print(make(kind, Path(where) if where else None, target) or f"{kind.name}: made", flush=True)
    (target / "README.md").write_text(index(), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
