"""Compiled equations of motion: flights and restart windows of vehicles with effects, motors and a controller.

Newton-Euler equations of a rigid body, thesis eqs 4.1-4.4, by quaternion, stepped by the classical Runge-Kutta method.
Some effects depend on the accelerations that they change (added mass, products of inertia): these are solved for. A
test compares them with flights that scipy integrates.

Vehicles fly in blocks, as many at a time as there are records of an instant: each kernel is called for all of a block
before the next kernel, which halves its cost, as the processor then works on several vehicles at once and guesses right
where a call goes. What a vehicle does hangs on nothing of its block.

A state is rates 0:3, quaternion 3:7, velocity (world) 7:10, position 10:13, rotor speeds 13:, SI.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from rotorid.effects.contract import compiled


@cache
def scratch_record(room: int) -> np.dtype:
    """Room for a vehicle in flight with so many rotors.

    Forces with moments, accelerations (angular, linear) and how far they are solved for; its state, that at which a
    step is tried, and the slopes of a step's four stages; its controller. In a record because a slice of an array costs
    two atomic counts of references, as long as a kernel.
    """
    return np.dtype(
        [(name, "f8", 6) for name in ("base", "wrench", "own", "first", "at", "now")]
        + [("matrix", "f8", (6, 6)), ("known", "i8"), ("open", "i8")]
        + [("state", "f8", 13 + room), ("trial", "f8", 13 + room), ("slopes", "f8", (4, 13 + room))]
        + [("angle", "f8", 3), ("wanted", "f8", 3), ("memory", "f8", (3, 3)), ("command", "f8", room)],
        align=True,
    )


_MOST_ROUNDS = 30
_CONVERGED = 1e-10
"""Change of the accelerations, relative to their largest, at which they are taken as solved for."""
_UNKNOWN, _FOUND, _EXACT = 0, 1, 2
"""What is known of how accelerations answer to themselves: nothing yet, the matrix of the flight, and that its step was
exact at this step's beginning, so that one is enough at the step's other stages."""


@intrinsic
def _call_kernel(typingctx, address, instant, body, values, offset, added):
    """Call the kernel at `address` (integer) with records and with `values` (array) from `offset` on."""

    def codegen(context, builder, signature, args):
        array = context.make_array(signature.args[3])(context, builder, args[3])
        passed = [args[1], args[2], builder.gep(array.data, [args[4]]), args[5]]
        function = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
        builder.call(builder.inttoptr(args[0], function.as_pointer()), passed)
        return context.get_dummy_value()

    return types.void(types.int64, instant, body, values, types.int64, added), codegen


@compiled(error_model="numpy")
def _clear(v, w):
    for j in range(3):
        w.force[j] = 0.0
        w.moment[j] = 0.0
    for i in range(v.rotors):
        for j in range(3):
            w.hub_force[i, j] = 0.0


@compiled(error_model="numpy")
def _collect(v, w, wrench):
    """Add what the kernels left in `w` to a force and moment (6,) of the scratch record."""
    for j in range(3):
        wrench[j] += w.force[j]
        wrench[3 + j] += w.moment[j]
    for i in range(v.rotors):
        fx, fy, fz = w.hub_force[i, 0], w.hub_force[i, 1], w.hub_force[i, 2]
        x, y, z = v.hub[i, 0], v.hub[i, 1], v.hub[i, 2]
        wrench[0] += fx
        wrench[1] += fy
        wrench[2] += fz
        wrench[3] += y * fz - z * fy
        wrench[4] += z * fx - x * fz
        wrench[5] += x * fy - y * fx


@compiled(error_model="numpy")
def _solved(m, v, own, wrench):
    """Accelerations `own` (6,), angular then linear, under a force and moment (6,)."""
    p, q, r = m.angular_velocity[0], m.angular_velocity[1], m.angular_velocity[2]
    hx = v.inertia[0, 0] * p + v.inertia[0, 1] * q + v.inertia[0, 2] * r
    hy = v.inertia[1, 0] * p + v.inertia[1, 1] * q + v.inertia[1, 2] * r
    hz = v.inertia[2, 0] * p + v.inertia[2, 1] * q + v.inertia[2, 2] * r
    mx = wrench[3] - (q * hz - r * hy)
    my = wrench[4] - (r * hx - p * hz)
    mz = wrench[5] - (p * hy - q * hx)
    for j in range(3):
        own[j] = v.inverse_inertia[j, 0] * mx + v.inverse_inertia[j, 1] * my + v.inverse_inertia[j, 2] * mz
        own[3 + j] = wrench[j] / v.mass


@compiled(error_model="numpy")
def _hand_over(m, v, w, x):
    """Give the effects that read accelerations those of `x.at`; what they add is to be collected from nothing."""
    for j in range(3):
        m.angular_acceleration[j] = x.at[j]
        m.specific_force[j] = x.at[3 + j]
    _clear(v, w)


@compiled(error_model="numpy")
def _follow(m, v, w, x):
    """Accelerations `x.own` that follow from what the effects did with those of `x.at`."""
    for j in range(6):
        x.wrench[j] = x.base[j]
    _collect(v, w, x.wrench)
    _solved(m, v, x.own, x.wrench)


@compiled(error_model="numpy")
def _implicit(m, v, w, x, addresses, explicit, offsets, values, shift):
    """Accelerations `x.own` that follow where the effects that read accelerations are given `x.at`."""
    _hand_over(m, v, w, x)
    for e in range(explicit, addresses.shape[0]):
        _call_kernel(addresses[e], m, v, values, offsets[e] + shift, w)
    _follow(m, v, w, x)


@compiled(error_model="numpy")
def _invert(matrix):
    """Put a small matrix's inverse in its place, by Gauss and Jordan with pivots from the column.

    numpy's own takes ten seconds to compile in, most of the time that all of this module takes.
    """
    size = matrix.shape[0]
    order = np.arange(size)
    for j in range(size):
        best = j
        for i in range(j + 1, size):
            if abs(matrix[i, j]) > abs(matrix[best, j]):
                best = i
        if best != j:
            for i in range(size):
                matrix[j, i], matrix[best, i] = matrix[best, i], matrix[j, i]
            order[j], order[best] = order[best], order[j]
        pivot = matrix[j, j]
        matrix[j, j] = 1.0
        for i in range(size):
            matrix[j, i] /= pivot
        for row in range(size):
            if row != j:
                factor = matrix[row, j]
                matrix[row, j] = 0.0
                for i in range(size):
                    matrix[row, i] -= factor * matrix[j, i]
    # Rows were exchanged on the way: columns of the inverse are.
    copy = matrix.copy()
    for j in range(size):
        for i in range(size):
            matrix[i, order[j]] = copy[i, j]


@compiled(error_model="numpy")
def _relaxation(m, v, w, x, addresses, explicit, offsets, values, shift):
    """(I − A)⁻¹ of how the accelerations answer to themselves, A: added mass and inertia, constant in a flight."""
    for j in range(6):
        x.at[j] = 0.0
    _implicit(m, v, w, x, addresses, explicit, offsets, values, shift)
    for j in range(6):
        x.first[j] = x.own[j]
    for j in range(6):
        x.at[j] = 1.0
        _implicit(m, v, w, x, addresses, explicit, offsets, values, shift)
        x.at[j] = 0.0
        for i in range(6):
            x.matrix[i, j] = (1.0 if i == j else 0.0) - (x.own[i] - x.first[i])
    _invert(x.matrix)


@compiled(error_model="numpy")
def _base(m, v, x, pushes, p, j):
    """Force and moment `x.base` of the rotors and of a push `pushes[p, j]` (6,)."""
    for i in range(6):
        x.base[i] = pushes[p, j, i]
    for i in range(v.rotors):
        square = m.rotor_speed[i] * m.rotor_speed[i]
        x.base[2] -= v.mixer[0, i] * square
        x.base[3] += v.mixer[1, i] * square
        x.base[4] += v.mixer[2, i] * square
        x.base[5] += v.mixer[3, i] * square


@compiled(error_model="numpy")
def _stepped(x):
    """Step to better accelerations `x.now`, exact where effects are linear in them; whether those given were right."""
    turning = linear = 0.0
    most_turning = most_linear = 1.0
    for i in range(3):
        turning = max(turning, abs(x.own[i] - x.at[i]))
        linear = max(linear, abs(x.own[3 + i] - x.at[3 + i]))
        most_turning = max(most_turning, abs(x.own[i]))
        most_linear = max(most_linear, abs(x.own[3 + i]))
    for i in range(6):
        change = 0.0
        for k in range(6):
            change += x.matrix[i, k] * (x.own[k] - x.at[k])
        x.now[i] = x.at[i] + change
    return turning <= _CONVERGED * most_turning and linear <= _CONVERGED * most_linear


@compiled(error_model="numpy")
def _accelerate(count, first, alone, instant, body, added, scratch, addresses, explicit, offsets, values, stride):
    """Accelerations `now` of each scratch record, angular then specific force, from its `base` and the effects.

    Vehicle `first + c` is row c of a block of `count`; its constants are `body` at that number times `alone` (0 or 1),
    its values begin at that number times `stride`. What reads the accelerations that it changes is solved for from the
    last ones; a record's `known` is UNKNOWN, FOUND or EXACT and becomes one of the latter two.
    """
    effects = addresses.shape[0]
    if explicit > 0:
        for c in range(count):
            _clear(body[(first + c) * alone], added[c])
        for e in range(explicit):
            for c in range(count):
                n = first + c
                _call_kernel(addresses[e], instant[c], body[n * alone], values, offsets[e] + n * stride, added[c])
        for c in range(count):
            _collect(body[(first + c) * alone], added[c], scratch[c].base)
    if explicit == effects:
        for c in range(count):
            _solved(instant[c], body[(first + c) * alone], scratch[c].now, scratch[c].base)
        return
    for c in range(count):
        x = scratch[c]
        x.open = 1
        if x.known == _UNKNOWN:
            v = body[(first + c) * alone]
            _relaxation(instant[c], v, added[c], x, addresses, explicit, offsets, values, (first + c) * stride)
            x.known = _FOUND
    for rounds in range(_MOST_ROUNDS):
        for c in range(count):
            x = scratch[c]
            if x.open:
                for i in range(6):
                    x.at[i] = x.now[i]
                _hand_over(instant[c], body[(first + c) * alone], added[c], x)
        for e in range(explicit, effects):
            for c in range(count):
                n = first + c
                if scratch[c].open:
                    _call_kernel(addresses[e], instant[c], body[n * alone], values, offsets[e] + n * stride, added[c])
        left = 0
        for c in range(count):
            x = scratch[c]
            if x.open:
                _follow(instant[c], body[(first + c) * alone], added[c], x)
                settled = _stepped(x)
                if x.known == _EXACT or settled:
                    x.open = 0
                    if rounds < 2:
                        x.known = _EXACT
                else:
                    left += 1
        if left == 0:
            return


@compiled(error_model="numpy")
def _enter(m, v, x, size, effects, winds, row, column, height_offset):
    """Fill an instant from the state tried, in the wind `winds[row, column]`; what rotors do is in it already."""
    p, q, r = x.trial[0], x.trial[1], x.trial[2]
    m.angular_velocity[0] = p
    m.angular_velocity[1] = q
    m.angular_velocity[2] = r
    if size > 3:
        w, i, j, k = x.trial[3], x.trial[4], x.trial[5], x.trial[6]
        m.rotation[0, 0] = 1.0 - 2.0 * (j * j + k * k)
        m.rotation[0, 1] = 2.0 * (i * j - w * k)
        m.rotation[0, 2] = 2.0 * (i * k + w * j)
        m.rotation[1, 0] = 2.0 * (i * j + w * k)
        m.rotation[1, 1] = 1.0 - 2.0 * (i * i + k * k)
        m.rotation[1, 2] = 2.0 * (j * k - w * i)
        m.rotation[2, 0] = 2.0 * (i * k - w * j)
        m.rotation[2, 1] = 2.0 * (j * k + w * i)
        m.rotation[2, 2] = 1.0 - 2.0 * (i * i + j * j)
    if not effects:
        return
    if size > 10:
        north = x.trial[7] - winds[row, column, 0]
        east = x.trial[8] - winds[row, column, 1]
        down = x.trial[9] - winds[row, column, 2]
        for j in range(3):
            m.air_velocity[j] = m.rotation[0, j] * north + m.rotation[1, j] * east + m.rotation[2, j] * down
        m.height = height_offset - x.trial[12]
    a, b, c = m.air_velocity[0], m.air_velocity[1], m.air_velocity[2]
    total = 0.0
    for i in range(v.rotors):
        x_m, y_m, z_m = v.hub[i, 0], v.hub[i, 1], v.hub[i, 2]
        m.hub_velocity[i, 0] = a + q * z_m - r * y_m
        m.hub_velocity[i, 1] = b + r * x_m - p * z_m
        m.hub_velocity[i, 2] = c + p * y_m - q * x_m
        m.thrust[i] = v.thrust_coefficient[i] * m.rotor_speed[i] * m.rotor_speed[i]
        total += m.rotor_speed[i]
    m.rotor_speed_sum = total


@compiled(error_model="numpy")
def _rates_of_change(m, v, x, size, stage):
    """Time derivative of the rigid body's state that was tried, as the slope of a stage."""
    p, q, r = x.trial[0], x.trial[1], x.trial[2]
    for j in range(3):
        x.slopes[stage, j] = x.now[j]
    if size < 7:
        return
    w, i, j, k = x.trial[3], x.trial[4], x.trial[5], x.trial[6]
    x.slopes[stage, 3] = -0.5 * (i * p + j * q + k * r)
    x.slopes[stage, 4] = 0.5 * (w * p + j * r - k * q)
    x.slopes[stage, 5] = 0.5 * (w * q + k * p - i * r)
    x.slopes[stage, 6] = 0.5 * (w * r + i * q - j * p)
    if size < 13:
        return
    a, b, c = x.now[3], x.now[4], x.now[5]
    for j in range(3):
        x.slopes[stage, 7 + j] = m.rotation[j, 0] * a + m.rotation[j, 1] * b + m.rotation[j, 2] * c
        x.slopes[stage, 10 + j] = x.trial[7 + j]
    x.slopes[stage, 9] += v.gravity


