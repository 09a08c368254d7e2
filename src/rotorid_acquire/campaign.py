"""The whole campaign of the thesis, recorded by the recorders from the emulators on a virtual clock.

`python -m rotorid_acquire.campaign` writes `raw/campaign/` (logs packed, metadata next to them), the index
`raw/sessions.tsv` and, outside `raw/`, the sealed truth. The same seed gives the same bytes. Calibration weights and
their eight combinations are those of thesis tables 2.6 and 2.7, in gf.
"""

from __future__ import annotations

import gzip
import math
import shutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import datetime, timedelta, timezone
from functools import partial
from pathlib import Path
from zlib import crc32

import numpy as np

from rotorid_acquire import procedures
from rotorid_acquire.emulators.devices import (
    BenchDevice,
    Device,
    Faults,
    Jr3Device,
    QuadrotorDevice,
    RotorDevice,
    TensileDevice,
    WireHalf,
    World,
    WrenchDevice,
)
from rotorid_acquire.emulators.physics import (
    GAUGE_MM,
    SECTION_MM2,
    SENSOR_POSITION_M,
    Battery,
    BenchPhysics,
    CellClamp,
    LoadedSensor,
    StandPhysics,
    TensilePhysics,
    TesterPhysics,
    TurningRotors,
    torque_rig,
    write_stated,
)
from rotorid_acquire.emulators.truth import Truth, draw_truth, write_truth
from rotorid_acquire.io.session import RoomAir, Session, Setup, session_path, write_index, write_session
from rotorid_acquire.io.wire import EXPERIMENTS, TRAPEZOID
from rotorid_acquire.procedures import STEADY_JR3, SteadyRule, programme_of, run_with
from rotorid_acquire.recorder import Recorder, Timings
from rotorid_acquire.transport import LoopbackTransport, VirtualClock

_WEIGHTS_GF = {
    "Carbon Fiber 1": 35.715,
    "Carbon Fiber 2": 36.615,
    "Carbon Fiber 3": 36.15,
    "Carbon Fiber Tube": 343.445,
    "Aluminum 1": 249.525,
    "Aluminum 2": 250.955,
    "Aluminum 3": 250.5525,
    "Aluminum 4": 255.07,
}

COMBINATIONS: tuple[tuple[str, ...], ...] = (
    ("Carbon Fiber 1",),
    ("Carbon Fiber 1", "Carbon Fiber 2"),
    ("Carbon Fiber 1", "Carbon Fiber 2", "Carbon Fiber 3"),
    ("Aluminum 4",),
    ("Carbon Fiber Tube",),
    ("Aluminum 1", "Aluminum 2"),
    ("Aluminum 1", "Aluminum 2", "Aluminum 3"),
    ("Aluminum 3", "Aluminum 4", "Carbon Fiber 1", "Carbon Fiber 2", "Carbon Fiber 3", "Carbon Fiber Tube"),
)
SEED = 2024
STATED = "campaign_stated.yaml"
"""Next to the sealed truth: the same in the words of the catalogue."""
_REPEATS = 10
_COMBINED_AXES = ("xy", "xz", "yz", "xyz")
_COMBINED_LOADS = (3, 4, 6)  # combinations of weights
_PLATFORMS_Z = ("al", "pla", "jr3")
_PROPELLER = "5040 three-blade"
_FIRST_DAY = datetime(2024, 3, 4, 9, 0, tzinfo=timezone(timedelta(hours=-6)))
_TESTS_PER_BATTERY = 6
_RADIO_FAULTS = 2e-4  # share of frames that each kind of fault befalls on the Bluetooth line


