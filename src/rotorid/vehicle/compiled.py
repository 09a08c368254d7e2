"""Compiled equations of motion: flights and restart windows of vehicles with effects, motors and a controller.

The same equations, step by step, as the array code in `rotorid.vehicle.simulator` and `rotorid.vehicle.windows`,
written as loops over vehicles for numba because a profile of the array code shows its time to go into calls on small
arrays. Tests hold that both give the same numbers.

A state is rates 0:3, quaternion 3:7, velocity (world) 7:10, position 10:13, rotor speeds 13:, SI.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from rotorid.vehicle.kernels import call_kernel

MOST_ROUNDS = 30
CONVERGED = 1e-10
"""Change of the accelerations, relative to their largest, at which they are taken as solved for."""


@njit(cache=True, error_model="numpy")
def _clear(w):
    for j in range(3):
        w.force[j] = 0.0
        w.moment[j] = 0.0
    for i in range(w.hub_force.shape[0]):
        for j in range(3):
            w.hub_force[i, j] = 0.0


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _implicit(m, v, w, x, addresses, explicit, offsets, values):
    """Accelerations `x.own` that follow where the effects that read accelerations are told `x.at`."""
    for j in range(3):
        m.angular_acceleration[j] = x.at[j]
        m.specific_force[j] = x.at[3 + j]
    _clear(w)
    for e in range(explicit, addresses.shape[0]):
        call_kernel(addresses[e], m, v, values, offsets[e], w)
    for j in range(6):
        x.wrench[j] = x.base[j]
    _collect(v, w, x.wrench)
    _solved(m, v, x.own, x.wrench)


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def _relaxation(m, v, w, x, addresses, explicit, offsets, values):
    """(I − A)⁻¹ of how the accelerations answer to themselves, A: added mass and inertia, constant in a flight."""
    for j in range(6):
        x.at[j] = 0.0
    _implicit(m, v, w, x, addresses, explicit, offsets, values)
    for j in range(6):
        x.first[j] = x.own[j]
    for j in range(6):
        x.at[j] = 1.0
        _implicit(m, v, w, x, addresses, explicit, offsets, values)
        x.at[j] = 0.0
        for i in range(6):
            x.matrix[i, j] = (1.0 if i == j else 0.0) - (x.own[i] - x.first[i])
    _invert(x.matrix)


@njit(cache=True, error_model="numpy")
def _accelerate(m, v, w, x, pushes, p, j, addresses, explicit, offsets, values, known):
    """Accelerations `x.now`, angular then specific force, of a vehicle whose instant `m` is filled but for these.

    `pushes[p, j]` (6,) is added to force and moment. What reads the accelerations that it changes is solved for from
    the last ones, by steps that are exact where the effects are linear in them; `known` says whether `x.matrix` is that
    of this flight already.
    """
    for i in range(6):
        x.base[i] = pushes[p, j, i]
    for i in range(v.rotors):
        square = m.rotor_speed[i] * m.rotor_speed[i]
        x.base[2] -= v.mixer[0, i] * square
        x.base[3] += v.mixer[1, i] * square
        x.base[4] += v.mixer[2, i] * square
        x.base[5] += v.mixer[3, i] * square
    effects = addresses.shape[0]
    if explicit > 0:
        _clear(w)
        for e in range(explicit):
            call_kernel(addresses[e], m, v, values, offsets[e], w)
        _collect(v, w, x.base)
    if explicit == effects:
        _solved(m, v, x.now, x.base)
        return
    if not known:
        _relaxation(m, v, w, x, addresses, explicit, offsets, values)
    for _ in range(MOST_ROUNDS):
        for i in range(6):
            x.at[i] = x.now[i]
        _implicit(m, v, w, x, addresses, explicit, offsets, values)
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
        if turning <= CONVERGED * most_turning and linear <= CONVERGED * most_linear:
            break


@njit(cache=True, error_model="numpy")
def _enter(m, v, s, attitude, effects, winds, row, column, height_offset):
    """Fill an instant from a state, in the wind `winds[row, column]`; what the rotors do is in it already."""
    p, q, r = s[0], s[1], s[2]
    m.angular_velocity[0] = p
    m.angular_velocity[1] = q
    m.angular_velocity[2] = r
    if attitude:
        w, x, y, z = s[3], s[4], s[5], s[6]
        m.rotation[0, 0] = 1.0 - 2.0 * (y * y + z * z)
        m.rotation[0, 1] = 2.0 * (x * y - w * z)
        m.rotation[0, 2] = 2.0 * (x * z + w * y)
        m.rotation[1, 0] = 2.0 * (x * y + w * z)
        m.rotation[1, 1] = 1.0 - 2.0 * (x * x + z * z)
        m.rotation[1, 2] = 2.0 * (y * z - w * x)
        m.rotation[2, 0] = 2.0 * (x * z - w * y)
        m.rotation[2, 1] = 2.0 * (y * z + w * x)
        m.rotation[2, 2] = 1.0 - 2.0 * (x * x + y * y)
    if not effects:
        return
    if s.shape[0] > 10:
        north, east, down = s[7] - winds[row, column, 0], s[8] - winds[row, column, 1], s[9] - winds[row, column, 2]
        for j in range(3):
            m.air_velocity[j] = m.rotation[0, j] * north + m.rotation[1, j] * east + m.rotation[2, j] * down
        m.height = height_offset - s[12]
    total = 0.0
    for i in range(v.rotors):
        x, y, z = v.hub[i, 0], v.hub[i, 1], v.hub[i, 2]
        m.hub_velocity[i, 0] = m.air_velocity[0] + q * z - r * y
        m.hub_velocity[i, 1] = m.air_velocity[1] + r * x - p * z
        m.hub_velocity[i, 2] = m.air_velocity[2] + p * y - q * x
        m.thrust[i] = v.thrust_coefficient[i] * m.rotor_speed[i] * m.rotor_speed[i]
        total += m.rotor_speed[i]
    m.rotor_speed_sum = total


@njit(cache=True, error_model="numpy")
def _rates_of_change(m, v, s, x, slopes, stage):
    """Time derivative of the rigid body's state into a row of `slopes`."""
    p, q, r = s[0], s[1], s[2]
    for j in range(3):
        slopes[stage, j] = x.now[j]
    if s.shape[0] < 7:
        return
    a, b, c, d = s[3], s[4], s[5], s[6]
    slopes[stage, 3] = -0.5 * (b * p + c * q + d * r)
    slopes[stage, 4] = 0.5 * (a * p + c * r - d * q)
    slopes[stage, 5] = 0.5 * (a * q + d * p - b * r)
    slopes[stage, 6] = 0.5 * (a * r + b * q - c * p)
    if s.shape[0] < 13:
        return
    fx, fy, fz = x.now[3], x.now[4], x.now[5]
    for j in range(3):
        slopes[stage, 7 + j] = m.rotation[j, 0] * fx + m.rotation[j, 1] * fy + m.rotation[j, 2] * fz
        slopes[stage, 10 + j] = s[7 + j]
    slopes[stage, 9] += v.gravity