@compiled(error_model="numpy")
def _begin(x, start, n, size):
    """Put a vehicle at its start, nothing known of it."""
    for i in range(size):
        x.state[i] = start[n, i]
    for i in range(6):
        x.now[i] = 0.0
    x.known = _UNKNOWN
    for i in range(3):
        for j in range(3):
            x.memory[i, j] = 0.0


@compiled(error_model="numpy")
def _try(x, size, stage, step_s):
    """The state at which a stage of Runge and Kutta's step is evaluated."""
    if stage == 0:
        x.known = min(x.known, _FOUND)
        for i in range(size):
            x.trial[i] = x.state[i]
        return
    ahead = step_s if stage == 3 else 0.5 * step_s
    for i in range(size):
        x.trial[i] = x.state[i] + ahead * x.slopes[stage - 1, i]


@compiled(error_model="numpy")
def _advance(x, size, step_s):
    """Go one step on by the slopes of its four stages; the quaternion stays of length 1."""
    sixth = step_s / 6.0
    for i in range(size):
        x.state[i] += sixth * (x.slopes[0, i] + 2.0 * (x.slopes[1, i] + x.slopes[2, i]) + x.slopes[3, i])
    if size > 3:
        w, i, j, k = x.state[3], x.state[4], x.state[5], x.state[6]
        length = np.sqrt(w * w + i * i + j * j + k * k)
        for n in range(3, 7):
            x.state[n] /= length


