"""Equations of motion of a multirotor with every hidden effect as a switch, integrated by RK4.

World: north, east, down. Body: forward, right, down. Rotor i pushes along its axis e_i (nominally -z); `spin`
is +1 for counter-clockwise seen from above, whose reaction on the airframe is a positive yaw moment. All
effects are zero by default: then the vehicle is a rigid body with F = C_F w^2, Q = C_Q w^2 and rotor speed
equal to the command at once.
"""

import numpy as np
from numba import njit

from .vehicles import Airframe

AIR_DENSITY = 1.225

_SCALARS = dict(
    lag_on_thrust=0.0,
    thrust_constant_n=0.0,
    thrust_linear_n_s=0.0,
    throttle_blend=1.0,  # a of T = ((1-a) u + a u^2) T_max; 1 is the believed square law
    throttle_dead=0.0,
    sag=0.0,  # speed scales with (V / V_ref)^sag
    resistance_ohm=0.0,
    capacity_as=4000.0,
    idle_current_a=0.3,
    voltage_reference_v=12.0,
    speed_low=0.0,
    speed_high=1e9,
    drag_w=0.0,  # k_d, N/(rad/s m/s)
    drag_at_hubs=1.0,
    flap=0.0,  # N m/(rad/s m/s)
    frame_per_axis=0.0,
    lift=0.0,  # k_h, N/(m/s)^2
    inflow=0.0,  # k_z, N/(rad/s m/s)
    ground=0.0,  # c of 1/(1 - c (R/4z)^2)
    ground_exp_a=0.0,
    ground_exp_b=1.0,
    gyroscopic=0.0,
    acceleration=0.0,
    interference=0.0,
    ring_mean=0.0,
    ring_noise=0.0,
    slung_mass=0.0,
    slung_length=0.5,
    tether_weight=0.0,  # N per metre of height
    tether_spring=0.0,
    tether_slack=1.0,
    slosh_mass=0.0,
    slosh_rate=8.0,
    slosh_damping=0.05,
    slosh_z=0.02,
    slide_fraction=0.0,  # battery mass over total mass
    slide_length=0.01,
    slide_threshold=2.0,
    chip=0.0,
    banner=0.0,
    banner_lag_s=0.4,
    dead_time_s=0.0,
    blade_inflow=0.0,
    blade_edge=0.0,
    blade_sideforce=0.0,
    solidity=1.0,
    solidity_thrust=0.0,
    blade_pitch=0.3,  # rad, over (0.3 + x) along the blade
    blade_drag=0.9,
    command_cut_hz=12.0,
    attitude_rate=8.0,
)
_VECTORS = dict(
    centre_m=3,
    frame_area_m2=3,
    damping=3,
    wind=3,
    slung_point=3,
    tether_point=3,
    banner_point=3,
    magnet=3,
    field=3,
    anchor=3,
)
MOST_ROTORS = 8
_OF_ROTORS = ("position", "axis", "spin", "cf", "cq", "tau_up", "tau_down", "mixer")


def clean_physics(a: Airframe) -> dict:
    """The parameters of a vehicle with nothing hidden, as a dict that effects may change."""
    n = a.n
    position = np.array(a.positions_m)
    spin = np.array(a.spin, float)
    cf, cq = a.thrust_coefficient, a.torque_coefficient
    # rows: total thrust, roll, pitch, yaw moment from squared speeds
    allocation = np.vstack([np.full(n, cf), -cf * position[:, 1], cf * position[:, 0], cq * spin])
    values = dict(
        mass=a.mass_kg,
        inertia=np.diag(a.inertia_kg_m2),
        gravity=a.gravity_m_s2,
        position=position,
        axis=np.tile([0.0, 0.0, -1.0], (n, 1)),
        spin=spin,
        cf=np.full(n, cf),
        cq=np.full(n, cq),
        radius=a.rotor_radius_m,
        jr=a.rotor_inertia_kg_m2,
        tau_up=np.zeros(n),
        tau_down=np.zeros(n),
        cells=float(a.cells),
        believed_mass=a.mass_kg,
        believed_inertia=np.diag(a.inertia_kg_m2),
        mixer=np.linalg.pinv(allocation),
        max_speed=a.max_speed_rad_s,
        hover_speed=a.hover_speed_rad_s,
        hover_inflow=a.hover_inflow_m_s,
    )
    values |= _SCALARS | {k: np.zeros(size) for k, size in _VECTORS.items()}
    values["voltage_reference_v"] = 3.9 * a.cells
    return values