@njit(cache=True, error_model="numpy")
def _normalise(s):
    length = np.sqrt(s[3] * s[3] + s[4] * s[4] + s[5] * s[5] + s[6] * s[6])
    for i in range(3, 7):
        s[i] /= length


@njit(cache=True, error_model="numpy")
def _attitude_command(s, j, now_s, last_s, loop, v, reference, error_of_reading, more, memory, command):
    """Rotor commands of the attitude controller at instant `j`; `memory` (3, 3) is integral, last error, slope."""
    w, x, y, z = s[3], s[4], s[5], s[6]
    angle = np.empty(3)
    angle[0] = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    angle[1] = np.arcsin(min(max(2.0 * (w * y - x * z), -1.0), 1.0))
    angle[2] = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    moment = np.empty(3)
    for a in range(3):
        error = reference[a] - (angle[a] + error_of_reading[a])
        error = (error + np.pi) % (2.0 * np.pi) - np.pi
        if j == 0:
            moment[a] = loop.proportional[a] * error
        else:
            elapsed = now_s - last_s
            raw = (error - memory[1, a]) / elapsed
            keep = np.exp(-elapsed / loop.derivative_time) if loop.derivative_time > 0.0 else 0.0
            memory[2, a] = keep * memory[2, a] + (1.0 - keep) * raw
            integral = memory[0, a] + error * elapsed
            wanted = loop.proportional[a] * error + loop.integral[a] * integral + loop.derivative[a] * memory[2, a]
            held = min(max(wanted, -loop.limit[a]), loop.limit[a])
            if not (held != wanted and np.sign(error) == np.sign(wanted)):
                memory[0, a] = integral
            moment[a] = held
        memory[1, a] = error
    for i in range(v.rotors):
        square = loop.allocation[i, 0] * reference[3]
        for a in range(3):
            square += loop.allocation[i, 1 + a] * moment[a]
        square = max(square, 0.0)
        if more.shape[0] > 0:
            square = max(square + more[j, i], 0.0)
        command[i] = min(max(np.sqrt(square), loop.lowest), loop.highest)