@compiled(error_model="numpy")
def _read_attitude(x, j, reading_errors, e):
    """Roll, pitch and yaw `x.angle` as they are read at instant `j`; `reading_errors[e]` of one row hold for all."""
    read = j if reading_errors.shape[1] > 1 else 0
    a, b, c, d = x.state[3], x.state[4], x.state[5], x.state[6]
    x.angle[0] = np.arctan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c)) + reading_errors[e, read, 0]
    x.angle[1] = np.arcsin(min(max(2.0 * (a * c - b * d), -1.0), 1.0)) + reading_errors[e, read, 1]
    x.angle[2] = np.arctan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d)) + reading_errors[e, read, 2]


@compiled(error_model="numpy")
def _attitude_command(x, j, elapsed, loop, rotors, references, f, more):
    """Rotor commands `x.command` of the attitude controller at instant `j`, `elapsed` s after the last (thesis 4.29).

    It reads `x.angle`; `x.memory` (3, 3) is integral, last error, slope. `references[f]` of one row hold for all
    instants.
    """
    now = j if references.shape[1] > 1 else 0
    keep = np.exp(-elapsed / loop.derivative_time) if loop.derivative_time > 0.0 else 0.0
    for i in range(3):
        error = references[f, now, i] - x.angle[i]
        error = (error + np.pi) % (2.0 * np.pi) - np.pi
        if j == 0:
            x.wanted[i] = loop.proportional[i] * error
        else:
            raw = (error - x.memory[1, i]) / elapsed
            x.memory[2, i] = keep * x.memory[2, i] + (1.0 - keep) * raw
            integral = x.memory[0, i] + error * elapsed
            wanted = loop.proportional[i] * error + loop.integral[i] * integral + loop.derivative[i] * x.memory[2, i]
            held = min(max(wanted, -loop.limit[i]), loop.limit[i])
            if not (held != wanted and np.sign(error) == np.sign(wanted)):
                x.memory[0, i] = integral
            x.wanted[i] = held
        x.memory[1, i] = error
    for n in range(rotors):
        square = loop.allocation[n, 0] * references[f, now, 3]
        for i in range(3):
            square += loop.allocation[n, 1 + i] * x.wanted[i]
        square = max(square, 0.0)
        if more.shape[0] > 0:
            square = max(square + more[j, n], 0.0)
        x.command[n] = min(max(np.sqrt(square), loop.lowest), loop.highest)


