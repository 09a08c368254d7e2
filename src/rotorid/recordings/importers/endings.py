"""What happened in the last seconds of a flight that did not end as a landing does.

Signs are looked for in the last seconds in the air and shortly after: outputs at zero, a rotor at its limit, a rotor
that stands although it is driven, an attitude that is lost, a blow. What the same flight showed before is none: races
turn over and give full throttle. A blow alone is a hard landing. Which causes fit is ranked by which sign came first;
none is declared.
"""

from __future__ import annotations

from collections.abc import Iterable
from operator import itemgetter

import numpy as np
import pandas as pd

from rotorid.recordings import columns as c
from rotorid.recordings.run import stretches

_LAST_S, _AFTER_S = 4.0, 1.5
"""Signs are looked for from so many seconds before the end of flight to so many behind it."""
_OFF, _FULL = 0.02, 0.99
"""Throttles up to and from which a rotor is off and at its limit."""
_DRIVEN = 0.5
"""Share of what a rotor is usually given from which it is driven."""
_STANDS = 0.2
"""Share of its usual speed up to which a rotor stands."""
_LASTS_S, _BEFORE_S = 0.25, 0.1
"""A sign lasts so long; where it lasted longer than the second before the last seconds it is usual in this flight."""
_TILTED, _TILTED_OFF = np.cos(np.radians((60.0, 40.0)))
"""Cosine of the tilt from which the attitude is lost, and from which rotors are not switched off on the ground."""
_FALLS_M_S2, _UP_M = 4.0, 1.0
"""Specific force of a fall, and height above the ground, in which switched-off rotors are none of a landing."""
_BLOW, _BLOW_M_S2 = 3.0, 40.0
"""Times what the flight has, and specific force, from which a reading is a blow."""
_LOW_VOLTAGE = 0.88

_MOTOR, _SIGNAL = "motor, propeller or speed controller of {} gave out", "the signal of {} was lost"
_SWITCHED_OFF = "the motors were switched off in the air (switch, failsafe)"
_CONTROL = "control was lost (estimate, gains, order of rotors)"
_NO_THRUST, _HIT = "the thrust was not enough (battery, weight)", "it hit something"


_Sign = tuple[float, str, tuple[tuple[str, int], ...]]
"""When, what is seen, and causes with how much the sign speaks for each, where it is the first."""


def ending(table: pd.DataFrame, start_s: float, stop_s: float) -> tuple[str, str] | None:
    """What happened at the end of a flight in a table of contract columns, and which causes fit, the likeliest first.

    The flight is in the air from `start_s` to `stop_s`. None where it ends as a landing does, or nothing shows.
    """
    time_s = table[c.TIME].to_numpy(float)
    flight = _Ending(table[(time_s >= start_s) & (time_s <= stop_s + _AFTER_S)], stop_s)
    if flight.begins_s <= start_s:
        return None
    signs = [*flight.of_rotors(), *flight.of_all(), *flight.of_attitude()]
    if not signs:
        return None
    signs = sorted((*signs, *flight.of_blow()), key=itemgetter(0))
    weights: dict[str, float] = {}
    for place, (_, _, fits) in enumerate(signs):
        for cause, weight in fits:
            weights[cause] = weights.get(cause, 0.0) + weight / (1 + place)
    ranked = sorted(weights, key=lambda cause: -weights[cause])
    happened = "; ".join(f"at {time_s:.2f} s {what}" for time_s, what, _ in signs)
    return f"the last seconds in the air: {happened}", f"what fits, the likeliest first: {'; '.join(ranked)}"


