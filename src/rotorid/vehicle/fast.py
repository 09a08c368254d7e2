"""Compiled flights called from Python: arrays in, arrays out, vehicles spread over threads."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import cfunc, from_dtype, types

from rotorid.effects.contract import LACK, Form, Motion
from rotorid.effects.instant import Kernel, Wrench, records, room_for
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle import compiled
from rotorid.vehicle.attitude import euler_from_quaternion

_LEAST_PER_THREAD = 16
"""Vehicles below which a further thread is not worth its start."""
_BLOCK = 8
"""Vehicles that fly together; their records fill half of a processor's first cache."""
_ALWAYS_KNOWN = {"rotor_speed", "angular_velocity", "angular_acceleration", "specific_force"}
_ALWAYS_KNOWN |= {"accelerometer", "gyroscope"}  # A simulated vehicle carries sensors that read the truth.


def check_effects(effects: Sequence[tuple[Form, Sequence[float]]], known: set[str]) -> None:
    """InputError where a form needs a field of `Motion` that is neither in `known` nor always known."""
    for form, _ in effects:
        if lacking := [name for name in form.requires if name not in known | _ALWAYS_KNOWN]:
            reason = LACK.get(lacking[0], f"no {lacking[0]}")
            raise InputError(f"effect form {form.name!r} cannot be simulated: {reason}")


_ACCELERATIONS = frozenset({"specific_force", "angular_acceleration", "accelerometer"})


@cache
def _machine_code(kernel: Kernel, room: int):
    """A kernel as a C function of records with room for so many rotors.

    It is compiled by itself (0.1 s, then kept on disk next to its file) and called through its `address`, so that a new
    effect needs no other code to be compiled again; keep it alive as long as that is in use.
    """
    m, v, w = (from_dtype(record) for record in records(room))
    signature = types.void(m, v, types.CPointer(types.float64), w)
    try:
        return cfunc(signature, cache=True)(kernel)
    except RuntimeError:  # no folder for its cache that may be written
        return cfunc(signature)(kernel)


@dataclass(frozen=True)
class Kernels:
    """Effects ready to be called: first those that do not read the accelerations that they change."""

    addresses: np.ndarray
    """(e,) of the compiled kernels."""
    explicit: int
    """How many of them read no acceleration."""
    offsets: np.ndarray
    """(e,) place of each one's first value."""
    values: np.ndarray
    """(p,) values of all kernels in a row."""
    forms: tuple[Form, ...]
    kept: tuple = ()
    """The compiled functions, so that they live as long as their addresses."""


def kernels_of(effects: Sequence[tuple[Form, Sequence[float]]], vehicle: Vehicle) -> Kernels:
    """The effects' kernels; forms that act on sensors alone are passed over: they do not move the vehicle.

    InputError where a form adds a wrench and has no kernel.
    """
    used = []
    for form, values in effects:
        if isinstance(form.contribution, Wrench):
            used.append((form, values))
        elif form.memory:
            raise InputError(
                f"vehicle {vehicle.name}: effect form {form.name!r} has a memory of its own; "
                "simulate it one by one (rotorid.vehicle.improved.simulate_as_stated)"
            )
        elif _adds_wrench(form, vehicle, np.asarray(values, float)):
            raise InputError(f"effect form {form.name!r} does not fly: it states no kernel (rotorid.effects.instant)")
    used.sort(key=lambda pair: _reads_accelerations(pair[0]))
    functions = [_machine_code(form.contribution.kernel, room_for(vehicle.rotor_count)) for form, _ in used]
    stated = [form.contribution.values_of(values) for form, values in used]
    sizes = np.array([len(v) for v in stated], dtype=np.int64)
    return Kernels(
        addresses=np.array([f.address for f in functions], dtype=np.int64),
        explicit=sum(not _reads_accelerations(form) for form, _ in used),
        offsets=np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64) if used else np.zeros(0, np.int64),
        values=np.concatenate([*stated, [0.0]]),
        forms=tuple(form for form, _ in used),
        kept=tuple(functions),
    )


