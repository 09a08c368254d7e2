"""What stands between a load and its reading, each part a small model of its own from its field's textbook.

Arrays are (n, channels) at a step of `dt`; a part takes the reading so far (or the load) and gives what it adds.
"""

import numpy as np
from numba import njit
from scipy.signal import bessel, lfilter, sosfilt


def standard_solid(load: np.ndarray, terms, dt: float) -> np.ndarray:
    """Strain that creeps: sum of Kelvin-Voigt elements (share, retardation time s), in units of the load."""
    out = np.zeros_like(load)
    for share, time in terms:
        a = np.exp(-dt / time)
        out += share * lfilter([1 - a], [1, -a], load, axis=0)
    return out


@njit(cache=True)
def bouc_wen(load, full, sharp, width):
    """Hysteretic variable z of Bouc and Wen (n,), bounded by `width` times the full load.

    z' = x' (1 − |z/z_0|^s (0.5 + 0.5 sgn(x' z))) with z_0 = width × full: it follows the load after a turn and
    levels off, so reading = load + h (z − …) opens a loop between rising and falling that no speed changes.
    """
    z = np.zeros(len(load))
    top = width * full
    for i in range(1, len(load)):
        step = load[i] - load[i - 1]
        now = z[i - 1]
        turn = 1.0 if step * now > 0 else -1.0
        z[i] = now + step * (1 - (abs(now) / top) ** sharp * (0.5 + 0.5 * turn))
        z[i] = min(max(z[i], -top), top)
    return z


def warming(power: np.ndarray, time_s: float, dt: float) -> np.ndarray:
    """Temperature of a body of one heat capacity, in units of the power's steady rise, (n,)."""
    a = np.exp(-dt / time_s)
    return lfilter([1 - a], [1, -a], power)


def mode(load: np.ndarray, hz: float, zeta: float, dt: float) -> np.ndarray:
    """Reading of a sensor on a springy mount, by Newmark's method of mean acceleration, from rest on the first load."""
    w = 2 * np.pi * hz
    x = load[0].copy()
    v, a = np.zeros_like(x), np.zeros_like(x)
    out = np.empty_like(load)
    out[0] = x
    stiff = 1 + zeta * w * dt + 0.25 * (w * dt) ** 2
    for i in range(1, len(load)):
        guess_x = x + dt * v + 0.25 * dt * dt * a
        guess_v = v + 0.5 * dt * a
        a = (w * w * (load[i] - guess_x) - 2 * zeta * w * guess_v) / stiff
        x, v = guess_x + 0.25 * dt * dt * a, guess_v + 0.5 * dt * a
        out[i] = x
    return out


def amplifier(reading: np.ndarray, hz: float, order: int, dt: float) -> np.ndarray:
    """Bessel low-pass as instrument amplifiers have, at rest on the first reading."""
    sos = bessel(order, hz, fs=1 / dt, output="sos", norm="mag")
    return sosfilt(sos, reading - reading[0], axis=0) + reading[0]


def pink(n: int, columns: int, rng: np.random.Generator) -> np.ndarray:
    """Noise of unit rms whose power falls as 1/f down to one cycle in `n` samples, (n, columns)."""
    freq = np.fft.rfftfreq(n)
    freq[0] = freq[1]
    drawn = rng.standard_normal((len(freq), columns)) + 1j * rng.standard_normal((len(freq), columns))
    out = np.fft.irfft(drawn / np.sqrt(freq)[:, None], n, axis=0)
    out -= out.mean(axis=0)
    return out / out.std(axis=0)