@njit(cache=True)
def _cross(a, b):
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


@njit(cache=True)
def _times(m, v):
    """A 3 by 3 matrix times a vector: to compile in a linear-algebra library for it takes longer than to fly."""
    out = np.empty(3)
    for i in range(3):
        out[i] = m[i, 0] * v[0] + m[i, 1] * v[1] + m[i, 2] * v[2]
    return out


@njit(cache=True)
def _solve(m, v):
    """x of m x = v, for a symmetric positive 3 by 3 matrix."""
    l10, l20 = m[1, 0] / m[0, 0], m[2, 0] / m[0, 0]
    d1 = m[1, 1] - l10 * m[0, 1]
    l21 = (m[2, 1] - l20 * m[0, 1]) / d1
    m12 = m[1, 2] - l10 * m[0, 2]
    d2 = m[2, 2] - l20 * m[0, 2] - l21 * m12
    y1 = v[1] - l10 * v[0]
    x = np.empty(3)
    x[2] = (v[2] - l20 * v[0] - l21 * y1) / d2
    x[1] = (y1 - m12 * x[2]) / d1
    x[0] = (v[0] - m[0, 1] * x[1] - m[0, 2] * x[2]) / m[0, 0]
    return x


@njit(cache=True)
def rotation(q):
    w, x, y, z = q[0], q[1], q[2], q[3]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@njit(cache=True)
def open_circuit_v(charge, cells):
    """Lithium-polymer open-circuit voltage against state of charge (1 full, 0 empty)."""
    c = min(max(charge, 0.0), 1.0)
    return cells * (3.3 + 0.6 * c + 0.25 * c**3 - 0.3 * np.exp(-20.0 * c) + 0.05 * np.exp(-8.0 * (1 - c)))


@njit(cache=True)
def _steady_speed(command, voltage, P):
    """Speed that a motor settles at for a command, through throttle curve, battery and limits."""
    u = command / P.max_speed
    if P.throttle_dead > 0:
        u = max(0.0, (u - P.throttle_dead) / (1 - P.throttle_dead))
    if P.throttle_blend != 1.0:
        u = np.sqrt(max(0.0, (1 - P.throttle_blend) * u + P.throttle_blend * u * u))
    w = u * P.max_speed
    if P.sag > 0:
        w *= (voltage / P.voltage_reference_v) ** P.sag
    return min(max(w, P.speed_low), P.speed_high)


@njit(cache=True)
def blade_forces(w, v_down, v_edge, P):
    """Thrust and in-plane drag of one rotor by blade elements with Glauert inflow (integrated over azimuth).

    w rad/s, v_down axial speed of the hub through the air along -thrust (m/s, positive descending),
    v_edge in-plane speed (m/s). Returns thrust (N), drag against v_edge (N).
    """
    R = P.radius
    area = np.pi * R * R
    tip = w * R
    climb = -v_down
    hover = P.hover_inflow * w / P.hover_speed
    vi = hover
    scale = P.solidity * 0.85 / 40
    thrust = 0.0
    drag = 0.0
    for _ in range(6):  # Newton on: blade-element thrust equals momentum thrust
        thrust = 0.0
        drag = 0.0
        slope = 0.0
        for ir in range(5):
            x = 0.15 + 0.85 * (ir + 0.5) / 5
            for ia in range(8):
                psi = 2 * np.pi * (ia + 0.5) / 8
                ut = max(x * tip + v_edge * np.sin(psi), 1.0)
                # induced flow leans backwards in forward flight (Drees)
                lean = 1 + v_edge / (abs(vi + climb) + v_edge + 1e-6) * x * np.cos(psi)
                phi = (climb + vi * lean) / ut
                alpha = P.blade_pitch / (0.3 + x) - phi
                lift = ut * ut * 5.7 * alpha
                profile = ut * ut * (0.012 + P.blade_drag * alpha * alpha)
                thrust += lift
                slope -= 5.7 * ut * lean
                drag += (profile + lift * phi) * np.sin(psi)
        thrust *= scale
        drag *= scale
        slope *= scale
        # the floor keeps momentum theory finite when the rotor descends into its own wake
        total = np.sqrt(v_edge**2 + (climb + vi) ** 2 + (0.3 * hover) ** 2)
        momentum = 2 * AIR_DENSITY * area * total * vi
        steep = 2 * AIR_DENSITY * area * (total + vi * (climb + vi) / total)
        step = (thrust - momentum) / max(steep - slope, 1e-6)
        vi = max(vi + min(max(step, -hover), hover), 0.0)
    return thrust, drag


