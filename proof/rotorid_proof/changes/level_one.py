"""Level 1 of a comparison on real flights: false alarms where nothing changed, labelled pairs, plantings.

    ROTORID_PUBLIC_DATA=DIR snakemake --cores 1 public
    python -m rotorid_proof.changes.level_one results/recordings

The usual scatter is learnt without the laboratory of the flights that are judged.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from rotorid.mismatch.changes.level_one import Difference, differences, flights_of, found_in, usual_scatter
from rotorid.mismatch.changes.quantities import KINDS, Flown, Grid, flown, grid_of
from rotorid.recordings import RecordingSet, Run, read_set
from rotorid_proof.intervals import wilson
from rotorid_proof.plantings import geometry, sensors, values
from rotorid_proof.plantings.columns import has
from rotorid_proof.plantings.kinds import Truth
from rotorid_proof.plantings.sow import generator

LABORATORIES = {
    "neurobem": "NeuroBEM",
    "imrc-brushless": "imrc",
    "crazypad-normal": "CrazyPAD",
    "crazypad-weight": "CrazyPAD",
    "crazypad-cut": "CrazyPAD",
    "appius-ground-effect": "appius",
    "crazyflie-arpl-log10": "ARPL",
    "crazyflie-arpl-log15": "ARPL",
}
"""Real flights, each set of a vehicle in which nothing changed, and the laboratory in the table of usual scatter."""
LABELLED = (("crazypad-normal", "crazypad-weight", "3"), ("crazypad-normal", "crazypad-cut", "3"))
"""Two sets, and the rotor at which their authors changed something."""
PIECE_S = 8.0
"""Least length of the pieces of runs that are compared as if they were flights."""
SEEDS = 4
TWO_DEGREES = float(np.deg2rad(2.0))
Flights = dict[str, list[Flown]]


@dataclass(frozen=True)
class Plan:
    """Something put into a flight."""

    name: str
    fits: Callable[[RecordingSet], bool]
    plant: Callable[[RecordingSet, str], tuple[RecordingSet, Truth]]
    right: Callable[[Truth], frozenset[str]]
    """Quantities that are right, one of which must be stated."""
    fair: frozenset[str] = frozenset()
    """Further ones that it moves, too; any other that is stated is wrong."""


def flights(recordings: RecordingSet, grid: Grid) -> Flights:
    """What each flight of a set shows."""
    out: Flights = {}
    for run, name in zip(recordings.runs, flights_of(recordings), strict=True):
        if (own := flown(run, recordings.vehicle, grid)) is not None:
            out.setdefault(name, []).append(own)
    return out


def splits(names: Sequence[str]) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
    """Every way to split flights in two: exchanged, both parts differ by as much."""
    for size in range(1, len(names)):
        for own in combinations(names[1:], size - 1):
            yield (names[0], *own), tuple(n for n in names[1:] if n not in own)


def pieces(recordings: RecordingSet, grid: Grid) -> Flights:
    """What pieces of PIECE_S or more of all runs show, each as a flight of its own."""
    out: Flights = {}
    for run in recordings.runs:
        count = max(1, int((run.time_s[-1] - run.time_s[0]) / PIECE_S))
        for k, part in enumerate(np.array_split(np.arange(len(run.time_s)), count)):
            piece = Run(f"{run.name}/{k}", run.table.iloc[part].reset_index(drop=True))
            if (own := flown(piece, recordings.vehicle, grid)) is not None:
                out[piece.name] = [own]
    return out


def by_liveliness(own: Flights) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
    """The quietest flights against the others, wherever the line is drawn: what is flown differs most there."""
    spread = {
        n: sum(float(np.trace(run.gram.sum(axis=0)[:6, :6])) / run.rows.sum() for run in r) for n, r in own.items()
    }
    names = sorted(own, key=spread.__getitem__)
    for k in range(1, len(names)):
        yield tuple(names[:k]), tuple(names[k:])


def _turned(recordings: RecordingSet, key: str) -> tuple[RecordingSet, Truth]:
    """Gyroscope and accelerometer turned by one angle about one axis."""
    out, truth = sensors.accelerometer_turned(recordings, TWO_DEGREES, generator(key))
    return (sensors.gyroscope_turned(out, TWO_DEGREES, generator(key))[0] if has(out, "gyroscope") else out), truth


def _offset(recordings: RecordingSet, key: str) -> tuple[RecordingSet, Truth]:
    arm = float(np.abs(recordings.vehicle.rotor_positions_m()[:, :2]).mean())
    return geometry.centre_of_mass(recordings, 0.003 / arm, generator(key))


def _sizes(truth: Truth) -> dict[str, float]:
    return {s.symbol: s.value for s in truth.sizes[-1]}


def _at_offset(truth: Truth) -> frozenset[str]:
    """The trim about the axis that the offset is farther from."""
    r = _sizes(truth)
    return frozenset({"trim/roll" if abs(r["r_y"]) > abs(r["r_x"]) else "trim/pitch"})


def _at_turn(truth: Truth) -> frozenset[str]:
    """The axis that a turn moves most of gravity to."""
    theta = _sizes(truth)
    axis = "y" if abs(theta["theta_x"]) > abs(theta["theta_y"]) else "x"
    return frozenset({f"sideways/{axis}", f"accelerometer/{axis}"})


LIFT = frozenset({"lift/all", "lift_of_throttle/all", "lift_without_voltage/all"})
OF_ROTORS = LIFT | {"trim/roll", "trim/pitch", "yaw_trim/yaw"} | {f"share/{i}" for i in range(1, 9)}
OF_SENSORS = frozenset(
    f"{kind}/{axis}" for kind in ("sideways", "accelerometer", "gyroscope", "gyroscope_turn", "drag") for axis in "xyz"
)
PLANS = (
    Plan(
        "one rotor's thrust −5 %",
        lambda r: True,
        lambda r, key: geometry.weak_rotor(r, 0.05, generator(key)),
        lambda t: frozenset({f"share/{next(iter(_sizes(t))).removeprefix('d_')}"}),
        OF_ROTORS,
    ),
    Plan("mass ±5 %", lambda r: True, lambda r, key: values.mass(r, 0.05, generator(key)), lambda t: LIFT),
    Plan("centre of mass 3 mm", lambda r: True, _offset, _at_offset, frozenset({"trim/roll", "trim/pitch"})),
    Plan("IMU turned 2°", lambda r: has(r, "accelerometer"), _turned, _at_turn, OF_SENSORS),
    Plan(
        "scale of the gyroscope 3 %",
        lambda r: has(r, "gyroscope", "attitude"),
        lambda r, key: sensors.gyroscope_scaled(r, 0.03, generator(key)),
        lambda t: frozenset({"gyroscope_scale/all"}),
    ),
    Plan(
        "scale of the accelerometer 3 %",
        lambda r: has(r, "accelerometer"),
        lambda r, key: sensors.accelerometer_scaled(r, 0.03, generator(key)),
        lambda t: LIFT | {"accelerometer/z"},
        OF_SENSORS,
    ),
)


def is_right(found: Sequence[Difference], right: frozenset[str], fair: frozenset[str]) -> bool:
    """Whether something right is stated, nothing foreign is, and no other rotor before the right one."""
    stated = [d.quantity.key for d in found if d.stated]
    rotors = [key for key in stated if key.startswith("share/")]
    if any(key.startswith("share/") for key in right) and rotors[:1] and rotors[0] not in right:
        return False
    return bool(right & set(stated)) and not set(stated) - right - fair


def share(count: int, of: int) -> str:
    """`3 of 4 (75 %, 30 to 95)`."""
    low, high = wilson(count, of)
    return f"{count} of {of} ({100 * count / max(of, 1):.0f} %, {100 * low:.0f} to {100 * high:.0f})"


def described(d: Difference) -> str:
    low, high = d.interval()
    return f"{d.quantity.key} {d.value:+.4f} ({low:+.4f} to {high:+.4f}), false alarms {d.false_alarms:.1g}"


def learnt(shown: dict[str, Flights]) -> list[tuple[str, str, float, int, int]]:
    """The rows of `level_one.SCATTER`: sets of one laboratory together, members of a kind by their mean variance."""
    known: dict[tuple[str, str], dict[str, list[tuple[float, int, float]]]] = {}
    for name, own in shown.items():
        for q, found in (found_in(own) if len(own) > 1 else {}).items():
            known.setdefault((q.kind, LABORATORIES[name]), {}).setdefault(q.member, []).append(found)
    out = []
    for (kind, laboratory), members in known.items():
        freedom = sum(f for _, f, _ in next(iter(members.values())))
        variance, doubt = (
            np.mean([sum(own[k] * own[1] for own in sets) / freedom for sets in members.values()]) for k in (0, 2)
        )
        # Where the flights' own doubt explains all, as little as half of it is not excluded.
        sd = float(np.sqrt(variance)) if variance > 0 else 0.5 * float(np.sqrt(doubt))
        out.append((kind, laboratory, sd, freedom, len(members)))
    return sorted(out, key=lambda row: list(KINDS).index(row[0]))


def main(recordings: Path) -> None:
    """Print the tables."""
    start = time.process_time()
    sets = {n: read_set(recordings / n) for n in LABORATORIES if (recordings / n / "vehicle.yaml").is_file()}
    grids = {n: grid_of((own,)) for n, own in sets.items()}
    shown = {n: flights(own, grids[n]) for n, own in sets.items()}
    print(f"read in {time.process_time() - start:.1f} s of processor")

    print("\nnothing changed: comparisons that state something")
    total = [0, 0]
    for n, own in shown.items():
        usual = usual_scatter(LABORATORIES[n])
        cut = pieces(sets[n], grids[n])
        single = [((a,), (b,)) for a, b in combinations(own, 2)]
        ways = (
            ("splits", own, list(splits(list(own)))),
            ("one against one", own, single),
            ("pieces, the quiet against the lively", cut, list(by_liveliness(cut))),
            (
                "pieces, one against all others",
                cut,
                [((k,), tuple(o for o in cut if o != k)) for k in cut if len(cut) > 1],
            ),
        )
        for what, flights_of_way, pairs in ways:
            parts = [[{k: flights_of_way[k] for k in side} for side in pair] for pair in pairs]
            found = [differences(a, b, usual)[0] for a, b in parts]
            alarms = [d for d in found if d.stated]
            total = [total[0] + len(alarms), total[1] + len(found)]
            if found:
                first = min(found, key=lambda d: d.false_alarms)
                print(f"  {n}, {what}: {len(alarms)} of {len(found)}; the rarest: {described(first)}")
    print(f"  all: {share(*total)}")

    print("\nthe usual scatter that these flights show: kind, laboratory, one-sigma, degrees of freedom, members")
    for kind, laboratory, sd, freedom, members in learnt(shown):
        print(f"  {kind} {laboratory} {sd:.2g} {freedom} {members}")

    print("\nlabelled pairs")
    for first, second, rotor in (pair for pair in LABELLED if pair[0] in sets and pair[1] in sets):
        grid = grid_of((sets[first], sets[second]))
        found = differences(flights(sets[first], grid), flights(sets[second], grid), usual_scatter("CrazyPAD"))
        right = any(d.stated and d.quantity.key == f"share/{rotor}" for d in found)
        print(f"  {second}: rotor {rotor} {'stated' if right else 'MISSED'}")
        for d in found:
            if d.stated:
                print(f"    {described(d)}")

    print("\nplantings in all flights of a set, against the same flights untouched; but for those that it cannot show")
    for plan in PLANS:
        counts = {}
        for n, own in sets.items():
            if not plan.fits(own):
                continue
            for seed in range(SEEDS):
                new, truth = plan.plant(own, f"{n}/{plan.name}/{seed}")
                found = differences(shown[n], flights(new, grids[n]), usual_scatter(LABORATORIES[n]))
                if truth.unseen:
                    continue
                good, of = counts.get(n, (0, 0))
                counts[n] = good + int(is_right(found, plan.right(truth), plan.fair)), of + 1
        sums = [sum(c[k] for c in counts.values()) for k in (0, 1)]
        print(f"  {plan.name}: {share(*sums)}; " + ", ".join(f"{n} {a} of {b}" for n, (a, b) in counts.items()))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "results/recordings"))