class _Ending:
    """A flight and what is usual in it before its last seconds."""

    def __init__(self, table: pd.DataFrame, stop_s: float) -> None:
        self._table, self._stop_s, self.begins_s = table, stop_s, stop_s - _LAST_S
        self._time_s = table[c.TIME].to_numpy(float)
        self._before = self._time_s < self.begins_s
        self._throttles, self._speeds = (
            pd.DataFrame({found[1]: self._known(n) for n in table if (found := c.rotor_number(n)) and found[0] == kind})
            for kind in ("throttle", "rotor_speed")
        )

    def _known(self, name: str) -> np.ndarray:
        """A column (n,) with gaps filled by the reading before."""
        return self._table[name].ffill().bfill().to_numpy(float)

    def _usual(self, values: np.ndarray) -> float:
        return float(np.median(values[self._before])) if self._before.any() else np.nan

    def _first(self, mask: np.ndarray, until_s: float | None = None) -> float | None:
        """When what a mask (n,) says begins in the last seconds and lasts; None where it does not, or is usual."""
        lasting = [(self._time_s[a], self._time_s[b - 1]) for a, b in stretches(mask)]
        until_s = self._stop_s if until_s is None else until_s
        if any(stop - start > _BEFORE_S for start, stop in lasting if start < self.begins_s):
            return None
        return next((a for a, b in lasting if self.begins_s <= a <= until_s and b - a >= _LASTS_S), None)

    def of_rotors(self) -> Iterable[_Sign]:
        """Rotors that are off, at their limit or stand, while the others go on."""
        for kind, values in (("throttle", self._throttles), ("speed", self._speeds)):
            usual = {rotor: self._usual(values[rotor].to_numpy()) for rotor in values}
            for rotor in values:
                own, rest = values[rotor].to_numpy(), [n for n in values if n != rotor and usual[n] > 0]
                if not rest or not usual[rotor] > 0:
                    continue
                driven = np.mean([values[n].to_numpy() / usual[n] for n in rest], axis=0) > _DRIVEN
                name = f"rotor {rotor}"
                if kind == "speed":
                    asked = self._throttles.get(rotor)
                    driven &= True if asked is None else asked.to_numpy() > _DRIVEN * self._usual(asked.to_numpy())
                    if (at := self._first((own < _STANDS * usual[rotor]) & driven)) is not None:
                        yield at, f"{name} stands although it is driven", ((_MOTOR.format(name), 4),)
                    continue
                if (at := self._first((own <= _OFF) & driven)) is not None:
                    fits = ((_SIGNAL.format(name), 3), (_MOTOR.format(name), 2), (_CONTROL, 1))
                    yield at, f"the output of {name} goes to zero while the others go on", fits
                others_full = np.mean([values[n].to_numpy() for n in rest], axis=0) >= _FULL
                if (at := self._first((own >= _FULL) & ~others_full)) is not None:
                    fits = ((_MOTOR.format(name), 3), (_CONTROL, 2), (_NO_THRUST, 1))
                    yield at, f"{name} is at its limit", fits

    def of_all(self) -> Iterable[_Sign]:
        """All rotors at their limit, or switched off in the air."""
        if self._throttles.empty:
            return
        low, high = self._throttles.min(axis=1).to_numpy(), self._throttles.max(axis=1).to_numpy()
        if (at := self._first(low >= _FULL)) is not None:
            volts = self._known(c.BATTERY_VOLTAGE) if c.BATTERY_VOLTAGE in self._table else np.ones(1)
            sags = len(volts) > 1 and volts[~self._before].min() < _LOW_VOLTAGE * self._usual(volts)
            more = " and the battery's voltage drops" if sags else ""
            yield at, f"all rotors are at their limit{more}", ((_NO_THRUST, 4 if sags else 3), (_CONTROL, 1))
        at = self._first(high <= _OFF, self._stop_s + _AFTER_S)
        if at is not None and (how := self._in_the_air(at)):
            yield at, f"all outputs go to zero {how}", ((_SWITCHED_OFF, 3), (_CONTROL, 1))

    def _in_the_air(self, at_s: float) -> str:
        """What shows that the vehicle is in the air at a time; empty where nothing does."""
        soon = (self._time_s >= at_s - 0.1) & (self._time_s <= at_s + 0.4)
        tilt = self._tilt()
        if tilt is not None and np.nanmin(tilt[soon], initial=1.0) < _TILTED_OFF:
            return f"while the vehicle is tilted by {np.degrees(np.arccos(np.nanmin(tilt[soon]))):.0f}°"
        if set(c.SPECIFIC_FORCE) <= set(self._table):
            force = np.linalg.norm(self._table.loc[soon, list(c.SPECIFIC_FORCE)].dropna(), axis=1)
            if len(force) > 2 and np.quantile(force, 0.4) < _FALLS_M_S2:
                return "and the vehicle falls"
        if c.HEIGHT in self._table and self._known(c.HEIGHT)[soon].min(initial=np.inf) > _UP_M and soon.any():
            return f"{self._known(c.HEIGHT)[soon].min():.1f} m above the ground"
        return ""

    def _tilt(self) -> np.ndarray | None:
        """Cosine of the tilt, (n,); None without an attitude."""
        if not set(c.QUATERNION) <= set(self._table):
            return None
        _, x, y, _ = (self._table[name].to_numpy(float) for name in c.QUATERNION)
        return 1 - 2 * (x**2 + y**2)

    def of_attitude(self) -> Iterable[_Sign]:
        """A tilt from which the vehicle does not come back."""
        tilt = self._tilt()
        if tilt is None or not np.isfinite(tilt).any():
            return
        lost = pd.Series(tilt).ffill().bfill().to_numpy() < _TILTED
        at = self._first(lost)
        if at is not None and lost[(self._time_s >= at) & (self._time_s <= self._stop_s)].all():
            fits = ((_CONTROL, 3), (_MOTOR.format("one rotor"), 2))
            yield at, "the attitude is lost (tilted by more than 60°)", fits

    def of_blow(self) -> Iterable[_Sign]:
        """The first reading of the accelerometer that is far above those of the flight."""
        if not set(c.SPECIFIC_FORCE) <= set(self._table):
            return
        force = np.linalg.norm(self._table[list(c.SPECIFIC_FORCE)].to_numpy(float), axis=1)
        usual = force[self._before & np.isfinite(force)]
        if len(usual):
            blows = np.flatnonzero(~self._before & (force > max(_BLOW_M_S2, _BLOW * np.quantile(usual, 0.99))))
            if len(blows):
                what = f"a blow of {force[blows[0]] / 9.81:.0f} g"
                yield float(self._time_s[blows[0]]), what, ((_HIT, 3),)
