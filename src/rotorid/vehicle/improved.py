"""Effects switched on in a vehicle file: `effects` of `vehicle.yaml` as catalogue forms with their values."""

from __future__ import annotations

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Effect, Form, SpeedForm, SpeedPath
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.simulator import Commands, Controller, Motors, Trace, simulate

LAGS_OF_SPEED = frozenset({"one constant", "up and down"})
"""Forms of `motor_lag` that the simulator's own motors fly."""

ActiveForm = tuple[Form, np.ndarray]
"""A form of an effect and the values of its parameters, in order."""
ActiveSpeedForm = tuple[SpeedForm, np.ndarray]
"""The same for a form that acts between command and rotor speed."""


def active_forms(vehicle: Vehicle) -> list[ActiveForm]:
    """Forms of wrench and sensor effects among `vehicle.effects` with their values, in the order of the file.

    An entry is `{id, form, parameters: {symbol: value}}`; `form` may be left out where the effect has one form.
    InputError names the entry and what was expected. Forms between command and rotor speed are passed over here:
    `active_speed_forms` has them.
    """
    return [found for found in _all(vehicle) if isinstance(found[0], Form)]


def active_speed_forms(vehicle: Vehicle) -> list[ActiveSpeedForm]:
    """Forms of `vehicle.effects` that act between command and rotor speed, in the order of the path."""
    found = [found for found in _all(vehicle) if isinstance(found[0], SpeedForm)]
    return sorted(found, key=lambda pair: pair[0].stage)


def speeds_of_commands(
    vehicle: Vehicle,
    command_rad_s: np.ndarray,
    time_s: np.ndarray,
    voltage_v: np.ndarray | None = None,
    full_voltage_v: float | None = None,
) -> np.ndarray:
    """Rotor speeds (n, k), rad/s, that the vehicle's effects make of commands (n, k) at even instants (n,), s.

    `full_voltage_v` is the voltage that the effect of the supply refers to (default the largest of `voltage_v`).
    """
    limits = vehicle.rotor_speed_limits_rad_s
    full = float(np.max(command_rad_s)) if limits is None else limits[1]
    if voltage_v is not None and full_voltage_v is None:
        full_voltage_v = float(np.max(voltage_v))
    speed = np.asarray(command_rad_s, float)
    for form, values in active_speed_forms(vehicle):
        if "voltage" in form.requires and voltage_v is None:
            raise InputError(f"vehicle {vehicle.name}: effect form {form.name!r} needs the battery's voltage")
        speed = form.apply(SpeedPath(speed, time_s, full, voltage_v, full_voltage_v), values)
    return speed


def _all(vehicle: Vehicle) -> list[ActiveForm | ActiveSpeedForm]:
    return [_active(entry, number, vehicle) for number, entry in enumerate(vehicle.effects, 1)]


def _forms(effect: Effect, vehicle: Vehicle) -> dict[str, Form | SpeedForm]:
    return {form.name: form for form in (*effect.forms(vehicle), *effect.speed_forms)}


def _active(entry: dict, number: int, vehicle: Vehicle) -> ActiveForm | ActiveSpeedForm:
    where = f"vehicle {vehicle.name}: effects entry {number}"
    name = entry.get("id")
    effects = catalogue()
    if name not in effects:
        raise InputError(f"{where} has id {name!r}, expected one of {', '.join(effects)}")
    forms = _forms(effects[name], vehicle)
    wanted = entry.get("form", next(iter(forms)) if len(forms) == 1 else None)
    if wanted not in forms:
        raise InputError(f"{where} ({name}) has form {wanted!r}, expected one of {', '.join(forms)}")
    form = forms[wanted]
    given = dict(entry.get("parameters") or {})
    symbols = [p.symbol for p in form.parameters]
    if set(given) != set(symbols):
        raise InputError(
            f"{where} ({name}, {wanted}) gives parameters {', '.join(given) or 'none'}, expected {', '.join(symbols)}"
        )
    values = np.array([float(given[s]) for s in symbols])
    if not np.all(np.isfinite(values)):
        raise InputError(f"{where} ({name}, {wanted}) has a parameter that is not a finite number")
    return form, values


def simulate_as_stated(
    vehicle: Vehicle,
    controller: Controller,
    duration_s: float,
    step_s: float = 0.001,
    voltage_v: float | None = None,
    **settings,
) -> Trace:
    """Fly a vehicle with every effect that its file states switched on; `settings` as for `simulate`.

    What lies between command and rotor speed is applied to the whole series where the commands are known
    (`Commands`). Under any other controller only a lag of the speed can be flown, since the other forms need the
    series; InputError says so.
    """
    speed_forms = active_speed_forms(vehicle)
    motors = Motors(limits_rad_s=vehicle.rotor_speed_limits_rad_s)
    if speed_forms and isinstance(controller, Commands):
        time_s = step_s * np.arange(int(round(duration_s / step_s)) + 1)
        held = np.searchsorted(controller.time_s, time_s + 1e-9, side="right") - 1
        command = controller.rotor_speed[np.maximum(held, 0)]
        voltage = None if voltage_v is None else np.full(len(time_s), float(voltage_v))
        controller = Commands(time_s, speeds_of_commands(vehicle, command, time_s, voltage))
    else:
        for form, values in speed_forms:
            if form.name not in LAGS_OF_SPEED:
                raise InputError(
                    f"vehicle {vehicle.name}: effect form {form.name!r} needs the whole series of commands; "
                    "give them as Commands instead of a controller"
                )
            motors = Motors(values[0], values[-1], vehicle.rotor_speed_limits_rad_s)
    return simulate(
        vehicle,
        controller,
        duration_s,
        step_s,
        motors=motors,
        effects=active_forms(vehicle),
        voltage_v=voltage_v,
        **settings,
    )
