"""`rotorid-acquire`: record the instruments, or emulate them.

Each instrument is a command; what all of them share (options, stable names of serial ports, the question that every
instrument answers with its name) stands here once.
"""

from __future__ import annotations

import functools
import inspect
import select
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from datetime import datetime
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, get_type_hints

import typer

from rotorid.errors import InputError
from rotorid.io.text.writing import all_or_none
from rotorid_acquire import procedures, view
from rotorid_acquire.io import wire
from rotorid_acquire.io.frames import COMMAND, START, Frame, Intake, encode
from rotorid_acquire.io.session import Ended, RoomAir, Setup
from rotorid_acquire.io.wire import EXPERIMENTS, IDENTIFY, INSTRUMENTS
from rotorid_acquire.procedures import HOLD_S, RAMP_S, programme_of, recorders_for, run_with
from rotorid_acquire.recorder import Recorder
from rotorid_acquire.transport import AcquireError, Interrupted, PortLost, PortMissing, SerialTransport

_DEFAULT_OUT = Path("raw/local")
_BY_ID = Path("/dev/serial/by-id")
_WAIT_S = 2.5  # an UNO restarts when its port is opened, and its boot loader keeps it for a second or two
app = typer.Typer(no_args_is_help=True, add_completion=False, help=__doc__, pretty_exceptions_enable=False)

_Port = Annotated[str, typer.Option("--port", "-p", help="serial port; `rotorid-acquire ports` lists them")]
_Rotor = Annotated[str | None, typer.Option("--rotor", help="whose rotor it is, e.g. 'vehicle A, motor 1'")]
_Propeller = Annotated[str | None, typer.Option(help="propeller, e.g. '5040 three-blade'")]
_BatteryName = Annotated[str | None, typer.Option("--battery", help="battery, e.g. '4S 1500 mAh no. 1'")]
_PlaceS = Annotated[
    float | None, typer.Option("--place-s", help="give a load so many seconds instead of waiting for Enter")
]


@dataclass(frozen=True)
class _Shared:
    """Where a recording goes, what it is called, and what is seen meanwhile."""

    out: Annotated[Path, typer.Option(help="folder for the log and its metadata")] = _DEFAULT_OUT
    name: Annotated[str | None, typer.Option("--id", help="name of the recording; default: instrument and time")] = None
    operator: Annotated[str | None, typer.Option(help="who records")] = None
    air: Annotated[str | None, typer.Option("--air", help="temperature °C, pressure Pa, humidity: 23,95400,0.5")] = None
    plot: Annotated[
        list[str] | None, typer.Option("--plot", help="also draw this column, e.g. cell_1_v; repeatable")
    ] = None
    limit: Annotated[
        list[str] | None,
        typer.Option("--limit", help="stop when a column leaves its range: battery_current_a:0:30; repeatable"),
    ] = None
    source: Annotated[
        str | None, typer.Option(help="instrument or emulator, where the device itself does not say it rightly")
    ] = None

    @property
    def weather(self) -> RoomAir | None:
        """The air as metadata have it. Raises typer.BadParameter."""
        if self.air is None:
            return None
        try:
            temperature, pressure, humidity = (float(part) for part in self.air.split(","))
            return RoomAir(temperature_c=temperature, pressure_pa=pressure, relative_humidity=humidity)
        except ValueError as error:
            raise typer.BadParameter(
                "--air is temperature in °C, pressure in Pa and humidity from 0 to 1, such as 23,95400,0.5"
            ) from error

    def limits(self, columns: list[str]) -> dict[str, tuple[float, float]]:
        """Ranges by column. Raises typer.BadParameter."""
        found = {}
        for text in self.limit or []:
            try:
                column, low, high = text.split(":")
                found[column] = (float(low), float(high))
            except ValueError as error:
                raise typer.BadParameter(
                    f"--limit is COLUMN:LOW:HIGH, such as battery_current_a:0:30, not {text!r}"
                ) from error
            if column not in columns:
                raise typer.BadParameter(f"--limit is for one of {', '.join(columns)}, not {column!r}")
        return found