@compiled(error_model="numpy")
def command(scratch, states, reading_errors, j, elapsed, loops, rotors, references, more):
    """The same for each of n scratch records at states (n, 13 + k), read with errors (n, 1, 3), rad.

    `loops` and `references` of one row hold for all of them.
    """
    for n in range(scratch.shape[0]):
        loop, f, x = loops[n if loops.shape[0] > 1 else 0], n if references.shape[0] > 1 else 0, scratch[n]
        for i in range(3, 7):
            x.state[i] = states[n, i]
        _read_attitude(x, j, reading_errors, n)
        _attitude_command(x, j, elapsed, loop, rotors, references, f, more)


@compiled(error_model="numpy", nogil=True)
def fly(
    body,
    start,
    first_s,
    steps,
    step_s,
    every,
    lags,
    limits,
    closed,
    commands,
    following,
    loops,
    references,
    more,
    reading_errors,
    pushes,
    winds,
    ground_z,
    addresses,
    explicit,
    offsets,
    values,
    stride,
    instant,
    added,
    scratch,
    states,
    accelerations_out,
    commands_out,
):
    """Fly n vehicles from `first_s` over `steps` steps of `step_s`; arrays with a first axis of 1 hold for all of them.

    `body` (n,); `start` (n, 13 + k); `lags` (n, 2) 1/s up and down, 0 follows at once; `limits` (n, 2) rad/s;
    `closed` whether `loops` command by `references` (., steps + 1, 4: angles, thrust) and `more` (squares),
    else `commands` (., steps + 1, k) with their accelerations `following` (0 for none); `reading_errors`
    (., steps + 1, 3) rad; `pushes` (., steps + 1, 6); `winds` (., 1, 3); `ground_z` (n,); `values` (n p,) those of a
    vehicle beginning `stride` after the last one's (0: all have the same). Each `every`-th instant is kept in `states`,
    `accelerations_out` (angular, specific force) and `commands_out`. Vehicles fly in blocks of as many as there are
    records `instant`, `added` and `scratch`.
    """
    size = start.shape[1]
    k = size - 13
    most = instant.shape[0]
    effects = addresses.shape[0] > 0
    for first in range(0, start.shape[0], most):
        count = min(most, start.shape[0] - first)
        for c in range(count):
            _begin(scratch[c], start, first + c, size)
        kept = 0
        for j in range(steps + 1):
            now_s = first_s + j * step_s
            for c in range(count):
                n, m, x = first + c, instant[c], scratch[c]
                if closed:
                    loop = loops[n if loops.shape[0] > 1 else 0]
                    f, e = n if references.shape[0] > 1 else 0, n if reading_errors.shape[0] > 1 else 0
                    _read_attitude(x, j, reading_errors, e)
                    _attitude_command(x, j, step_s, loop, k, references, f, more)
                else:
                    own = n if commands.shape[0] > 1 else 0
                    for i in range(k):
                        x.command[i] = commands[own, j, i]
                f = n if following.shape[0] > 1 else 0
                for i in range(k):
                    x.command[i] = min(max(x.command[i], limits[n, 0]), limits[n, 1])
                    if lags[n, 0] == 0.0:
                        if j > 0:
                            x.state[13 + i] = x.command[i]
                        m.rotor_acceleration[i] = following[f, j, i] if following.shape[0] > 0 else 0.0
            for stage in range(4):
                share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                for c in range(count):
                    n, m, x = first + c, instant[c], scratch[c]
                    v = body[n]
                    m.time_s = now_s + share * step_s
                    _try(x, size, stage, step_s)
                    up, down = lags[n, 0], lags[n, 1]
                    for i in range(k):
                        speed = x.trial[13 + i]
                        m.rotor_speed[i] = speed
                        if up == 0.0:
                            x.slopes[stage, 13 + i] = 0.0
                        else:
                            gap = x.command[i] - speed
                            m.rotor_acceleration[i] = gap * (up if gap > 0.0 else down)
                            x.slopes[stage, 13 + i] = m.rotor_acceleration[i]
                    _enter(m, v, x, size, effects, winds, n if winds.shape[0] > 1 else 0, 0, ground_z[n])
                    _base(m, v, x, pushes, n if pushes.shape[0] > 1 else 0, j if pushes.shape[1] > 1 else 0)
                _accelerate(
                    count, first, 1, instant, body, added, scratch, addresses, explicit, offsets, values, stride
                )
                if stage == 0:
                    if j == kept * every:
                        for c in range(count):
                            x = scratch[c]
                            for i in range(size):
                                states[first + c, kept, i] = x.state[i]
                            for i in range(6):
                                accelerations_out[first + c, kept, i] = x.now[i]
                            for i in range(k):
                                commands_out[first + c, kept, i] = x.command[i]
                        kept += 1
                    if j == steps:
                        break
                for c in range(count):
                    _rates_of_change(instant[c], body[first + c], scratch[c], size, stage)
            if j < steps:
                for c in range(count):
                    _advance(scratch[c], size, step_s)