@njit(cache=True, error_model="numpy", nogil=True)
def fly(
    body,
    start,
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
    instant,
    added,
    scratch,
    states,
    accelerations_out,
    commands_out,
):
    """Fly n vehicles over `steps` steps of `step_s`; arrays with a first axis of 1 hold for all vehicles.

    `body` (n,) BODY; `start` (n, 13 + k); `lags` (n, 2) 1/s up and down, 0 follows at once; `limits` (n, 2) rad/s;
    `closed` whether `loops` (LOOP) command by `references` (., steps + 1, 4: angles, thrust) and `more` (squares),
    else `commands` (., steps + 1, k) with their accelerations `following` (0 for none); `reading_errors`
    (., steps + 1, 3) rad; `pushes` (., steps + 1, 6); `winds` (., 1, 3); `ground_z` (n,); `values` (., p). Each
    `every`-th instant is kept in `states`, `accelerations_out` (angular, specific force) and `commands_out`.
    """
    size = start.shape[1]
    k = size - 13
    slopes = np.zeros((4, size))
    trial, command, memory = np.empty(size), np.empty(k), np.empty((3, 3))
    m, w, x = instant[0], added[0], scratch[0]
    effects = addresses.shape[0] > 0
    for n in range(start.shape[0]):
        v = body[n]
        s = start[n].copy()
        up, down = lags[n, 0], lags[n, 1]
        at_once = up == 0.0
        own_values = values[n if values.shape[0] > 1 else 0]
        air = n if winds.shape[0] > 1 else 0
        p = n if pushes.shape[0] > 1 else 0
        c = n if commands.shape[0] > 1 else 0
        f = n if following.shape[0] > 1 else 0
        loop = loops[n if loops.shape[0] > 1 else 0]
        reference = references[n if references.shape[0] > 1 else 0]
        reading_error = reading_errors[n if reading_errors.shape[0] > 1 else 0]
        for i in range(6):
            x.now[i] = 0.0
        memory[:] = 0.0
        known = False
        kept = 0
        for j in range(steps + 1):
            now_s = j * step_s
            if closed:
                _attitude_command(
                    s,
                    j,
                    now_s,
                    (j - 1) * step_s,
                    loop,
                    v,
                    reference[j if reference.shape[0] > 1 else 0],
                    reading_error[j if reading_error.shape[0] > 1 else 0],
                    more,
                    memory,
                    command,
                )
            else:
                for i in range(k):
                    command[i] = commands[c, j, i]
            for i in range(k):
                command[i] = min(max(command[i], limits[n, 0]), limits[n, 1])
                if at_once and j > 0:
                    s[13 + i] = command[i]
                if at_once:
                    m.rotor_acceleration[i] = following[f, j, i] if following.shape[0] > 0 else 0.0
            for stage in range(4):
                share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                m.time_s = now_s + share * step_s
                for i in range(size):
                    trial[i] = s[i] if stage == 0 else s[i] + share * step_s * slopes[stage - 1, i]
                for i in range(k):
                    m.rotor_speed[i] = trial[13 + i]
                    if at_once:
                        slopes[stage, 13 + i] = 0.0
                    else:
                        gap = command[i] - trial[13 + i]
                        m.rotor_acceleration[i] = gap * (up if gap > 0.0 else down)
                        slopes[stage, 13 + i] = m.rotor_acceleration[i]
                _enter(m, v, trial, True, effects, winds, air, 0, ground_z[n])
                row = j if pushes.shape[1] > 1 else 0
                _accelerate(m, v, w, x, pushes, p, row, addresses, explicit, offsets, own_values, known)
                known = True
                if stage == 0:
                    if j == kept * every:
                        for i in range(size):
                            states[n, kept, i] = s[i]
                        for i in range(6):
                            accelerations_out[n, kept, i] = x.now[i]
                        for i in range(k):
                            commands_out[n, kept, i] = command[i]
                        kept += 1
                    if j == steps:
                        break
                _rates_of_change(m, v, trial, x, slopes, stage)
            if j < steps:
                for i in range(size):
                    s[i] += step_s / 6.0 * (slopes[0, i] + 2.0 * (slopes[1, i] + slopes[2, i]) + slopes[3, i])
                _normalise(s)