def _with_shared(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the shared options; it gets them as its argument `shared`."""
    hints = get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
        if name != "shared"
    ]
    types = get_type_hints(_Shared, include_extras=True)
    keyword = inspect.Parameter.KEYWORD_ONLY
    more = [inspect.Parameter(f.name, keyword, default=f.default, annotation=types[f.name]) for f in fields(_Shared)]

    @functools.wraps(command)
    def wrapped(**given) -> None:
        shared = _Shared(**{field.name: given.pop(field.name) for field in fields(_Shared)})
        command(**given, shared=shared)

    parameters = [parameter.replace(kind=keyword) for parameter in own] + more
    wrapped.__signature__ = inspect.Signature(parameters)
    wrapped.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    del wrapped.__wrapped__  # its signature is not the one to look at
    return wrapped


@app.command()
def ports(
    identify: Annotated[bool, typer.Option("--identify", help="ask each port who is there")] = False,
    also: Annotated[list[str] | None, typer.Option("--port", help="ask this one as well, e.g. an emulator's")] = None,
    udev: Annotated[str | None, typer.Option("--udev", help="print a udev rule that names the only board so")] = None,
) -> None:
    """List the serial ports of this computer by names that stay the same, and who is on them."""
    from serial.tools import list_ports

    found = sorted(list_ports.comports())
    if udev is not None:
        boards = [port for port in found if port.vid is not None]
        if len(boards) != 1:
            _fail(f"--udev is for one board at a time; plugged in by USB are {len(boards)}")
        (board,) = boards
        typer.echo(udev_rule(f"{board.vid:04x}", f"{board.pid:04x}", board.serial_number, udev))
        return
    if not found and not also:
        typer.echo("no serial port found. Plug the instrument in; for an emulator: rotorid-acquire emulate --help")
    for port in found:
        typer.echo(f"{stable_name(port.device)}\t{port.description}\t{port.hwid}")
        if identify:
            typer.echo(f"  {who_is_there(port.device)}")
    for name in also or []:
        typer.echo(f"{name}\n  {who_is_there(name)}")


@app.command()
@_with_shared
def bench(
    port: _Port,
    test: Annotated[str, typer.Option(help="stream, calibrate, static or dynamic")] = "stream",
    wait_s: Annotated[float, typer.Option(help="longest wait for the load, and for a steady reading, s")] = (
        procedures.WAIT_S
    ),
    tolerance: Annotated[
        float | None, typer.Option(help="steady: no channel moves by more, V (jr3: N); default 2e-7 (0.5)")
    ] = None,
    samples: Annotated[int | None, typer.Option(help="how many; default: 400, 50, 1500, or until Ctrl-C")] = None,
    rate: Annotated[float | None, typer.Option(help="samples a second, for stream")] = None,
    cell: Annotated[int | None, typer.Option(help="cell that is calibrated, 1–6")] = None,
    platform: Annotated[str, typer.Option(help="al, pla, or jr3: the reference sensor")] = "al",
    axis: Annotated[str | None, typer.Option(help="x, y or z")] = None,
    load_gf: Annotated[float | None, typer.Option(help="the weight, gf")] = None,
    repeat: Annotated[int | None, typer.Option(help="number of the repeat")] = None,
    place_s: _PlaceS = None,
    *,
    shared: _Shared,
) -> None:
    """Record the load-cell bench: settle, wait until steady, tare, load, read (thesis fig. 2.35)."""
    instrument = "jr3" if platform == "jr3" else "bench"
    kind = {"calibrate": "calibration", "stream": "free"}.get(test, test)
    setup = Setup(kind=kind, platform=platform, axis=axis, load_gf=load_gf, cell=cell, repeat=repeat)

    def run(recorder: Recorder) -> None:
        if test in procedures.BENCH_TESTS:
            procedures.bench_test(recorder, test, _prompt(recorder, place_s), samples or None, tolerance, wait_s)
        elif test == "stream":
            procedures.stream(recorder, samples, 1 / rate if rate else 0.0)
        else:
            raise typer.BadParameter(f"--test is stream, calibrate, static or dynamic, not {test!r}")

    _record({instrument: port}, setup, run, {"name": test}, shared)


@app.command()
@_with_shared
def rotor(
    port: _Port,
    throttle: Annotated[float, typer.Option(min=0, max=1, help="fraction of full throttle")],
    rest_s: Annotated[float, typer.Option(help="rest before and after, s")] = 1.0,
    hold_s: Annotated[float, typer.Option(help="throttle on, s")] = 4.0,
    rotor: _Rotor = None,
    propeller: _Propeller = None,
    battery: _BatteryName = None,
    *,
    shared: _Shared,
) -> None:
    """Record the thrust tester: rest, throttle, rest. Keep clear of the propeller."""
    setup = Setup(kind="thrust", throttle=throttle, rotor=rotor, propeller=propeller, battery=battery, motor=1)
    settings = {"throttle": throttle, "rest_s": rest_s, "hold_s": hold_s}
    run = functools.partial(procedures.thrust_test, **settings)
    _record({"rotor": port}, setup, run, {"name": "thrust_test", **settings}, shared)


@app.command()
@_with_shared
def wrench(
    port: _Port,
    interval: Annotated[float, typer.Option(help="sampling interval, s")] = 0.01,
    restart_times: Annotated[int, typer.Option(help="how often a measuring run starts anew")] = 0,
    measuring_times: Annotated[int, typer.Option(help="samples of a run, 0: until stopped")] = 0,
    offset: Annotated[bool, typer.Option(help="take the present reading as zero first")] = False,
    samples: Annotated[int | None, typer.Option(help="stop after so many; default: Ctrl-C stops")] = None,
    only: Annotated[str | None, typer.Option(help="just this: power-on, power-off or offset")] = None,
    *,
    shared: _Shared,
) -> None:
    """Record the six-axis sensor: power, initialise, offset, start, stop, save."""
    operations = {"power-on": ("P", b"\1"), "power-off": ("P", b"\0"), "offset": ("O", b"")}
    if only is not None and only not in operations:
        raise typer.BadParameter(f"--only is power-on, power-off or offset, not {only!r}")

    def run(recorder: Recorder) -> None:
        if only is not None:
            recorder.command(*operations[only])
        else:
            procedures.measure_wrench(recorder, interval, restart_times, measuring_times, offset, samples)

    procedure = {
        "name": only or "measure_wrench",
        "interval_s": interval,
        "restart_times": restart_times,
        "measuring_times": measuring_times,
        "offset": offset,
    }
    _record({"wrench": port}, Setup(tared=offset), run, procedure, shared)


@app.command()
@_with_shared
def quadrotor(
    port: _Port,
    dynamics: Annotated[str, typer.Option(help=f"command character: {wire.DYNAMICS}")] = "h",
    shape: Annotated[str, typer.Option(help="trapezoid or sine")] = "trapezoid",
    maxima: Annotated[str, typer.Option(help="maxima of motors 1–4, fractions")] = "0.1,0.1,0.1,0.1",
    ramp_s: Annotated[float, typer.Option(help="ramp up and down, s")] = RAMP_S,
    hold_s: Annotated[float, typer.Option(help="time at the maximum, or of the sine, s")] = HOLD_S,
    frequency: Annotated[float, typer.Option(help="of the sine, Hz")] = 0.25,
    propeller: _Propeller = None,
    battery: _BatteryName = None,
    *,
    shared: _Shared,
) -> None:
    """Send the quadrotor a programme and record the commands of its motors."""
    if dynamics not in wire.DYNAMICS:
        raise typer.BadParameter(f"--dynamics is one of {', '.join(wire.DYNAMICS)}, not {dynamics!r}")
    if shape not in ("trapezoid", "sine"):
        raise typer.BadParameter(f"--shape is trapezoid or sine, not {shape!r}")
    try:
        four = tuple(float(value) for value in maxima.split(","))
        number = wire.SINE if shape == "sine" else wire.TRAPEZOID
        programme = wire.Programme(number, four, ramp_s, hold_s, frequency)
        programme.pack()
    except ValueError as error:
        raise typer.BadParameter(f"--maxima are four fractions such as 0.1,0.1,0.1,0.1 ({error})") from error
    setup = Setup(kind="free", propeller=propeller, battery=battery)
    procedure = {"name": "fly_programme", "letter": dynamics, **programme._asdict(), "maxima": list(four)}
    run = functools.partial(procedures.fly_programme, letter=dynamics, programme=programme)
    _record({"quadrotor": port}, setup, run, procedure, shared)


@app.command()
@_with_shared
def experiment(
    number: Annotated[int, typer.Argument(min=1, max=48, help="number in the thesis's table A.1")],
    quadrotor_port: Annotated[str, typer.Option(help="serial port of the ESP32")],
    wrench_port: Annotated[str, typer.Option(help="serial port of the six-axis sensor")],
    propeller: _Propeller = None,
    battery: _BatteryName = None,
    *,
    shared: _Shared,
) -> None:
    """Record experiment N of table A.1: quadrotor and wrench together, each with its own clock."""
    row = EXPERIMENTS[number]
    letter, programme = programme_of(row)
    typer.echo(
        f"experiment {number}: {row.dynamics}, {row.signal}, mount at roll {row.roll_deg}°, pitch {row.pitch_deg}°",
        err=True,
    )
    setup = Setup(
        kind="dynamics",
        platform="stand",
        experiment=number,
        mount_roll_deg=row.roll_deg,
        mount_pitch_deg=row.pitch_deg,
        sensor_position_m=[0.0, 0.0, 0.045],
        tared=False,
        propeller=propeller,
        battery=battery,
    )
    ports = {"quadrotor": quadrotor_port, "wrench": wrench_port}
    run = functools.partial(procedures.experiment, letter=letter, programme=programme)
    procedure = {"name": "experiment", "number": number, "letter": letter, "duration_s": programme.duration_s}
    name = shared.name or f"exp-{number:02d}-{datetime.now():%Y%m%d-%H%M%S}"
    _record(ports, setup, run, procedure, replace(shared, name=name))


@app.command()
@_with_shared
def torque(
    throttle: Annotated[float, typer.Option(min=0, max=1, help="fraction of full throttle")],
    rotor_port: Annotated[str, typer.Option(help="serial port of the thrust tester, which drives motor 1")],
    wrench_port: Annotated[str, typer.Option(help="serial port of the six-axis sensor below the vehicle")],
    rest_s: Annotated[float, typer.Option(help="rest before and after, s")] = 2.0,
    hold_s: Annotated[float, typer.Option(help="throttle on, s")] = 6.0,
    rotor: _Rotor = None,
    propeller: _Propeller = None,
    battery: _BatteryName = None,
    *,
    shared: _Shared,
) -> None:
    """Record the torque of motor 1 by thrust tester and six-axis sensor. Keep clear of the propeller."""
    setup = Setup(
        kind="torque",
        axis="z",
        motor=1,
        throttle=throttle,
        mount_roll_deg=0.0,
        mount_pitch_deg=0.0,
        tared=False,
        rotor=rotor,
        propeller=propeller,
        battery=battery,
    )
    settings = {"throttle": throttle, "rest_s": rest_s, "hold_s": hold_s}
    ports, run = {"rotor": rotor_port, "wrench": wrench_port}, functools.partial(procedures.torque_test, **settings)
    _record(ports, setup, run, {"name": "torque_test", **settings}, shared)


@app.command()
@_with_shared
def tensile(
    port: _Port,
    infill_percent: Annotated[int, typer.Option(help="infill density of the specimen")],
    repeat: Annotated[int, typer.Option(help="number of the specimen")] = 1,
    gauge_length_mm: Annotated[float, typer.Option(help="distance between the grips")] = 40.0,
    cross_section_mm2: Annotated[float, typer.Option(help="narrowest cross-section")] = 19.2,
    *,
    shared: _Shared,
) -> None:
    """Record the tensile tester until the specimen is broken."""
    setup = Setup(
        kind="tensile",
        infill_percent=infill_percent,
        repeat=repeat,
        specimen=f"{infill_percent}-{repeat}",
        gauge_length_mm=gauge_length_mm,
        cross_section_mm2=cross_section_mm2,
    )
    run = functools.partial(procedures.stream, samples=None, moves=True)
    _record({"tensile": port}, setup, run, {"name": "stream"}, shared)


@app.command()
def check(
    log: Annotated[Path, typer.Argument(help="a .rlog or .rlog.gz")],
    csv: Annotated[Path | None, typer.Option(help="also write the table to this file")] = None,
) -> None:
    """Read a log as the pipeline does and say what is in it. A recording that was cut off is completed: its
    metadata then say how far it goes."""
    from rotorid_acquire.io.lines import read_line_log
    from rotorid_acquire.io.logs import read_log
    from rotorid_acquire.io.metadata_checksum import without_checksum
    from rotorid_acquire.io.session import read_session, session_path
    from rotorid_acquire.run_plan import repair

    try:
        session = read_session(session_path(log)) if session_path(log).exists() else None
        of_lines = session is not None and "description" in session.procedure
        parsed = (read_line_log if of_lines else read_log)(log)
        repaired = repair(log, parsed)
    except (InputError, OSError) as error:
        _fail(str(error))
    table = parsed.table
    if of_lines:
        typer.echo(f"{log}: {len(table)} lines read, {parsed.unreadable} could not be", nl=False)
        typer.echo(f", {parsed.damaged_bytes} bytes damaged" if parsed.damaged_bytes else "")
        for sentence in parsed.warnings:
            typer.echo(sentence)
        session = parsed.session
    else:
        session = parsed.session
        typer.echo(f"{log}: {parsed.instrument.title} ({parsed.start.firmware}), {len(table)} samples", nl=False)
        typer.echo(f", {table.time_s.iloc[-1]:.2f} s of device time" if len(table) else "")
        damaged = f"damaged {parsed.checksum_errors + parsed.broken_frames}, resets {parsed.resets}"
        typer.echo(f"missing {parsed.missing} in {len(parsed.gaps)} gaps, repeated {parsed.repeated}, {damaged}")
        if parsed.malformed or parsed.unknown_kinds:
            typer.echo(f"frames that make no sense {parsed.malformed}, of an unknown kind {parsed.unknown_kinds}")
    if parsed.cut_at is not None:
        typer.echo(f"cut off at byte {parsed.cut_at}; everything before that is there")
    for fault in parsed.faults:
        typer.echo(f"NOT AS RECORDED: {fault}")
    if repaired:
        typer.echo("its metadata were never finished; completed now from the log")
    if session is not None:
        typer.echo(f"ended: {session.ended} – {session.message}")
    if session is not None and session.metadata_sha256 is None and not repaired:
        typer.echo(without_checksum(1, session_path(log)))
    if csv is not None:
        with all_or_none(csv) as (part,):
            table.to_csv(part, index=False)
        typer.echo(f"table: {csv}")
    if parsed.faults:
        raise typer.Exit(1)


@app.command()
def checksum(
    place: Annotated[Path, typer.Argument(help="a log, its metadata, an index (sessions.tsv), or a folder")],
    renew: Annotated[bool, typer.Option("--renew", help="also where one is there and no longer fits")] = False,
) -> None:
    """Add the checksum to metadata and indexes that have none. After a meant edit of such a file, --renew it."""
    from rotorid_acquire.io.session import add_checksum, files_with_checksum, renew_checksum

    paths, written = [], 0
    try:
        paths = files_with_checksum(place)
        if renew and len(paths) > 1:
            _fail(f"{place}: --renew is for one file at a time, found {len(paths)}")
        for path in paths:
            written += renew_checksum(path) if renew else add_checksum(path)
    except (InputError, OSError) as error:
        _fail(f"{error}" + (f" ({written} of {len(paths)} written before that)" if written else ""))
    typer.echo(f"{place}: {written} checksums written, {len(paths) - written} fitted already")


@app.command()
def index(raw: Annotated[Path, typer.Argument(help="the folder of raw logs")] = Path("raw")) -> None:
    """Write `sessions.tsv` from the metadata of all recordings below a folder."""
    from rotorid_acquire.io.metadata_checksum import without_checksum
    from rotorid_acquire.io.session import metadata_files, read_session, write_index

    try:
        rows = write_index(raw)
        bare = [path for path in metadata_files(raw) if read_session(path).metadata_sha256 is None]
    except (InputError, OSError) as error:
        _fail(str(error))
    typer.echo(f"{raw / 'sessions.tsv'}: {len(rows)} recordings")
    if bare:
        typer.echo(without_checksum(len(bare), bare[0]))


@app.command()
def emulate(
    what: Annotated[str, typer.Argument(help="bench, rotor, wrench, quadrotor, stand, torque, jr3 or tensile")],
    link: Annotated[
        list[Path],
        typer.Option(help="name for the port; stand (quadrotor, wrench) and torque (rotor, wrench) need two"),
    ],
    material: Annotated[str, typer.Option(help="of the bench: al or pla")] = "al",
    load: Annotated[str | None, typer.Option(help="put a weight on: AXIS:GF@SECONDS, e.g. z:500.48@6")] = None,
    cell: Annotated[
        int | None, typer.Option(help="bench: this cell alone, clamped for its calibration; --load goes onto it")
    ] = None,
    number: Annotated[int, typer.Option("--experiment", help="stand: mount angle of this experiment")] = 1,
    infill_percent: Annotated[int, typer.Option(help="of the tensile specimen")] = 100,
    speed: Annotated[float, typer.Option(help="device seconds per second")] = 1.0,
    fault_share: Annotated[float, typer.Option(help="share of frames that each kind of fault befalls")] = 0.0,
    seed: Annotated[int, typer.Option(help="of the world's hidden imperfections")] = 1,
    truth: Annotated[Path | None, typer.Option(help="a truth file of one's own instead")] = None,
) -> None:
    """Be an instrument: a pseudo-terminal that speaks like the real one. Ctrl-C ends it."""
    from rotorid_acquire.emulators.ports import EmulatedPorts, build, parse_load
    from rotorid_acquire.emulators.truth import draw_truth, read_truth

    try:
        chosen = read_truth(truth) if truth else draw_truth(seed)
        world = build(what, chosen, seed, material, number, infill_percent, fault_share, cell=cell)
        if load is not None:
            world.plan(*parse_load(load))
    except (ValueError, OSError) as error:
        _fail(str(error))
    if len(link) != len(world.lines):
        _fail(f"{what} needs {len(world.lines)} --link, got {len(link)}")
    with EmulatedPorts(world, link, speed=speed) as emulated:
        for name, line in zip(emulated.names, world.lines, strict=True):
            typer.echo(f"{line.device.instrument.title} on {name}; Ctrl-C ends it")
        try:
            emulated.wait()
        except KeyboardInterrupt:
            pass


@app.command()
@_with_shared
def lines(
    description: Annotated[Path, typer.Argument(help="a file that says how its lines are read (docs/acquisition.md)")],
    port: _Port,
    samples: Annotated[int | None, typer.Option(help="stop after so many lines; default: Ctrl-C stops")] = None,
    silence_s: Annotated[float, typer.Option(help="give up after so long without a byte, s")] = 60.0,
    *,
    shared: _Shared,
) -> None:
    """Record an instrument that sends plain lines of text (CSV, key=value, fixed places) and knows no frames."""
    from rotorid_acquire.io.lines import read_description
    from rotorid_acquire.lines import record_lines
    from rotorid_acquire.transport import SerialTransport, SystemClock

    console, stop = view.stderr_console(), threading.Event()
    try:
        read = read_description(description)
        name = shared.name or f"{read.name}-{datetime.now():%Y%m%d-%H%M%S}"
        setup = Setup(operator=shared.operator, air=shared.weather)
        transport = SerialTransport(port, read.baud_rate)
        columns = list(read.columns)
        plots = [view.Plot(column, columns.index(column)) for column in _of(columns, shared.plot)]
        limits = shared.limits(columns)
        panel = view.LinesPanel(read.name, columns, samples, time.monotonic)

        def see(values: tuple[float, ...]) -> None:
            for one in (panel, *plots):
                one.see(values)
            for column, (low, high) in limits.items():
                value = values[columns.index(column)]
                if not low <= value <= high:
                    text = f"{column} is {value:.6g}, allowed are {low:g} to {high:g}: stopped"
                    raise AcquireError(text, Ended.LIMIT_EXCEEDED)

        def work() -> None:
            record_lines(
                *(read, transport, SystemClock(), shared.out, name, setup),
                samples=samples,
                stop_asked=stop,
                silence_s=silence_s,
                on_row=see,
                say=console.print,
            )

        view.watch([], work, stop, plots, console, [panel])
    except Interrupted as error:
        console.print(str(error))
        raise typer.Exit(130) from error
    except (InputError, AcquireError) as error:
        _fail(str(error))
    typer.echo(f"{shared.out / name}.rlog: recorded; `rotorid-acquire check` reads it")


@app.command()
def campaign(
    plan: Annotated[Path, typer.Argument(help="a plan file (docs/acquisition.md)")],
    show: Annotated[bool, typer.Option("--show", help="only say what is done and what is left")] = False,
    repeat: Annotated[str | None, typer.Option(help="record this one once more, by its name")] = None,
    emulate_it: Annotated[bool, typer.Option("--emulate", help="with emulators in the place of the ports")] = False,
    speed: Annotated[float, typer.Option(help="of the emulators, device seconds per second")] = 20.0,
    place_s: Annotated[float | None, typer.Option(help="give a load so many seconds; nobody is asked")] = None,
    plot: Annotated[
        list[str] | None, typer.Option("--plot", help="draw this column while it is recorded; repeatable")
    ] = None,
) -> None:
    """Record a campaign by its plan: checks first, then step after step; goes on where it was left."""
    from contextlib import nullcontext
    from tempfile import TemporaryDirectory

    from rotorid_acquire import run_plan
    from rotorid_acquire.run_plan import is_done, read_plan, steps_of

    console, stop = view.stderr_console(), threading.Event()
    try:
        planned = read_plan(plan)
        steps = steps_of(planned)
    except InputError as error:
        _fail(str(error))
    if show:
        for step in steps:
            typer.echo(f"{'done' if is_done(planned, step) else 'left'}\t{step.number}\t{step.name}\t{step.ask}")
        return
    if repeat is not None and repeat not in [step.name for step in steps]:
        near = get_close_matches(repeat, [step.name for step in steps], 1)
        _fail(f"{plan}: no step is called {repeat!r}" + (f"; did you mean {near[0]}?" if near else ""))
    _of([column for instrument in planned.ports for column in INSTRUMENTS[instrument].columns], plot)
    wait_s = place_s if place_s is not None else (4.0 if emulate_it else None)

    def ask(text: str) -> str:
        if wait_s is not None:
            console.print(text, style="bold")
            return ""
        console.print(f"{text}  [Enter: go on, s: skip, q: stop here]", style="bold")
        return sys.stdin.readline().strip().lower()

    def watch(recorders: list[Recorder], work: Callable[[], None]) -> None:
        for recorder in recorders:
            recorder.stop_asked = stop
        view.watch(recorders, work, stop, _curves(recorders, plot), console)

    desk = run_plan.Desk(
        say=lambda text: console.print(text),
        ask=ask,
        prompts=lambda step: lambda recorder: _prompt(recorder, wait_s),
        watch=watch,
    )
    try:
        with TemporaryDirectory(prefix="rotorid-") as folder:

            def ports_of(step):
                if emulate_it:
                    return run_plan.emulated_ports(planned, step, Path(folder), speed, wait_s * 0.6)
                return nullcontext(planned.ports)

            left = run_plan.run(planned, ports_of, desk, repeat)
    except Interrupted as error:
        console.print(str(error))
        raise typer.Exit(130) from error
    except (AcquireError, InputError, OSError) as error:
        _fail(f"{error}\nNothing that is recorded is lost; the same command goes on from here.")
    typer.echo(f"{planned.out}: {len(steps) - left} of {len(steps)} recordings are there; {planned.out}/sessions.tsv")


# ---- shared ----------------------------------------------------------------------------------------------


def _record(ports: dict[str, str], setup: Setup, run: Callable[..., None], procedure: dict, shared: _Shared) -> None:
    """Open one recorder per instrument, run, show, and leave with a code: 0, 1 or (interrupted) 130."""
    console, stop = view.stderr_console(), threading.Event()
    columns = [column for instrument in ports for column in INSTRUMENTS[instrument].columns]
    _of(columns, shared.plot)
    try:
        recorders = recorders_for(
            ports,
            shared.out,
            shared.name,
            dict.fromkeys(ports, setup.model_copy(update={"air": shared.weather, "operator": shared.operator})),
            procedure=procedure,
            limits=shared.limits(columns),
            say=lambda text: console.print(text, style="bold"),
            stop_asked=stop,
            source=shared.source,
        )
    except AcquireError as error:
        _fail(str(error))
    code = 0
    try:
        view.watch(recorders, lambda: run_with(recorders, run), stop, _curves(recorders, shared.plot), console)
    except Interrupted as error:
        console.print(str(error))
        code = 130
    except AcquireError as error:
        console.print(str(error), style="bold red")
        code = 1
    for recorder in recorders:
        if recorder.begun:
            counts = recorder.session.counts
            typer.echo(f"{recorder.log_path}: {counts.samples} samples, {counts.missing} missing")
            for warning in recorder.session.warnings:
                console.print(f"note: {warning}", style="yellow")
    raise typer.Exit(code)


def _prompt(recorder: Recorder, place_s: float | None) -> procedures.Prompt:
    """Ask for the load, then wait for Enter, or for so many seconds of samples."""

    def prompt(text: str) -> Callable[[], bool]:
        if place_s is not None:
            recorder.say(f"{text}: {place_s:g} s")
            return procedures.countdown(round(place_s * 1e6 / recorder.instrument.interval_us))
        recorder.say(f"{text}, then press Enter")

        def pressed() -> bool:
            ready, _, _ = select.select([sys.stdin], [], [], 0)
            if ready and not sys.stdin.readline():
                recorder.note(
                    "input_over", "standard input is at its end: nobody can press Enter, so this is taken as done"
                )
            return bool(ready)

        return pressed

    return prompt


def _curves(recorders: list[Recorder], wanted: list[str] | None) -> list[view.Plot]:
    """A curve of each wanted column of each recorder that has it."""
    return [
        view.Plot.of(recorder, column)
        for recorder in recorders
        for column in wanted or []
        if column in recorder.instrument.columns
    ]


def _of(columns: list[str], wanted: list[str] | None) -> list[str]:
    """The columns that are to be drawn. Raises typer.BadParameter for one that is none."""
    for column in wanted or []:
        if column not in columns:
            raise typer.BadParameter(f"--plot is one of {', '.join(columns)}, not {column!r}")
    return wanted or []


def _fail(text: str) -> None:
    typer.echo(text, err=True)
    raise typer.Exit(1)


def stable_name(device: str, folder: Path = _BY_ID) -> str:
    """The name under /dev/serial/by-id that stays the same wherever the board is plugged in; else the device's own."""
    if folder.is_dir():
        for link in sorted(folder.iterdir()):
            if link.resolve() == Path(device).resolve():
                return str(link)
    return device


def who_is_there(port: str, wait_s: float = _WAIT_S) -> str:
    """One sentence about what answers on a port, asked at each baud rate that an instrument has. Nothing is started."""
    heard = b""
    for baud_rate in sorted({instrument.baud_rate for instrument in wire.INSTRUMENTS.values()}, reverse=True):
        transport, intake = SerialTransport(port, baud_rate), Intake()
        try:
            transport.open()
            deadline = time.monotonic() + wait_s
            asked_s = 0.0
            while time.monotonic() < deadline:
                if time.monotonic() - asked_s > 0.5:
                    transport.write(b"\0" + encode(Frame(COMMAND, 0, 0, IDENTIFY.encode())))
                    asked_s = time.monotonic()
                data = transport.read(0.1)
                heard += data
                for kind, _, content in intake.feed(data):
                    if kind == START:
                        known = "" if content.instrument in wire.INSTRUMENTS else " (not known to this version)"
                        return (
                            f"{content.instrument}{known}, firmware {content.firmware}, serial {content.serial_number}"
                        )
        except (PortMissing, PortLost) as error:
            return str(error)
        finally:
            transport.close()
    if not heard:
        return "nothing answers"
    return f"no instrument of ours; heard {len(heard)} bytes, the last of them {heard[-24:]!r}"


def udev_rule(vendor: str, product: str, serial_number: str | None, name: str) -> str:
    """A rule that gives a board the name /dev/NAME wherever it is plugged in."""
    serial = f', ATTRS{{serial}}=="{serial_number}"' if serial_number else ""
    return (
        f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"{serial}, '
        f'SYMLINK+="{name}", GROUP="dialout", MODE="0660"'
    )