@dataclass
class _Campaign:
    """Where it goes, what is true, and how far the day has come."""

    raw: Path
    truth: Truth
    seed: int
    date: datetime = _FIRST_DAY
    recordings: list[Session] = field(default_factory=list)

    def rng(self, name: str) -> np.random.Generator:
        """Random numbers of one session, whatever comes before it."""
        return np.random.default_rng([self.seed, crc32(name.encode())])

    def line(self, device: Device, name: str, **options) -> WireHalf:
        """The device's bytes: its clock is off by the truth's error and has been running for a while."""
        rng = self.rng(f"line {name} {device.instrument.name}")
        error = getattr(self.truth.clocks, device.instrument.name)
        start_us = int(rng.integers(1 << 32))
        share = options.pop("share", 0.0)
        faults = Faults(clock_start_us=start_us, share=share)
        return WireHalf(device, rng, clock_error=error, faults=faults, **options)

    def air(self) -> RoomAir:
        """Air of the hour: warmer in the afternoon, the pressure of 540 m."""
        hours = (self.date - _FIRST_DAY).total_seconds() / 3600
        day = 2 * math.pi * (hours % 24) / 24
        return RoomAir(
            temperature_c=round(23.5 + 2.0 * math.sin(day), 1),
            pressure_pa=round(95_400 + 150 * math.sin(0.37 * day + 0.05 * hours), 0),
            relative_humidity=round(0.48 - 0.06 * math.sin(day), 2),
        )

    def record(
        self,
        kind: str,
        group: str,
        world: World,
        setups: dict[str, Setup],
        run: Callable[..., None],
        procedure: dict,
        pause_s: float = 45.0,
    ) -> None:
        """Record one test with one recorder per line, pack the logs, note them in the index.

        `setups` holds one entry per line of the world, named as the recording is.
        """
        clock = VirtualClock(self.date)
        clock.follow(world.run_until)
        folder = self.raw / "campaign" / kind
        recorders = [
            Recorder(
                line.device.instrument,
                LoopbackTransport(line, clock, name=f"emulated {line.device.instrument.name}"),
                clock,
                folder,
                name,
                setup.model_copy(update={"kind": kind, "air": self.air()}),
                group=group,
                procedure=procedure,
                # on a virtual clock no computer can die
                timings=Timings(poll_s=0.1 / len(world.lines), watchdog_s=None),
                durable=False,
            )
            for line, (name, setup) in zip(world.lines, setups.items(), strict=True)
        ]
        run_with(recorders, run)
        for recorder in recorders:
            _pack(recorder.log_path, recorder.session)
            self.recordings.append(recorder.session)
        self.date += timedelta(seconds=round(clock.now_ns() / 1e9 + pause_s))


def weight_gf(items: tuple[str, ...] | list[str]) -> float:
    """Weight of a combination in gf."""
    return round(sum(_WEIGHTS_GF[item] for item in items), 4)


def _pack(log: Path, session: Session) -> None:
    """Replace a finished log by its gzipped form (same bytes inside, no name and no date in the header)."""
    packed = log.with_name(log.name + ".gz")
    with open(packed, "wb") as raw, gzip.GzipFile("", "wb", 9, raw, mtime=0) as out:
        out.write(log.read_bytes())
    log.unlink()
    session.log = packed.name
    write_session(session, session_path(packed))


def _operator(place: Callable[[float], None], load_gf: float, reaction_samples: int) -> procedures.Prompt:
    """Someone who does what the recorder asks for, a moment later."""

    def prompt(text: str) -> Callable[[], bool]:
        left = reaction_samples
        placed = False

        def done() -> bool:
            nonlocal left, placed
            left -= 1
            if left <= 0 and not placed:
                place(load_gf)
                placed = True
            return left <= -25  # half a second to take the hand away

        return done

    return prompt


# ---- the tests -------------------------------------------------------------------------------------------


def calibration(campaign: _Campaign) -> None:
    """Six cells, eight combinations of weights, three repeats, 400 samples each (fig. 2.34)."""
    for cell in range(1, 7):
        for number, items in enumerate(COMBINATIONS, start=1):
            for repeat in range(1, 4):
                name = f"cal-cell{cell}-w{number}-r{repeat}"
                rng = campaign.rng(name)
                physics = CellClamp(campaign.truth.cells, rng, cell)
                world = World(physics, campaign.line(BenchDevice(physics), name))
                physics.process(1.0)
                load = weight_gf(items)

                def prompt(text: str, physics=physics, load=load) -> Callable[[], bool]:
                    physics.place_load("z", load)
                    return lambda: True

                setup = Setup(platform="clamp", cell=cell, load_gf=load, load_items=list(items), repeat=repeat)
                procedure = {"name": "calibrate_cell", "samples": 400, "weight_at": 50}
                run = partial(procedures.calibrate_cell, prompt=prompt)
                campaign.record("calibration", f"cal-cell{cell}", world, {name: setup}, run, procedure)


