"""What changed between command and rotor speed from one set to another, on made commands."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.changes.chain import chain_terms
from rotorid.mismatch.changes.compare import (
    changes_in,
    command_notes,
    decided_of_speeds,
    mistakes_that_differ,
    most_like,
)
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.evidence.speedpath import CommandChain
from tests.unit.mismatch.evidence.test_speedpath import FULL, recorded, searched

VOLTAGE = np.linspace(12.4, 10.2, 2000)
GOOD = {"motor_lag": ("one constant", (0.05,))}


def compared(**at_work):
    """What is stated to have changed from two good flights with a lag of 50 ms to two others."""
    first = [recorded(k, voltage=VOLTAGE, **GOOD) for k in (1, 2)]
    second = [recorded(k, voltage=VOLTAGE, **at_work) for k in (3, 4)]
    found = SimpleNamespace(chain=CommandChain(searched(*first), FULL, float(VOLTAGE.max())), commanded=False)
    options, squares = decided_of_speeds(found, chain_terms(found, first), (first, second))
    assert all(np.all(np.linalg.eigvalsh(own) >= -1e-9) for own in squares.values())
    return {s.id: s for s in changes_in(options) if s.status in ("established", "ambiguous")}


def test_the_same_chain_did_not_change():
    assert compared(**GOOD) == {}


@pytest.mark.parametrize("tau_s", [0.03, 0.09])
def test_motors_that_became_slower_or_quicker_are_named_by_how_much(tau_s):
    changed = compared(motor_lag=("one constant", (tau_s,)))
    assert changed.keys() == {"motor_lag"} and changed["motor_lag"].alternatives == ()
    (size,) = changed["motor_lag"].parameters
    assert size.low < tau_s - 0.05 < size.high and size.value == pytest.approx(tau_s - 0.05, abs=0.004)


def test_a_new_delay_is_no_change_of_the_lag():
    changed = compared(**GOOD, delay=("of the command", (0.03,)))
    assert changed.keys() == {"delay"}
    assert changed["delay"].parameters[0].value == pytest.approx(0.03, abs=0.004)


def test_a_battery_that_sags_is_named():
    changed = compared(**GOOD, battery_sag=("power of voltage", (0.9,)))
    assert changed.keys() == {"battery_sag"}
    assert changed["battery_sag"].parameters[0].value == pytest.approx(0.9, abs=0.1)


@pytest.mark.parametrize("late_steps", [0, 4])
def test_commands_that_the_late_clock_stamped_too_are_not_taken_for_early(late_steps):
    """Of speeds moved to the other sensors' time and as recorded, those that follow commands as before."""
    first = [recorded(k, voltage=VOLTAGE, **GOOD) for k in (1, 2)]
    found = SimpleNamespace(chain=CommandChain(searched(*first), FULL, float(VOLTAGE.max())), commanded=False)
    good = [recorded(3, voltage=VOLTAGE, **GOOD)]

    def earlier(steps):
        moved = np.roll(good[0].motion.rotor_speed, -steps, axis=0)
        return [replace(good[0], motion=replace(good[0].motion, rotor_speed=moved))]

    as_recorded, corrected = earlier(late_steps), earlier(late_steps - 4)
    chosen = most_like(found, chain_terms(found, first), (corrected, as_recorded))
    assert chosen is (corrected if late_steps else as_recorded)


def test_a_set_without_commands_is_said_to_have_none():
    with_commands, without = recorded(1), replace(recorded(2), command=None)
    assert command_notes([with_commands], [with_commands], "monday", "friday") == ()
    (note,) = command_notes([without], [with_commands], "monday", "friday")
    assert note.startswith("monday has no commands")


def late(amount_s: float, sd_s: float) -> Finding:
    """Stamps of the commands that are late (positive) or early."""
    length = abs(amount_s)
    parameters = (Estimate("T_d", length, "s", length - 1.96 * sd_s, length + 1.96 * sd_s),)
    return Finding("delay", "established", parameters=parameters, channels=("command",), late_s=amount_s)


def test_a_clock_that_was_early_and_is_late_changed_by_both():
    (change,) = mistakes_that_differ((late(-0.009, 0.003),), (late(0.011, 0.003),))
    assert change.parameters[0].value == pytest.approx(0.020) and change.parameters[0].low > 0.0


def test_a_clock_that_both_sets_have_late_did_not_change():
    assert mistakes_that_differ((late(0.009, 0.003),), (late(0.011, 0.003),)) == ()


def test_a_vibration_in_other_columns_is_no_change():
    sizes = [(Estimate("f", f_hz, "Hz", f_hz - 0.1, f_hz + 0.1),) for f_hz in (80.0, 90.0)]
    first, second = (
        Finding("vibration", "established", channels=(c,), parameters=own)
        for c, own in zip(("moment_x", "moment_y"), sizes, strict=True)
    )
    assert mistakes_that_differ((first,), (second,)) == ()
