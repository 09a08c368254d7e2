"""A vehicle after a step by hand: two propellers swapped, or a known mass attached at a known place.

What a set left open stays in the vehicle, so the columns of its terms are those of the same parameters as before: the
coefficients of a propeller act where it now sits, and an offset of the centre of mass moves the common centre of both
masses by the vehicle's share of them. What is believed of the vehicle changes by what was done. How well the mass and
its place are known is a nuisance of that flight alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Form, Motion
from rotorid.mismatch.plant.rows import Term
from rotorid.plan.simulate import CompetingModel
from rotorid.recordings import Vehicle
from rotorid.recordings.vehicle import Inertia, Rotor

OF_PROPELLER = ("unequal_rotors",)
"""Effects whose coefficients, one a rotor, go with the propeller. A tilt stays with the motor's mount."""
OF_CENTRE = "com_offset"
WITH_MASS_OF_ITS_OWN = ("payload",)
"""Effects whose parameters are of a further mass: with a known one attached their columns are not those of before."""
MASS_SHARE = 0.05
"""A mass to attach over the vehicle's."""
_PLACE_SD_M, _MASS_SD = 0.002, 0.01
"""How well the place of an attached mass is known, and its size as a share of it."""


@dataclass(frozen=True)
class ChangedVehicle:
    """A step by hand and the vehicle after it."""

    of: str
    """The effect that the step is there for."""
    words: str
    vehicle: Vehicle
    """As believed after the step; rotors by their place."""
    moved: Mapping[str, Callable[[Form], Form]] = field(default_factory=dict)
    """To an effect its forms after the step, in the parameters of before."""
    shares: Mapping[str, float] = field(default_factory=dict)
    """To a believed value (key of the regression) its relative change after the step over that of before."""
    nuisances: tuple[Term, ...] = ()
    """Terms of the flight after the step alone, with the one-sigma of their coefficients as `prior_sd`."""
    pairs: tuple[tuple[int, int], ...] = ()
    """Places, from 0, whose propellers change places."""
    mass_kg: float = 0.0
    """What is attached, at `place_m` (forward, right, down of the believed centre of mass)."""
    place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def term(self, term: Term) -> Term:
        """A term of the set as it acts after the step."""
        return replace(term, form=self.moved[term.effect](term.form)) if term.effect in self.moved else term

    def world(self, world: CompetingModel, effect_of: Mapping[int, str]) -> CompetingModel:
        """A competing model after the step; `effect_of` has the effect of every form by the form's `id()`."""
        effects = tuple(
            (self.moved[effect_of[id(f)]](f) if effect_of.get(id(f)) in self.moved else f, values)
            for f, values in world.effects
        )
        return replace(world, vehicle=self.vehicle, effects=effects)


def swaps(vehicle: Vehicle) -> list[ChangedVehicle]:
    """Every swap of two propellers that turn the same way, and of all such pairs at once where there are several."""
    spins = [rotor.spin for rotor in vehicle.rotors]
    alike = [(i, j) for i, j in combinations(range(vehicle.rotor_count), 2) if spins[i] == spins[j]]
    choices = [(pair,) for pair in alike]
    if len(alike) > 1 and len({i for pair in alike for i in pair}) == 2 * len(alike):
        choices.append(tuple(alike))
    return [_swapped(vehicle, pairs) for pairs in choices]


def _swapped(vehicle: Vehicle, pairs: tuple[tuple[int, int], ...]) -> ChangedVehicle:
    order = np.arange(vehicle.rotor_count)
    for i, j in pairs:
        order[[i, j]] = j, i
    names = " and ".join(f"{i + 1} with {j + 1}" for i, j in pairs)
    words = f"swap the propellers of rotor{'s' if len(pairs) > 1 else ''} {names} (they turn the same way)"
    return ChangedVehicle(
        "unequal_rotors",
        words,
        _with_coefficients(vehicle, order),
        {effect: lambda form: _by_propeller(form, order) for effect in OF_PROPELLER},
        pairs=pairs,
    )