def static(campaign: _Campaign) -> None:
    """Weights along x and y on the aluminium bench, along z on all three platforms, ten repeats."""
    series = [("al", "x"), ("al", "y"), *((platform, "z") for platform in _PLATFORMS_Z)]
    for platform, axis in series:
        for number, items in enumerate(COMBINATIONS, start=1):
            for repeat in range(1, _REPEATS + 1):
                _weigh(campaign, "static", platform, axis, items, f"w{number}-r{repeat:02d}", repeat)


def _weigh(
    campaign: _Campaign, kind: str, platform: str, axis: str, items: tuple[str, ...], name: str, repeat: int
) -> None:
    """Put weights on a platform along one axis, or along several at once, and read."""
    group = f"{kind}-{platform}-{axis}"
    name = f"{group}-{name}"
    rng = campaign.rng(name)
    physics, device = _platform(campaign, platform, rng)
    world = World(physics, campaign.line(device, name))
    physics.process(1.0)
    load = weight_gf(items)
    rule = STEADY_JR3 if platform == "jr3" else SteadyRule()
    prompt = _operator(lambda gf: physics.place_load(axis, gf), load, int(rng.integers(60, 120)))
    setup = Setup(platform=platform, axis=axis, load_gf=load, load_items=list(items), repeat=repeat)
    run = partial(procedures.static_test, prompt=prompt, samples=50, rule=rule)
    campaign.record(kind, group, world, {name: setup}, run, {"name": "static_test", "samples": 50, **vars(rule)})


def dynamic(campaign: _Campaign) -> None:
    """A small quadrotor flown on the bench in aluminium, in PLA and on the reference sensor, three sets."""
    for repeat in range(1, 4):
        for platform in _PLATFORMS_Z:
            name = f"dynamic-{platform}-set{repeat}"
            rng = campaign.rng(name)
            physics, device = _platform(campaign, platform, rng)
            world = World(physics, campaign.line(device, name))
            physics.process(1.0)
            rule = STEADY_JR3 if platform == "jr3" else SteadyRule()
            force = _manoeuvre(campaign.rng(f"dynamic set {repeat}"), rng)

            def prompt(text: str, physics=physics, force=force) -> Callable[[], bool]:
                physics.drive(force)
                return lambda: True

            setup = Setup(platform=platform, axis="z", repeat=repeat, remarks="87 g quadrotor, flown by hand")
            procedure = {"name": "dynamic_test", "samples": 1500, **vars(rule)}
            run = partial(procedures.dynamic_test, prompt=prompt, samples=1500, rule=rule)
            campaign.record("dynamic", f"dynamic-set{repeat}", world, {name: setup}, run, procedure, pause_s=300)


def _platform(
    campaign: _Campaign, platform: str, rng: np.random.Generator
) -> tuple[BenchPhysics | LoadedSensor, Device]:
    if platform == "jr3":
        sensor = LoadedSensor(campaign.truth.jr3, rng)
        return sensor, Jr3Device(sensor)
    bench = BenchPhysics(campaign.truth.cells, campaign.truth.bench[platform], rng)
    return bench, BenchDevice(bench, f"EMU-BENCH-{platform.upper()}")


def _manoeuvre(set_rng: np.random.Generator, own_rng: np.random.Generator) -> Callable[[float], np.ndarray]:
    """Thrust steps of a pilot: one plan per set, flown with his own timing each time. Force −z, N."""
    levels = np.concatenate([[0.0, 0.85], set_rng.uniform(0.35, 1.65, 6), [0.85, 0.0]])
    starts = np.cumsum(np.concatenate([[0.0, 3.0], set_rng.uniform(2.0, 3.5, 7), [3.0]]))
    starts = starts + np.concatenate([[0.0], own_rng.normal(0, 0.08, len(starts) - 1)])
    levels = levels * (1 + own_rng.normal(0, 0.01, len(levels)))
    lag_s = 0.12

    def force(time_s: float) -> np.ndarray:
        thrust = 0.0
        for i in range(1, len(levels)):
            if time_s > starts[i]:
                thrust += (levels[i] - levels[i - 1]) * (1 - math.exp(-(time_s - starts[i]) / lag_s))
        return np.array([0.0, 0.0, -thrust])

    return force


