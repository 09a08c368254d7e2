"""What an effect's compiled kernel reads and writes, and how kernels of the catalogue are compiled and called.

A form of an effect states the force and moment that it adds twice: as array code over many instants, which the
analysis fits, and as a plain function of one instant, its kernel, which the simulator calls. A kernel is compiled by
itself when it is first used (0.1 s, then kept on disk next to its file) and called through its address, so that a new
effect needs no change here and no other code to be compiled again. A test holds that both say the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from llvmlite import ir
from numba import cfunc, from_dtype, types
from numba.extending import intrinsic

from rotorid.effects.contract import Form, Kernel, Motion
from rotorid.effects.scale import hover_inflow_m_s, rotor_radius_m
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.mixer import wrench_matrix

MOST_ROTORS = 8
"""Rotors for which the records have room; a vehicle with more flies by array code."""

INSTANT = np.dtype(
    [
        ("time_s", "f8"),
        ("height", "f8"),
        ("rotor_speed_sum", "f8"),
        ("angular_velocity", "f8", 3),
        ("angular_acceleration", "f8", 3),
        ("specific_force", "f8", 3),
        ("air_velocity", "f8", 3),
        ("rotation", "f8", (3, 3)),
        ("rotor_speed", "f8", MOST_ROTORS),
        ("rotor_acceleration", "f8", MOST_ROTORS),
        ("thrust", "f8", MOST_ROTORS),
        ("hub_velocity", "f8", (MOST_ROTORS, 3)),
    ],
    align=True,
)
"""`m` of a kernel: the fields of `Motion` at one instant, `thrust` being C_F ω² of each rotor, N, and `hub_velocity`
each hub's velocity through the air, m/s, body axes."""

_BODY = np.dtype(
    [
        ("rotors", "i8"),
        ("mass", "f8"),
        ("gravity", "f8"),
        ("radius", "f8"),
        ("hover_inflow", "f8"),
        ("reach", "f8"),
        ("inertia", "f8", (3, 3)),
        ("inverse_inertia", "f8", (3, 3)),
        ("hub", "f8", (MOST_ROTORS, 3)),
        ("thrust_coefficient", "f8", MOST_ROTORS),
        ("torque_coefficient", "f8", MOST_ROTORS),
        ("yaw_sign", "f8", MOST_ROTORS),
        ("mixer", "f8", (4, MOST_ROTORS)),
    ],
    align=True,
)
"""`v` of a kernel: a vehicle's constants, SI; `radius` of a rotor, `hover_inflow` of one rotor in hover, m/s, `reach`
the largest distance of a hub from the body's z axis, m."""

ADDED = np.dtype([("force", "f8", 3), ("moment", "f8", 3), ("hub_force", "f8", (MOST_ROTORS, 3))], align=True)
"""`w` of a kernel: force, N, moment about the believed centre of mass, N m, and a force at each hub, N, body axes."""

_STATE = 13 + MOST_ROTORS
SCRATCH = np.dtype(
    [(name, "f8", 6) for name in ("base", "wrench", "own", "first", "at", "now")]
    + [("matrix", "f8", (6, 6)), ("known", "i8"), ("open", "i8")]
    + [("state", "f8", _STATE), ("trial", "f8", _STATE), ("slopes", "f8", (4, _STATE))]
    + [("angle", "f8", 3), ("wanted", "f8", 3), ("memory", "f8", (3, 3)), ("command", "f8", MOST_ROTORS)],
    align=True,
)
"""Room for a vehicle in flight: forces with moments, accelerations (angular, linear) and how far they are solved for;
its state, that at which a step is tried, and the slopes of a step's four stages; its controller. In a record because a
slice of an array costs two atomic counts of references, as long as a kernel."""

_SIGNATURE = types.void(from_dtype(INSTANT), from_dtype(_BODY), types.CPointer(types.float64), from_dtype(ADDED))
_ACCELERATIONS = frozenset({"specific_force", "angular_acceleration", "accelerometer"})


@cache
def compiled(kernel: Kernel):
    """A kernel as a C function; keep it alive as long as its `address` is in use."""
    try:
        return cfunc(_SIGNATURE, cache=True)(kernel)
    except RuntimeError:  # no folder for its cache that may be written
        return cfunc(_SIGNATURE)(kernel)


@intrinsic
def call_kernel(typingctx, address, instant, body, values, offset, added):
    """Call the kernel at `address` (integer) with records and with `values` (array) from `offset` on."""

    def codegen(context, builder, signature, args):
        array = context.make_array(signature.args[3])(context, builder, args[3])
        passed = [args[1], args[2], builder.gep(array.data, [args[4]]), args[5]]
        function = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
        builder.call(builder.inttoptr(args[0], function.as_pointer()), passed)
        return context.get_dummy_value()

    return types.void(types.int64, instant, body, values, types.int64, added), codegen


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


def kernels_of(effects: Sequence[tuple[Form, Sequence[float]]], vehicle: Vehicle) -> Kernels | None:
    """The effects' kernels; None where a form adds a wrench and states no kernel, or the vehicle has too many rotors.

    Forms that act on sensors alone are passed over: they do not move the vehicle.
    """
    if vehicle.rotor_count > MOST_ROTORS:
        return None
    used = []
    for form, values in effects:
        if form.kernel is not None and not form.memory:
            used.append((form, values))
        elif form.memory or _adds_wrench(form, vehicle, np.asarray(values, float)):
            return None
    used.sort(key=lambda pair: _reads_accelerations(pair[0]))
    functions = [compiled(form.kernel) for form, _ in used]
    stated = [kernel_values(form, values) for form, values in used]
    sizes = np.array([len(v) for v in stated], dtype=np.int64)
    return Kernels(
        addresses=np.array([f.address for f in functions], dtype=np.int64),
        explicit=sum(not _reads_accelerations(form) for form, _ in used),
        offsets=np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64) if used else np.zeros(0, np.int64),
        values=np.concatenate([*stated, [0.0]]),
        forms=tuple(form for form, _ in used),
        kept=tuple(functions),
    )


def kernel_values(form: Form, values: Sequence[float]) -> np.ndarray:
    """What a form's kernel takes for the values of the form's parameters."""
    values = np.asarray(values, float)
    return np.asarray(values if form.kernel_values is None else form.kernel_values(values), float)


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


def body_of(vehicle: Vehicle) -> np.ndarray:
    """The constants of a vehicle, (1,) of BODY."""
    k = vehicle.rotor_count
    body = np.zeros(1, _BODY)
    one = body[0]
    one["rotors"], one["mass"], one["gravity"] = k, vehicle.mass_kg, vehicle.gravity_m_s2
    one["radius"], one["hover_inflow"] = rotor_radius_m(vehicle), hover_inflow_m_s(vehicle)
    hubs = vehicle.rotor_positions_m()
    one["reach"] = np.linalg.norm(hubs[:, :2], axis=1).max() or 1.0
    one["inertia"] = vehicle.inertia_kg_m2.matrix()
    one["inverse_inertia"] = np.linalg.inv(one["inertia"])
    one["hub"][:k] = hubs
    one["thrust_coefficient"][:k] = vehicle.thrust_coefficients_n_s2()
    one["torque_coefficient"][:k] = vehicle.torque_coefficients_n_m_s2()
    one["yaw_sign"][:k] = vehicle.yaw_signs()
    one["mixer"][:, :k] = wrench_matrix(vehicle)
    return body