@compiled(error_model="numpy", nogil=True)
def fly_windows(
    body,
    start,
    time_s,
    speed,
    acceleration,
    wind,
    push,
    height_offset,
    addresses,
    explicit,
    offsets,
    values,
    instant,
    added,
    scratch,
    out,
):
    """States (w, m, 3, 7 or 13) of w windows from their `start`, driven by recorded inputs.

    Inputs are (w, 2 m - 1, ...): at the samples `time_s` (w, m), and half way between them. `height_offset` (w,).
    Windows fly in blocks of as many as there are records.
    """
    size = start.shape[1]
    k = speed.shape[2]
    most = instant.shape[0]
    v = body[0]
    effects = addresses.shape[0] > 0
    for c in range(most):
        for i in range(3):
            for j in range(3):
                instant[c].rotation[i, j] = 1.0 if i == j else 0.0
    for first in range(0, start.shape[0], most):
        count = min(most, start.shape[0] - first)
        for c in range(count):
            _begin(scratch[c], start, first + c, size)
            for i in range(size):
                out[first + c, 0, i] = start[first + c, i]
        for j in range(time_s.shape[1] - 1):
            for stage in range(4):
                share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                at = 2 * j + (stage + 1) // 2
                for c in range(count):
                    n, m, x = first + c, instant[c], scratch[c]
                    step_s = time_s[n, j + 1] - time_s[n, j]
                    m.time_s = time_s[n, j] + share * step_s
                    _try(x, size, stage, step_s)
                    for i in range(k):
                        m.rotor_speed[i] = speed[n, at, i]
                        m.rotor_acceleration[i] = acceleration[n, at, i]
                    _enter(m, v, x, size, effects, wind, n, at, height_offset[n])
                    _base(m, v, x, push, n, at)
                _accelerate(count, first, 0, instant, body, added, scratch, addresses, explicit, offsets, values, 0)
                for c in range(count):
                    _rates_of_change(instant[c], v, scratch[c], size, stage)
            for c in range(count):
                _advance(scratch[c], size, time_s[first + c, j + 1] - time_s[first + c, j])
                for i in range(size):
                    out[first + c, j + 1, i] = scratch[c].state[i]