def thrust(campaign: _Campaign) -> None:
    """Motor 1 on the thrust tester at 1 to 50 % (50 tests)."""
    truth = campaign.truth
    for percent in range(1, 51):
        if percent % 10 == 1:
            battery = Battery(truth.battery)
        name = f"thrust-{percent:02d}"
        rotors = TurningRotors(truth.rotor, battery, 1)
        physics = TesterPhysics(rotors, truth.rotor, truth.tester, campaign.rng(name))
        setup = Setup(
            platform="tester",
            axis="z",
            motor=1,
            throttle=percent / 100,
            propeller=_PROPELLER,
            battery=f"4S 1500 mAh no. {(percent - 1) // 10 % 3 + 1}",
        )
        world = World(physics, campaign.line(RotorDevice(physics), name))
        settings = {"throttle": percent / 100, "rest_s": 1.0, "hold_s": 4.0}
        run = partial(procedures.thrust_test, **settings)
        campaign.record("thrust", "thrust", world, {name: setup}, run, {"name": "thrust_test", **settings})


def torque(campaign: _Campaign) -> None:
    """Motor 1 on the vehicle on the wrench sensor at 2 to 40 % (20 tests)."""
    truth = campaign.truth
    for percent in range(2, 41, 2):
        if percent % 10 == 2:
            battery = Battery(truth.battery)
        name = f"torque-{percent:02d}"
        stand, tester = torque_rig(truth, battery, campaign.rng(name))
        common = Setup(
            axis="z",
            motor=1,
            throttle=percent / 100,
            propeller=_PROPELLER,
            battery=f"4S 1500 mAh no. {(percent // 10) % 3 + 1}",
            mount_roll_deg=0.0,
            mount_pitch_deg=0.0,
            sensor_position_m=list(SENSOR_POSITION_M),
            tared=False,
        )
        lines = (campaign.line(device, name) for device in (RotorDevice(tester), WrenchDevice(stand)))
        remark = "drives and counts only: its thrust cell carries nothing"
        setups = {
            f"{name}-rotor": common.model_copy(update={"platform": "tester", "remarks": remark}),
            f"{name}-wrench": common.model_copy(update={"platform": "stand"}),
        }
        settings = {"throttle": percent / 100, "rest_s": 2.0, "hold_s": 6.0}
        run = partial(procedures.torque_test, **settings)
        campaign.record("torque", name, World(stand, *lines), setups, run, {"name": "torque_test", **settings})


def dynamics(campaign: _Campaign) -> None:
    """The 48 experiments of table A.1 on the stand, two loggers with their own clocks."""
    truth = campaign.truth
    for number, experiment in EXPERIMENTS.items():
        if number % _TESTS_PER_BATTERY == 1:
            battery = Battery(truth.battery)
        name = f"exp-{number:02d}"
        rng = campaign.rng(name)
        rotors = TurningRotors(truth.rotor, battery, 4)
        stand = StandPhysics(
            truth.vehicle, truth.rotor, truth.wrench, rotors, experiment.roll_deg, experiment.pitch_deg, rng
        )
        world = World(
            stand,
            campaign.line(QuadrotorDevice(rotors, rng), name, burst_s=0.04, share=_RADIO_FAULTS),
            campaign.line(WrenchDevice(stand), name),
        )
        letter, programme = programme_of(experiment)
        setup = Setup(
            platform="stand",
            experiment=number,
            propeller=_PROPELLER,
            battery=f"4S 1500 mAh no. {(number - 1) // _TESTS_PER_BATTERY % 3 + 1}",
            mount_roll_deg=float(experiment.roll_deg),
            mount_pitch_deg=float(experiment.pitch_deg),
            sensor_position_m=list(SENSOR_POSITION_M),
            tared=False,
        )
        shape = "trapezoid" if programme.shape == TRAPEZOID else "sine"
        procedure = {"name": "experiment", "number": number, "letter": letter, **programme._asdict()}
        procedure |= {"shape": shape, "maxima": list(programme.maxima)}
        setups = {f"{name}-quadrotor": setup, f"{name}-wrench": setup}
        run = partial(procedures.experiment, letter=letter, programme=programme)
        campaign.record("dynamics", name, world, setups, run, procedure)