@njit(cache=True)
def _rates(y, target, late_target, wind, ring, slide, phase, P, dy, aux):
    """Write the derivative of the state y into dy, and forces into aux.

    aux: specific force (3), angular acceleration (3), rotor speeds (n), their derivatives (n), current,
    saturated, ground gain, in vortex ring.
    """
    n = P.rotors
    p, v, q, om = y[0:3], y[3:6], y[6:10], y[10:13]
    o = 13
    wc, wcd = y[o : o + n], y[o + n : o + 2 * n]
    wa, wad = y[o + 2 * n : o + 3 * n], y[o + 3 * n : o + 4 * n]
    wl = y[o + 4 * n : o + 5 * n]
    e = o + 5 * n
    charge, voltage = y[e], y[e + 1]
    sp, sv = y[e + 2 : e + 5], y[e + 5 : e + 8]
    sl, sld = y[e + 8 : e + 10], y[e + 10 : e + 12]
    bv = y[e + 12 : e + 15]
    R = rotation(q)
    cut = 2 * np.pi * P.command_cut_hz
    vair = _times(R.T, v - wind)
    force = np.zeros(3)
    moment = np.zeros(3)
    current = P.idle_current_a
    spin_momentum = np.zeros(3)
    saturated = 0.0
    ground_gain = 0.0
    in_ring = 0.0
    speed_edge = np.sqrt(vair[0] ** 2 + vair[1] ** 2)
    for i in range(n):
        # command filters (two-pole): what is recorded, and what reaches the motor after the dead time
        dy[o + i] = wcd[i]
        dy[o + n + i] = cut * cut * (target[i] - wc[i]) - 2 * cut * wcd[i]
        dy[o + 2 * n + i] = wad[i]
        dy[o + 3 * n + i] = cut * cut * (late_target[i] - wa[i]) - 2 * cut * wad[i]
        steady = _steady_speed(wa[i], voltage, P)
        if steady >= P.speed_high or steady <= P.speed_low:
            saturated = 1.0
        if P.tau_up[i] > 0:
            w = wl[i]
            tau = P.tau_up[i] if steady > w else P.tau_down[i]
            if P.lag_on_thrust > 0:
                wd = (steady * steady - w * w) / (2 * max(w, 1.0) * tau)
            else:
                wd = (steady - w) / tau
            dy[o + 4 * n + i] = wd
        else:
            w = steady
            wd = (_steady_speed(wa[i] + 1e-4 * wad[i], voltage, P) - steady) / 1e-4
            dy[o + 4 * n + i] = 0.0
        aux[6 + i] = w
        aux[6 + n + i] = wd
        axis = P.axis[i]
        arm = P.position[i] - P.centre_m
        hub = vair + _cross(om, arm)
        along = hub[0] * axis[0] + hub[1] * axis[1] + hub[2] * axis[2]
        edge = hub - along * axis
        v_down = -along
        v_edge = np.sqrt(edge[0] ** 2 + edge[1] ** 2 + edge[2] ** 2)
        thrust = P.cf[i] * w * w
        if w > 1.0:
            thrust += P.thrust_constant_n + P.thrust_linear_n_s * w
        thrust += P.inflow * w * v_down + P.lift * v_edge * v_edge
        inplane = P.drag_w * w
        if P.blade_inflow + P.blade_edge + P.blade_sideforce > 0 and w > 1.0:
            # blade elements agree with C_F w^2 in still air by calibration; here only what moving air adds
            still = P.solidity_thrust * w * w
            if P.blade_inflow > 0 and P.blade_edge > 0:
                t1, d1 = blade_forces(w, v_down, v_edge, P)
                thrust += P.blade_inflow * (t1 - still)
            elif P.blade_inflow > 0:
                t1, d1 = blade_forces(w, v_down, 0.0, P)
                thrust += P.blade_inflow * (t1 - still)
            else:
                t1, d1 = blade_forces(w, 0.0, v_edge, P)
                thrust += P.blade_edge * (t1 - still)
            if P.blade_sideforce > 0 and v_edge > 1e-6:
                inplane += P.blade_sideforce * d1 / v_edge
        gain = 1.0
        if P.ground > 0 or P.ground_exp_a > 0:
            height = -(p[2] + R[2, 0] * arm[0] + R[2, 1] * arm[1] + R[2, 2] * arm[2])
            height = max(height, 0.6 * P.radius)
            if P.ground > 0:
                gain = 1.0 / (1.0 - min(P.ground * (P.radius / (4 * height)) ** 2, 0.6))
            else:
                gain = 1.0 + P.ground_exp_a * np.exp(-P.ground_exp_b * height / P.radius)
            ground_gain = max(ground_gain, gain - 1.0)
        if P.interference > 0 and speed_edge > 0.1:
            behind = -(arm[0] * vair[0] + arm[1] * vair[1]) / speed_edge
            reach = np.sqrt(arm[0] ** 2 + arm[1] ** 2)
            if behind > 0:
                gain *= 1.0 - P.interference * behind / reach * speed_edge / (speed_edge + P.hover_inflow)
        if P.ring_mean > 0 or P.ring_noise > 0:
            ratio = v_down / P.hover_inflow
            if ratio > 0.4 and ratio < 1.6:
                bump = np.sin(np.pi * (ratio - 0.4) / 1.2) ** 2
                gain *= 1.0 - bump * (P.ring_mean + P.ring_noise * ring[i])
                in_ring = 1.0
        if P.chip > 0 and i == 0:
            gain *= 1.0 + P.chip * np.cos(phase[i])
        thrust *= gain
        push = thrust * axis - inplane * edge
        force += push
        if P.drag_at_hubs > 0:
            moment += _cross(arm, push)
        else:
            moment += _cross(arm, thrust * axis)
        moment -= P.spin[i] * P.cq[i] * w * w * axis
        moment += P.flap * w * _cross(edge, axis)
        spin_momentum += P.jr * P.spin[i] * w * axis
        if P.acceleration > 0:
            moment -= P.acceleration * P.jr * P.spin[i] * wd * axis
        current += P.cq[i] * w * w * w / (0.6 * max(voltage, 1.0))
    if P.gyroscopic > 0:
        moment -= P.gyroscopic * _cross(om, spin_momentum)
    speed = np.sqrt(vair[0] ** 2 + vair[1] ** 2 + vair[2] ** 2)
    for k in range(3):
        along_k = abs(vair[k]) if P.frame_per_axis > 0 else speed
        force[k] -= 0.5 * AIR_DENSITY * P.frame_area_m2[k] * along_k * vair[k]
        moment[k] -= P.damping[k] * om[k]
    moment += _cross(P.magnet, _times(R.T, P.field))
    # things hanging on the vehicle: forces in world axes at a body point
    for k in range(e + 2, e + 15):
        dy[k] = 0.0
    if P.slung_mass > 0:
        arm = P.slung_point - P.centre_m
        at = p + _times(R, arm)
        at_v = v + _times(R, _cross(om, arm))
        d = sp - at
        length = np.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2) + 1e-9
        unit = d / length
        closing = unit[0] * (sv[0] - at_v[0]) + unit[1] * (sv[1] - at_v[1]) + unit[2] * (sv[2] - at_v[2])
        stiff = P.slung_mass * 6400.0
        tension = max(0.0, stiff * (length - P.slung_length) + P.slung_mass * 40.0 * closing)
        pull = _times(R.T, tension * unit)
        force += pull
        moment += _cross(arm, pull)
        dy[e + 2 : e + 5] = sv
        dy[e + 5 : e + 8] = -tension * unit / P.slung_mass - 0.2 * (sv - wind)
        dy[e + 7] += P.gravity
    if P.tether_weight > 0:
        out = p[0:2] - P.anchor[0:2]
        reach = np.sqrt(out[0] ** 2 + out[1] ** 2) + 1e-9
        pull_w = np.zeros(3)
        pull_w[2] = P.tether_weight * max(0.0, -p[2])
        if reach > P.tether_slack:
            pull_w[0:2] = -P.tether_spring * (reach - P.tether_slack) * out / reach
        pull = _times(R.T, pull_w)
        force += pull
        moment += _cross(P.tether_point - P.centre_m, pull)
    if P.banner > 0:
        size = np.sqrt(bv[0] ** 2 + bv[1] ** 2 + bv[2] ** 2)
        pull = _times(R.T, -P.banner * size * bv)
        force += pull
        moment += _cross(P.banner_point - P.centre_m, pull)
        dy[e + 12 : e + 15] = (v - wind - bv) / P.banner_lag_s
    if P.slosh_mass > 0:
        spring = P.slosh_mass * (P.slosh_rate**2 * sl + 2 * P.slosh_damping * P.slosh_rate * sld)
        acc = np.zeros(3)
        acc[0:2] = (force[0:2] + spring) / (P.mass - P.slosh_mass)
        acc[2] = force[2] / P.mass
        moment[0] += sl[1] * (-P.slosh_mass * acc[2]) - P.slosh_z * spring[1]
        moment[1] += -sl[0] * (-P.slosh_mass * acc[2]) + P.slosh_z * spring[0]
        # the tank sits below the centre of mass and is swung by turning too
        swing = _solve(P.inertia, moment)
        dy[e + 8 : e + 10] = sld
        dy[e + 10] = -spring[0] / P.slosh_mass - acc[0] - P.slosh_z * swing[1]
        dy[e + 11] = -spring[1] / P.slosh_mass - acc[1] + P.slosh_z * swing[0]
    else:
        acc = force / P.mass
    if P.slide_fraction > 0:
        moved = np.zeros(3)
        moved[0] = P.slide_fraction * slide
        moment -= _cross(moved, force)
    alpha = _solve(P.inertia, moment - _cross(om, _times(P.inertia, om)))
    dy[0:3] = v
    dy[3:6] = _times(R, acc)
    dy[5] += P.gravity
    dy[6] = 0.5 * (-q[1] * om[0] - q[2] * om[1] - q[3] * om[2])
    dy[7] = 0.5 * (q[0] * om[0] + q[2] * om[2] - q[3] * om[1])
    dy[8] = 0.5 * (q[0] * om[1] - q[1] * om[2] + q[3] * om[0])
    dy[9] = 0.5 * (q[0] * om[2] + q[1] * om[1] - q[2] * om[0])
    dy[10:13] = alpha
    dy[e] = -current / P.capacity_as
    dy[e + 1] = (open_circuit_v(charge, P.cells) - P.resistance_ohm * current - voltage) / 0.02
    aux[0:3] = acc
    aux[3:6] = alpha
    aux[6 + 2 * n] = current
    aux[7 + 2 * n] = saturated
    aux[8 + 2 * n] = ground_gain
    aux[9 + 2 * n] = in_ring