@njit(cache=True, error_model="numpy", nogil=True)
def fly_windows(
    body,
    start,
    time_s,
    speed,
    speed_between,
    acceleration,
    acceleration_between,
    wind,
    wind_between,
    push,
    push_between,
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

    Inputs are (w, m, ...) at the samples `time_s` (w, m), and `_between` (w, m - 1, ...) half way between them; of
    `acceleration`, `wind` and `push` an axis of windows of length 0 stands for none. `height_offset` (w,).
    """
    size = start.shape[1]
    k = speed.shape[2]
    slopes, trial = np.zeros((4, size)), np.empty(size)
    still, none = np.zeros((1, 1, 3)), np.zeros((1, 1, 6))
    m, w, x = instant[0], added[0], scratch[0]
    v = body[0]
    effects = addresses.shape[0] > 0
    for i in range(3):
        for j in range(3):
            m.rotation[i, j] = 1.0 if i == j else 0.0
    for n in range(start.shape[0]):
        s = start[n].copy()
        out[n, 0] = s
        for i in range(6):
            x.now[i] = 0.0
        known = False
        for j in range(time_s.shape[1] - 1):
            step_s = time_s[n, j + 1] - time_s[n, j]
            for stage in range(4):
                share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
                between = stage == 1 or stage == 2
                at = j + 1 if stage == 3 else j
                m.time_s = time_s[n, j] + share * step_s
                if stage == 0:
                    trial[:] = s
                else:
                    for i in range(size):
                        trial[i] = s[i] + share * step_s * slopes[stage - 1, i]
                for i in range(k):
                    m.rotor_speed[i] = speed_between[n, j, i] if between else speed[n, at, i]
                    if acceleration.shape[0] > 0:
                        m.rotor_acceleration[i] = acceleration_between[n, j, i] if between else acceleration[n, at, i]
                if wind.shape[0] == 0:
                    _enter(m, v, trial, size > 3, effects, still, 0, 0, height_offset[n])
                elif between:
                    _enter(m, v, trial, size > 3, effects, wind_between, n, j, height_offset[n])
                else:
                    _enter(m, v, trial, size > 3, effects, wind, n, at, height_offset[n])
                if push.shape[0] == 0:
                    _accelerate(m, v, w, x, none, 0, 0, addresses, explicit, offsets, values, known)
                elif between:
                    _accelerate(m, v, w, x, push_between, n, j, addresses, explicit, offsets, values, known)
                else:
                    _accelerate(m, v, w, x, push, n, at, addresses, explicit, offsets, values, known)
                known = True
                _rates_of_change(m, v, trial, x, slopes, stage)
            for i in range(size):
                s[i] += step_s / 6.0 * (slopes[0, i] + 2.0 * (slopes[1, i] + slopes[2, i]) + slopes[3, i])
            if size > 3:
                _normalise(s)
            out[n, j + 1] = s