def _reads_accelerations(form: Form) -> bool:
    """Whether a form depends on the accelerations that it changes."""
    return bool(_ACCELERATIONS & set(form.requires))


def _adds_wrench(form: Form, vehicle: Vehicle, values: np.ndarray) -> bool:
    """Whether a form adds a force or a moment anywhere."""
    n, k = 2, vehicle.rotor_count
    vectors = np.ones((n, 3))
    motion = Motion(
        time_s=np.array([0.0, 0.01]),
        rotor_speed=np.full((n, k), 100.0),
        rotor_acceleration=np.zeros((n, k)),
        angular_velocity=vectors,
        angular_acceleration=vectors,
        specific_force=vectors,
        accelerometer=vectors,
        gyroscope=vectors,
        rotation=np.broadcast_to(np.eye(3), (n, 3, 3)),
        velocity=vectors,
        position=vectors,
        height=np.ones(n),
        voltage=np.ones(n),
    )
    added = form.contribution(motion, vehicle, values)
    return added.force is not None or added.moment is not None


@cache
def _loop_record(room: int) -> np.dtype:
    """The attitude controller's constants, SI; `allocation` gives squared rotor speeds of thrust and moments."""
    fields = [(name, "f8", 3) for name in ("proportional", "integral", "derivative", "limit")]
    fields += [(name, "f8") for name in ("derivative_time", "lowest", "highest")]
    return np.dtype([*fields, ("allocation", "f8", (room, 4))], align=True)


@dataclass(frozen=True)
class AttitudeLoop:
    """An attitude controller laid out for a whole flight, so that it can fly compiled
    (`rotorid.vehicle.control`)."""

    proportional: np.ndarray
    """(3,) or (n, 3), N m/rad, likewise the integral and derivative gains."""
    integral: np.ndarray
    derivative: np.ndarray
    allocation: np.ndarray
    """(k, 4), squared rotor speeds of thrust and moments."""
    reference: np.ndarray
    """(steps + 1, 4), or (n, steps + 1, 4) of n vehicles: roll, pitch, yaw, rad, and thrust, N."""
    derivative_time_s: float = 0.0
    limit_n_m: np.ndarray | None = None
    """(3,), largest moments."""
    more: np.ndarray | None = None
    """(steps + 1, k), added to the squared speeds, rad²/s²."""
    limits_rad_s: tuple[float, float] = (0.0, np.inf)

    def laid_out(self) -> dict[str, np.ndarray]:
        """As records `loops` (1 or n,), `references` (1 or n, steps + 1, 4) and `more` (steps + 1 or 0, k)."""
        gains = [np.atleast_2d(np.asarray(g, float)) for g in (self.proportional, self.integral, self.derivative)]
        loops = np.zeros(max(len(g) for g in gains), _loop_record(room_for(len(self.allocation))))
        loops["proportional"], loops["integral"], loops["derivative"] = gains
        loops["limit"] = np.inf if self.limit_n_m is None else self.limit_n_m
        loops["derivative_time"] = self.derivative_time_s
        loops["lowest"], loops["highest"] = self.limits_rad_s
        loops["allocation"][:, : len(self.allocation)] = self.allocation
        references = np.ascontiguousarray(self.reference, float)
        return dict(
            loops=loops,
            references=references[None] if references.ndim == 2 else references,
            more=np.zeros((0, len(self.allocation))) if self.more is None else np.ascontiguousarray(self.more, float),
        )


def commanding(loop: AttitudeLoop, size: int, step_s: float) -> Callable[[int, np.ndarray, np.ndarray], np.ndarray]:
    """What gives the commands (n, k), rad/s, of n vehicles with a controller, for flights that go a step at a time.

    To be called with the number of each instant, in order, the states (n, 13 + k), and the errors of the attitude that
    is read, (n, 3), rad.
    """
    k, given = len(loop.allocation), loop.laid_out()
    scratch = np.zeros(size, compiled.scratch_record(room_for(k)))

    def command(j: int, states: np.ndarray, attitude_errors: np.ndarray) -> np.ndarray:
        read = np.ascontiguousarray(states), np.ascontiguousarray(attitude_errors)[:, None]
        compiled.command(scratch, *read, j, step_s, given["loops"], k, given["references"], given["more"])
        return scratch["command"][:, :k].copy()

    return command