def _with_coefficients(vehicle: Vehicle, order: np.ndarray) -> Vehicle:
    """The vehicle whose believed coefficients, where each rotor has its own, are those of the propeller there now."""
    names = ("thrust_coefficient_n_s2", "torque_coefficient_n_m_s2")
    own = {n: getattr(vehicle, n) for n in names if isinstance(getattr(vehicle, n), tuple)}
    return vehicle.model_copy(update={n: tuple(v[k] for k in order) for n, v in own.items()})


def _by_propeller(form: Form, order: np.ndarray) -> Form:
    """A form whose rotors are numbered by their propeller; `order` (k,) is the propeller at each place, and, as pairs
    are swapped, the place of each propeller too."""

    def contribution(motion: Motion, vehicle: Vehicle, values):
        own = {n: getattr(motion, n) for n in ("rotor_speed", "rotor_acceleration")}
        turned = replace(motion, **{n: v[:, order] for n, v in own.items() if v is not None})
        placed = _with_coefficients(vehicle, order).model_copy(
            update={"rotors": tuple(vehicle.rotors[k] for k in order)}
        )
        return form.contribution(turned, placed, values)

    return replace(form, contribution=contribution)


def _attached(vehicle: Vehicle, place_m: tuple[float, float, float], words: str) -> ChangedVehicle:
    """A mass of MASS_SHARE of the vehicle's attached at `place_m` (forward, right, down of the believed centre)."""
    mass, more = vehicle.mass_kg, MASS_SHARE * vehicle.mass_kg
    place = np.array(place_m)
    centre = more / (mass + more) * place
    own = vehicle.inertia_kg_m2.matrix()
    inertia = own + _of_point(mass, centre) + _of_point(more, place - centre)
    rotors = tuple(
        Rotor(x_m=r.x_m - centre[0], y_m=r.y_m - centre[1], z_m=r.z_m - centre[2], spin=r.spin) for r in vehicle.rotors
    )
    after = vehicle.model_copy(
        update={
            "mass_kg": mass + more,
            "rotors": rotors,
            "inertia_kg_m2": Inertia(
                **{
                    a + b: float(inertia["xyz".index(a), "xyz".index(b)])
                    for a, b in ("xx", "yy", "zz", "xy", "xz", "yz")
                }
            ),
            "accelerometer_position_m": tuple(float(v) for v in np.array(vehicle.accelerometer_position_m) - centre),
        }
    )
    share = mass / (mass + more)

    def smaller(form: Form) -> Form:
        return replace(form, contribution=lambda m, v, values: form.contribution(m, v, share * np.asarray(values)))

    # The mass sits next to where it should, or weighs other than stated: either moves the centre.
    doubt = np.hypot(_PLACE_SD_M, _MASS_SD * np.linalg.norm(place)) * (1.0 - share)
    plane = catalogue()[OF_CENTRE].forms(vehicle)[0]
    nuisance = Term("by hand/place", "effect", "", plane, (0.0, 0.0), 2, (doubt, doubt))
    inertias = {f"inertia_{a}{a}": own[i, i] / inertia[i, i] for i, a in enumerate("xyz")}
    return ChangedVehicle(
        OF_CENTRE, words, after, {OF_CENTRE: smaller}, {"mass": share, **inertias}, (nuisance,), (), more, place_m
    )


def _of_point(mass_kg: float, at_m: np.ndarray) -> np.ndarray:
    """Inertia (3, 3), kg m2, of a point mass about the origin."""
    return mass_kg * (at_m @ at_m * np.eye(3) - np.outer(at_m, at_m))


def masses(vehicle: Vehicle) -> list[ChangedVehicle]:
    """A known mass in front and at the side, as far from the middle as the rotors."""
    hubs = vehicle.rotor_positions_m()
    reach = float(np.linalg.norm(hubs[:, :2], axis=1).mean())
    if reach == 0:
        return []
    grams = 1000 * MASS_SHARE * vehicle.mass_kg

    def one(place, where):
        words = f"attach {grams:.3g} g ({100 * MASS_SHARE:.0f} % of the weight) {reach:.2g} m {where} of the middle"
        return _attached(vehicle, place, words)

    return [one((reach, 0.0, 0.0), "in front"), one((0.0, reach, 0.0), "to the right")]