@njit(cache=True)
def _rk4(y, h, target, late_target, wind, ring, slide, phase, P, k1, k2, k3, k4, aux):
    """One classical Runge-Kutta step in place; k1 and aux must hold the rates at y already."""
    spare = aux.copy()
    _rates(y + 0.5 * h * k1, target, late_target, wind, ring, slide, phase, P, k2, spare)
    _rates(y + 0.5 * h * k2, target, late_target, wind, ring, slide, phase, P, k3, spare)
    _rates(y + h * k3, target, late_target, wind, ring, slide, phase, P, k4, spare)
    y += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    y[6:10] /= np.sqrt(y[6] ** 2 + y[7] ** 2 + y[8] ** 2 + y[9] ** 2)


@njit(cache=True)
def fly(P, h, pref, vref, aref, yawref, att, frac, wind, ring, charge0, out):
    """Closed-loop flight along a reference; out has one row a step: state, aux, rotor phases (n)."""
    steps = pref.shape[0]
    n = P.rotors
    size = 13 + 5 * n + 17
    y = np.zeros(size)
    y[0:3] = pref[0]
    y[6] = 1.0
    e = 13 + 5 * n
    for i in range(n):
        y[13 + i] = P.hover_speed
        y[13 + 2 * n + i] = P.hover_speed
        y[13 + 4 * n + i] = P.hover_speed
    y[e] = charge0
    y[e + 1] = open_circuit_v(charge0, P.cells) - 2.0 * P.resistance_ohm
    y[e + 2 : e + 5] = pref[0] + P.slung_point
    y[e + 4] += P.slung_length
    dead = int(round(P.dead_time_s / h))
    history = np.full((dead + 1, n), P.hover_speed)
    k1, k2, k3, k4 = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    aux = np.zeros(10 + 2 * n)
    force_sum = np.zeros(3)
    moment_sum = np.zeros(3)
    target = np.full(n, P.hover_speed)
    phase = np.zeros(n)
    slide = 0.0
    rate = P.attitude_rate
    slow = min(2.2, rate / 3.2)
    J = P.believed_inertia
    wmin2 = (0.25 * P.hover_speed) ** 2
    wmax2 = (0.95 * P.max_speed) ** 2
    for k in range(steps):
        R = rotation(y[6:10])
        om = y[10:13]
        ep = pref[k] - y[0:3]
        ev = vref[k] - y[3:6]
        force_sum += ep * h * 0.5 * slow**3
        acc = aref[k] + slow**2 * ep + 1.8 * slow * ev + force_sum
        lateral = np.sqrt(acc[0] ** 2 + acc[1] ** 2)
        if lateral > 14.0:
            acc[0] *= 14.0 / lateral
            acc[1] *= 14.0 / lateral
        want = acc.copy()
        want[2] = min(max(want[2], -15.0), 6.5) - P.gravity
        down = -want / np.sqrt(want[0] ** 2 + want[1] ** 2 + want[2] ** 2)
        # a far turn is taken in steps, so that it does not spoil the tilt
        yaw = np.arctan2(R[1, 0], R[0, 0])
        turn_by = (yawref[k] - yaw + np.pi) % (2 * np.pi) - np.pi
        aim = yaw + min(max(turn_by, -0.5), 0.5)
        yaw_rate = (yawref[min(k + 1, steps - 1)] - yawref[k]) / h
        heading = np.array([np.cos(aim), np.sin(aim), 0.0])
        right = _cross(down, heading)
        right /= np.sqrt(right[0] ** 2 + right[1] ** 2 + right[2] ** 2)
        ahead = _cross(right, down)
        a1, a2, a3 = _times(R.T, ahead), _times(R.T, right), _times(R.T, down)
        err = 0.5 * np.array([a2[2] - a3[1], a3[0] - a1[2], a1[1] - a2[0]]) + att[k]
        thrust = -P.believed_mass * (want[0] * R[0, 2] + want[1] * R[1, 2] + want[2] * R[2, 2])
        turn = np.empty(3)
        for a in range(3):
            r = rate if a < 2 else 0.5 * rate
            moment_sum[a] += J[a, a] * r**3 * 0.15 * err[a] * h
            turn[a] = J[a, a] * (r * r * err[a] - 1.7 * r * (om[a] - yaw_rate * R[2, a])) + moment_sum[a]
        turn += _cross(om, _times(J, om))
        authority = 0.25 * P.cq[0] / P.cf[0] * max(thrust, 0.2 * P.believed_mass * P.gravity)
        turn[2] = min(max(turn[2], -authority), authority)
        for i in range(n):
            s = P.mixer[i, 0] * thrust + P.mixer[i, 1] * turn[0] + P.mixer[i, 2] * turn[1] + P.mixer[i, 3] * turn[2]
            target[i] = np.sqrt(min(max(s, wmin2), wmax2)) * (1 + frac[k, i])
        if dead > 0:
            history[k % (dead + 1)] = target
            late = history[(k + 1) % (dead + 1)].copy()
        else:
            late = target
        _rates(y, target, late, wind[k], ring[k], slide, phase, P, k1, aux)
        out[k, :size] = y
        out[k, size : size + 10 + 2 * n] = aux
        out[k, size + 10 + 2 * n :] = phase
        if P.slide_fraction > 0:
            if aux[0] > P.slide_threshold:
                slide = max(slide - 0.1 * h, -P.slide_length)
            elif aux[0] < -P.slide_threshold:
                slide = min(slide + 0.1 * h, P.slide_length)
        _rk4(y, h, target, late, wind[k], ring[k], slide, phase, P, k1, k2, k3, k4, aux)
        for i in range(n):
            phase[i] = (phase[i] + aux[6 + i] * h) % (2 * np.pi)
        if not np.isfinite(y[0]) or abs(y[2]) > 1e4:
            return k
    return steps


def to_record(values: dict) -> np.void:
    """Freeze a parameter dict for the compiled code: as a record, which is handed on by its address."""
    found = {}
    for name, value in values.items():
        value = np.asarray(value, float)
        if name in _OF_ROTORS:  # one layout for vehicles with any number of rotors
            value = np.concatenate([value, np.zeros((MOST_ROTORS - len(value), *value.shape[1:]))])
        found[name] = value
    layout = [("rotors", "i8")] + [(name, "f8", value.shape) for name, value in found.items()]
    record = np.zeros(1, np.dtype(layout, align=True))
    for name, value in found.items():
        record[name] = value
    record["rotors"] = len(values["spin"])
    return record[0]


def state_size(n: int) -> int:
    return 13 + 5 * n + 17