@dataclass(frozen=True)
class Trace:
    """What n vehicles did at the m instants kept, (n, m, ...), SI units, the truth without noise.

    Accelerations and moments are those at each instant under the rotor speeds of that instant.
    """

    time_s: np.ndarray
    """(m,)."""
    states: np.ndarray
    """(n, m, 13 + k): rates, quaternion, velocity (world), position, rotor speeds."""
    accelerations: np.ndarray
    """(n, m, 6): angular acceleration, rad/s², and specific force, m/s², body axes."""
    rotor_command: np.ndarray
    """(n, m, k), rad/s."""

    @property
    def angular_velocity(self) -> np.ndarray:
        """(n, m, 3), rad/s, body axes."""
        return self.states[..., 0:3]

    @property
    def quaternion(self) -> np.ndarray:
        """(n, m, 4), scalar first, body to world."""
        return self.states[..., 3:7]

    @property
    def euler_rad(self) -> np.ndarray:
        """Roll, pitch, yaw, (n, m, 3), rad; yaw unwound."""
        euler = euler_from_quaternion(self.quaternion)
        euler[..., 2] = np.unwrap(euler[..., 2], axis=1)
        return euler

    @property
    def velocity(self) -> np.ndarray:
        """(n, m, 3), m/s, world axes."""
        return self.states[..., 7:10]

    @property
    def position(self) -> np.ndarray:
        """(n, m, 3), m, world axes."""
        return self.states[..., 10:13]

    @property
    def rotor_speed(self) -> np.ndarray:
        """(n, m, k), rad/s."""
        return self.states[..., 13:]

    @property
    def angular_acceleration(self) -> np.ndarray:
        """(n, m, 3), rad/s², body axes."""
        return self.accelerations[..., :3]

    @property
    def specific_force(self) -> np.ndarray:
        """(n, m, 3), m/s², body axes."""
        return self.accelerations[..., 3:]

    @property
    def end(self) -> np.ndarray:
        """States at the last instant kept, (n, 13 + k): the start of what follows."""
        return self.states[:, -1].copy()