def tensile(campaign: _Campaign) -> None:
    """Printed specimens of four infill densities, three each."""
    for infill, plastic in campaign.truth.plastic.items():
        scatter = campaign.rng(f"specimens {infill}").permutation([-1.0, 0.0, 1.0])
        for repeat in range(1, 4):
            name = f"tensile-{infill:03d}-{repeat}"
            rng = campaign.rng(name)
            scale = 1 + campaign.truth.specimen_scatter * scatter[repeat - 1]
            physics = TensilePhysics(plastic, scale, rng.uniform(0.02, 0.12), rng)
            setup = Setup(
                platform="tensile tester",
                specimen=f"{infill}-{repeat}",
                infill_percent=infill,
                repeat=repeat,
                gauge_length_mm=GAUGE_MM,
                cross_section_mm2=SECTION_MM2,
            )
            world = World(physics, campaign.line(TensileDevice(physics), name))
            procedure = {"name": "stream", "until": "the specimen is broken", "speed_mm_min": 10}
            run = partial(procedures.stream, samples=None)
            campaign.record("tensile", f"tensile-{infill:03d}", world, {name: setup}, run, procedure, pause_s=120)


def combined(campaign: _Campaign) -> None:
    """Weights that pull along two or three axes of the aluminium bench at once, five repeats.

    The thesis has none; they show how good a reconstruction is when loads are not along one axis at a time.
    """
    for axis in _COMBINED_AXES:
        for number in _COMBINED_LOADS:
            for repeat in range(1, 6):
                name = f"w{number}-r{repeat}"
                _weigh(campaign, "combined", "al", axis, COMBINATIONS[number - 1], name, repeat)


PARTS: dict[str, Callable[[_Campaign], None]] = {
    part.__name__: part for part in (calibration, static, dynamic, thrust, torque, dynamics, tensile, combined)
}


def run_campaign(
    raw: Path,
    sealed: Path,
    seed: int = SEED,
    parts: Iterable[str] = PARTS,
    truth: Truth | None = None,
    say: Callable[[str], None] = print,
) -> list[Session]:
    """Record parts into `raw/campaign/<part>` (written anew), the index, and the sealed truth. Returns
    the recordings. The sealed file must lie outside `raw`; raises ValueError otherwise."""
    if sealed.resolve().is_relative_to(raw.resolve()):
        raise ValueError(f"{sealed}: the truth must lie outside {raw}, or it is not concealed")
    campaign = _Campaign(raw, truth or draw_truth(seed), seed)
    for name in parts:
        shutil.rmtree(raw / "campaign" / name, ignore_errors=True)
        campaign.date = _FIRST_DAY + timedelta(days=list(PARTS).index(name))  # a day each, whichever are made
        PARTS[name](campaign)
        say(f"{name}: {sum(s.setup.kind == name for s in campaign.recordings)} recordings")
    write_index(raw)
    write_truth(campaign.truth, sealed, seed)
    write_stated(campaign.truth, sealed.with_name(STATED))
    return campaign.recordings


def main() -> None:
    """Command line: `python -m rotorid_acquire.campaign [--raw DIR] [--sealed FILE] [--seed N] [--part NAME]`."""
    import argparse

    parser = argparse.ArgumentParser(prog="python -m rotorid_acquire.campaign", description=__doc__)
    parser.add_argument("--raw", type=Path, default=Path("raw"))
    parser.add_argument("--sealed", type=Path, default=Path("tests/sealed/campaign_truth.yaml"))
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--part", action="append", choices=list(PARTS), help="only this part; repeatable")
    given = parser.parse_args()
    recordings = run_campaign(given.raw, given.sealed, given.seed, given.part or PARTS)
    size = sum(file.stat().st_size for file in (given.raw / "campaign").rglob("*") if file.is_file())
    print(f"{len(recordings)} recordings, {size / 1e6:.1f} MB in {given.raw}/campaign; truth in {given.sealed}")


if __name__ == "__main__":
    main()
