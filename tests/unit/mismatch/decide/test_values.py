"""Which believed values are wrong, given the gains that a flight shows."""

import numpy as np
import pytest

from rotorid.mismatch.decide.problem import GAINS, LogGain, Prior, called_wrong, in_place, options_of, same_ratio

TRUST = {"mass": 0.02, "thrust": 0.1, "torque": 0.2, "arm": 0.03} | {f"inertia_{a}{a}": 0.15 for a in "xyz"}
LEAST_NATS = float(np.log(99.0))


def options(logs, sd=0.01, trust=TRUST):
    """Of gains that a flight shows each to `sd`."""
    sds = np.broadcast_to(sd, len(logs))
    gains = {key: LogGain(log, float(s) ** 2) for key, log, s in zip(GAINS, logs, sds, strict=True)}
    return options_of(gains, trust, Prior())


@pytest.mark.parametrize(
    ("logs", "sd", "wrong"),
    [
        ([0.0, 0.01, -0.01, 0.0], 0.01, set()),
        ([-0.15, -0.15, -0.15, 0.0], 0.01, {"thrust"}),
        ([-0.15, 0.0, 0.0, 0.0], 0.01, {"mass"}),
        ([0.0, -0.7, 0.0, 0.0], [0.01, 0.35, 0.01, 0.01], set()),
        ([0.0, -0.05, 0.0, 0.0], 0.01, set()),  # ten times more probable, of 99 times that are asked for
    ],
    ids=[
        "as believed", "a thrust coefficient changes the moments too", "a mass the thrust alone", "hardly shown",
        "not sure",
    ],
)  # fmt: skip
def test_what_gains_call_wrong(logs, sd, wrong):
    assert called_wrong(options(logs, sd), LEAST_NATS) == wrong


def test_its_number_is_relative_and_shrinks_by_no_more_than_its_error():
    found = options([0.0, -0.3, 0.0, 0.0])
    assert called_wrong(found, LEAST_NATS) == {"inertia_xx"}
    change, sd = found[frozenset({"inertia_xx"})].changes["inertia_xx"]
    assert change == pytest.approx(np.expm1(0.3), abs=2 * sd) and sd == pytest.approx(0.0135, rel=0.2)


def test_members_of_one_ratio_stand_in_place_of_each_other():
    found = options([0.0, 0.0, 0.0, 0.3])
    wrong = called_wrong(found, LEAST_NATS)
    assert len(wrong) == 1 and wrong < {"torque", "inertia_zz"}
    assert set(same_ratio(wrong, TRUST)) == {frozenset({"torque"}), frozenset({"inertia_zz"})}
    (key,) = wrong
    others = [set(other) for other in in_place(found, wrong, LEAST_NATS)[key]]
    assert others == [{"torque", "inertia_zz"} - wrong]


def test_both_inertias_stand_in_place_of_an_arm_and_neither_alone():
    found = options([0.0, 0.25, 0.25, 0.0], trust={**TRUST, "arm": 0.15})
    assert called_wrong(found, LEAST_NATS) == {"arm"}
    first, *others = (set(x) for x in in_place(found, frozenset({"arm"}), LEAST_NATS)["arm"])
    assert first == {"inertia_xx", "inertia_yy"}
    assert others == [{"mass", "thrust"}]  # as much heavier as its thrust is more


def test_a_refused_value_leaves_room_for_the_other_of_its_ratio():
    found = options([0.0, 0.0, 0.0, 0.3])
    first = called_wrong(found, LEAST_NATS)
    second = called_wrong(found, LEAST_NATS, refused=sorted(first))
    assert second and not second & first


def test_without_gains_or_values_nothing_is_wrong():
    assert called_wrong(options_of({}, TRUST, Prior()), LEAST_NATS) == frozenset()
    assert called_wrong(options_of({"mass": LogGain(-0.2, 1e-4)}, {}, Prior()), LEAST_NATS) == frozenset()


def test_gains_that_are_not_known_say_nothing():
    only_thrust = options_of({"mass": LogGain(-0.2, 1e-4)}, TRUST, Prior())
    assert called_wrong(only_thrust, LEAST_NATS) in ({"mass"}, {"thrust"})


def test_moments_that_are_all_larger_alike_are_a_heavier_vehicle_where_commands_alone_are_known():
    """Thrust is then what lifts the believed mass. An arm and a torque coefficient say the same by two numbers."""
    trust = {k: v for k, v in TRUST.items() if k not in ("mass", "thrust")} | {"lifted": 0.02}
    moments = {key: LogGain(0.15, 1e-4) for key in GAINS if key != "mass"}
    found = options_of(moments, trust, Prior())
    assert called_wrong(found, LEAST_NATS) == {"lifted"}
    assert {"arm", "torque"} in [set(other) for other in in_place(found, frozenset({"lifted"}), LEAST_NATS)["lifted"]]
    roll_alone = options_of({**moments, **dict.fromkeys(GAINS[2:], LogGain(0.0, 1e-4))}, trust, Prior())
    assert called_wrong(roll_alone, LEAST_NATS) == {"inertia_xx"}