def fly(
    body: np.ndarray,
    kernels: Kernels,
    start: np.ndarray,
    steps: int,
    step_s: float,
    commands: np.ndarray | AttitudeLoop,
    *,
    values: np.ndarray | None = None,
    lags_s: np.ndarray | tuple[float, float] = (0.0, 0.0),
    limits_rad_s: tuple[float, float] | None = None,
    following: np.ndarray | None = None,
    reading_errors: np.ndarray | None = None,
    pushes: np.ndarray | None = None,
    wind_m_s: np.ndarray | None = None,
    ground_z_m: float | None = None,
    first_s: float = 0.0,
    every: int = 1,
    threads: int | None = None,
) -> Trace:
    """Fly n vehicles with constants `body` (1 or n,) from `start` (n, 13 + k) over `steps` steps.

    `commands` are rotor speeds (steps + 1, k) for all or (n, steps + 1, k), or a controller; `values` (n, p) are the
    kernels' values where they differ between vehicles; `lags_s` time constants up and down, (2,) or (n, 2), 0 follows
    at once; `following`, shaped as they, what effects are given of the rotors' acceleration then. `reading_errors`
    (n, steps + 1, 3), rad, are added to the attitude read by the controller, `pushes` (n, steps + 1, 6) to force and
    moment. `wind_m_s` is (3,) or (n, 3), world axes. `first_s` is the time of the first instant, s.
    """
    start = np.ascontiguousarray(start, float)
    n, k = start.shape[0], start.shape[1] - 13
    body = np.repeat(body, n) if len(body) == 1 < n else body
    lags = np.broadcast_to(np.asarray(lags_s, float), (n, 2))
    lags = np.divide(1.0, lags, out=np.zeros((n, 2)), where=lags > 0)
    limits = np.broadcast_to(np.array([-np.inf, np.inf] if limits_rad_s is None else limits_rad_s), (n, 2))
    closed = isinstance(commands, AttitudeLoop)
    series = np.zeros((1, 1, k))
    if closed:
        plan = commands.laid_out()
    else:
        plan = dict(loops=np.zeros(1, _loop_record(room_for(k))), references=np.zeros((1, 1, 4)), more=np.zeros((0, k)))
        series = np.ascontiguousarray(commands, float)
        series = series[None] if series.ndim == 2 else series
    fixed_times = np.zeros((0, 1, k)) if following is None else np.ascontiguousarray(following, float)
    wind = np.zeros(3) if wind_m_s is None else wind_m_s
    fixed = dict(
        first_s=first_s,
        steps=steps,
        step_s=step_s,
        every=every,
        closed=closed,
        more=plan["more"],
        addresses=kernels.addresses,
        explicit=kernels.explicit,
        offsets=kernels.offsets,
    )
    kept = steps // every + 1
    own = dict(
        body=body,
        start=start,
        lags=lags,
        limits=np.ascontiguousarray(limits),
        commands=series,
        following=fixed_times[None] if fixed_times.ndim == 2 else fixed_times,
        loops=plan["loops"],
        references=plan["references"],
        reading_errors=np.zeros((1, 1, 3)) if reading_errors is None else np.ascontiguousarray(reading_errors),
        pushes=np.zeros((1, 1, 6)) if pushes is None else np.ascontiguousarray(pushes),
        winds=np.atleast_2d(np.ascontiguousarray(wind, float))[:, None],
        ground_z=np.full(n, np.nan if ground_z_m is None else ground_z_m),
        values=np.atleast_2d(kernels.values if values is None else values).astype(float, order="C", copy=False),
        states=np.empty((n, kept, 13 + k)),
        accelerations_out=np.empty((n, kept, 6)),
        commands_out=np.empty((n, kept, k)),
    )

    def part(first: int, last: int) -> None:
        mine = own if last - first == n else {key: a[first:last] if len(a) == n else a for key, a in own.items()}
        stride = mine["values"].shape[1] if len(mine["values"]) > 1 else 0
        given = fixed | mine | _block(last - first, k) | dict(values=mine["values"].ravel(), stride=stride)
        compiled.fly(*(given[name] for name in _ORDER))

    _spread(part, n, threads)
    time_s = first_s + step_s * every * np.arange(kept)
    return Trace(time_s, own["states"], own["accelerations_out"], own["commands_out"])


_ORDER = compiled.fly.py_func.__code__.co_varnames[: compiled.fly.py_func.__code__.co_argcount]


def fly_windows(
    body: np.ndarray, kernels: Kernels, start: np.ndarray, time_s: np.ndarray, *driven: np.ndarray
) -> np.ndarray:
    """States (w, m, 3, 7 or 13) of w windows; arguments as of `rotorid.vehicle.compiled.fly_windows`."""
    start, time_s = np.ascontiguousarray(start, float), np.ascontiguousarray(time_s, float)
    driven = tuple(np.ascontiguousarray(a, float) for a in driven)
    out = np.empty((*time_s.shape, start.shape[1]))
    if not len(start):
        return out

    called = kernels.addresses, kernels.explicit, kernels.offsets, kernels.values
    block = _block(len(start), int(body["rotors"][0]))
    compiled.fly_windows(body, start, time_s, *driven, *called, *block.values(), out)
    return out


def _block(vehicles: int, rotors: int) -> dict[str, np.ndarray]:
    """Records of a block."""
    count, room = min(_BLOCK, vehicles), room_for(rotors)
    m, _, w = records(room)
    instant = np.zeros(count, m)
    instant["on_board"] = 1.0
    return dict(instant=instant, added=np.zeros(count, w), scratch=np.zeros(count, compiled.scratch_record(room)))


def _spread(part, n: int, threads: int | None) -> None:
    """Call `part(first, last)` on shares of n vehicles, in as many threads as pay."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    count = min(cores if threads is None else threads, max(n // _LEAST_PER_THREAD, 1))
    if count == 1:
        part(0, n)
        return
    edges = np.linspace(0, n, count + 1).astype(int)
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(part, edges[:-1], edges[1:]))
