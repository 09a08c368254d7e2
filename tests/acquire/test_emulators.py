"""The physics behind the emulated instruments, against numbers computed by hand."""

import math

import numpy as np
import pytest

from rotorid_acquire.emulators.devices import programme_share
from rotorid_acquire.emulators.physics import (
    GAUGE_MM,
    SECTION_MM2,
    Battery,
    BenchPhysics,
    LoadCells,
    Oscillator,
    StandPhysics,
    TensilePhysics,
    TurningRotors,
    tilt_matrix,
)
from rotorid_acquire.emulators.ports import build
from rotorid_acquire.emulators.truth import (
    GF_N,
    BatteryTruth,
    BenchTruth,
    CellsTruth,
    M,
    RotorTruth,
    SensorTruth,
    Truth,
    VehicleTruth,
    body_forces,
    cell_forces,
    cell_response,
    draw_truth,
    read_truth,
    write_truth,
)
from rotorid_acquire.io.wire import EXPERIMENTS, GREEN, RED, SINE, TRAPEZOID, YELLOW, Programme
from rotorid_acquire.procedures import Steadiness, SteadyRule, programme_of

RNG = np.random.default_rng


def test_geometry_by_hand():
    # eq. 2.9, row x, cell 3: D_135z / L = 21.2 / 225; row z: −1 / cos 45°
    assert M[0, 2] == pytest.approx(21.2 / 225) and M[0, 0] == pytest.approx(-2 * 21.2 / 225)
    assert M[1, 3] == pytest.approx((48.126099 - 50.457916) / (225 * math.sqrt(0.5)))
    assert body_forces(np.ones(6))[2] == pytest.approx(-3 - 3 * math.sqrt(2))


@pytest.mark.parametrize(("axis", "force"), [(0, [2.0, 0, 0]), (1, [0, 3.0, 0]), (2, [0, 0, -4.0])])
def test_the_emulated_bench_inverts_the_equations_along_one_axis(axis, force):
    cells = cell_response()[:, axis] * abs(force[axis])
    read = body_forces(cells)
    assert read[axis] == pytest.approx(force[axis])
    if axis == 2:  # along x and y the equations also give a z that is not there
        assert read[:2] == pytest.approx([0, 0], abs=1e-12)


def test_an_ideal_cell_reads_the_thesis_regression():
    # table 2.8, cell 1: y = −0.0829 + 39.7571 x, x in 1e-5 V; a load of 500 gf gives x = 500.0829/39.7571
    cells = LoadCells(CellsTruth(), RNG(0))
    cells.process(0.02, np.full(6, 500 * GF_N))
    assert cells.volts()[0] * 1e5 == pytest.approx(500.0829 / 39.7571, rel=1e-9)
    np.testing.assert_allclose(cell_forces(cells.volts()) / GF_N, 500, rtol=1e-9)


def test_creep_drift_hysteresis_and_overload():
    truth = CellsTruth(
        seat_v=[0] * 6, creep_share=[1e-3] * 6, creep_s=[100] * 6, drift_v_s=[1e-9] * 6, overload_loss=0.1
    )
    gain = 1e-5 / 39.7571 / GF_N
    cells = LoadCells(truth, RNG(0))
    cells.process(100.0, np.full(6, 5.0))  # one time constant: 63.2 % of 5 mN; drift 0.1 µV
    assert cells.volts()[0] == pytest.approx(gain * (5 + 0.005 * (1 - math.exp(-1))) + 1e-7, rel=1e-9)
    over = LoadCells(CellsTruth(seat_v=[0] * 6, overload_loss=0.1), RNG(0))
    over.process(0.1, np.full(6, 11.81))  # two newtons beyond the rated 9.81 lose a tenth
    assert over.volts()[0] == pytest.approx(gain * (11.81 - 0.2), rel=1e-9)
    loop = LoadCells(CellsTruth(seat_v=[0] * 6, backlash_n=[0.01] * 6), RNG(0))
    loop.process(0.1, np.full(6, 3.0))
    up = loop.volts()[0]
    loop.process(0.1, np.full(6, 6.0))
    loop.process(0.1, np.full(6, 3.0))
    assert (loop.volts()[0] - up) / gain == pytest.approx(0.02)


def test_oscillator_rings_at_its_frequency_and_settles():
    oscillator = Oscillator(1, 10.0, 0.05)
    values = [oscillator.process(0.001, np.ones(1))[0] for _ in range(3000)]
    # first peak of a step response: 1 + exp(−πζ/√(1−ζ²)), after half a damped period of 50 ms
    assert max(values) == pytest.approx(1 + math.exp(-math.pi * 0.05 / math.sqrt(1 - 0.05**2)), abs=1e-4)
    assert np.argmax(values) + 1 == pytest.approx(50, abs=1)
    assert values[-1] == pytest.approx(1.0, abs=1e-3)


def test_one_long_step_equals_many_short_ones():
    short, long = Oscillator(1, 7.0, 0.1), Oscillator(1, 7.0, 0.1)
    for _ in range(100):
        short.process(0.0005, np.ones(1))
    long.process(0.05, np.ones(1))
    assert short.position[0] == pytest.approx(long.position[0], rel=1e-9)


def test_pla_reads_ever_further_off_and_aluminium_less():
    def error_gf(material, load_gf):
        physics = BenchPhysics(CellsTruth(), material, RNG(3))
        physics.place_load("z", load_gf)
        physics.process(10.0)
        return -body_forces(cell_forces(physics.volts()))[2] / GF_N - load_gf

    pla, aluminium = draw_truth(1).bench["pla"], draw_truth(1).bench["al"]
    errors = [error_gf(pla, load) for load in (250, 500, 950)]
    assert errors[0] < errors[1] < errors[2] and errors[2] > 20
    assert error_gf(pla, 950) > 5 * abs(error_gf(aluminium, 950))
    assert abs(error_gf(BenchTruth(), 500)) < 1.5  # what is left is table 2.8's intercepts


def test_rotor_lag_curve_and_battery():
    truth = RotorTruth(rise_s=0.05)
    rotors = TurningRotors(truth, Battery(BatteryTruth(resistance_ohm=0.0)), 1)
    rotors.throttle[0] = 0.5
    for _ in range(50):
        rotors.process(0.001)  # 50 ms: one time constant
    assert rotors.speed[0] == pytest.approx(1829.2 * (1 - math.exp(-1)), rel=1e-6)
    rotors.process(2.0)
    assert rotors.speed[0] == pytest.approx(1829.2)
    rotors.throttle[0] = 0.4
    rotors.process(2.0)
    assert rotors.speed[0] == pytest.approx(1575.2, rel=2e-3)  # appendix A.1: the torque set's highest speed
    battery = Battery(BatteryTruth(resistance_ohm=0.03))
    battery.process(540.0, 10.0)  # 5400 C: the battery's whole charge; 10 A over 30 mΩ
    assert battery.voltage_v == pytest.approx(4 * 3.3 - 0.3)


def stand(roll=0.0, pitch=0.0, vehicle=None, speeds=(0, 0, 0, 0)):
    rotors = TurningRotors(RotorTruth(), Battery(BatteryTruth()), 4)
    rotors.speed = np.array(speeds, dtype=float)
    return StandPhysics(vehicle or VehicleTruth(), RotorTruth(), SensorTruth(), rotors, roll, pitch, RNG(0)).wrench()


def test_stand_carries_the_weight():
    # 0.652 kg × 9.81 m/s² = 6.396 N; tilted by 30° about x, the mass stands 45 mm sin 30° to the right
    np.testing.assert_allclose(stand(), [0, 0, 6.39612, 0, 0, 0], atol=1e-9)
    tilted = stand(roll=30.0)
    np.testing.assert_allclose(tilted[:3], [0, 0, 6.39612], atol=1e-9)
    assert tilted[3] == pytest.approx(0.045 * 0.5 * 6.39612)


def test_stand_feels_thrust_and_torques_in_the_thesis_signs():
    speeds = np.array([1000.0, 800, 900, 700])
    force, torque = 1.3877e-6 * speeds**2, 1.8558e-8 * speeds**2
    wrench = stand(speeds=speeds)
    roll, pitch = np.array([[-1, 1, 1, -1], [1, 1, -1, -1]]) @ force * 0.0884
    expected = [0, 0, 6.39612 - force.sum(), roll, pitch, torque @ [1, -1, 1, -1]]
    np.testing.assert_allclose(wrench, expected, atol=1e-12)


def test_thrust_turns_with_the_mount():
    # pitched nose up by 15°, thrust pulls backwards
    thrust = 4 * 1.3877e-6 * 1000**2
    wrench = stand(pitch=15.0, speeds=[1000.0] * 4)
    assert wrench[0] == pytest.approx(-thrust * math.sin(math.radians(15)))
    right = stand(roll=15.0, speeds=[1000.0] * 4)
    assert right[1] == pytest.approx(thrust * math.sin(math.radians(15)))


def test_com_offset_moves_the_weight_only():
    moved = VehicleTruth(com_offset_m=[0.003, 0, 0])
    difference = stand(vehicle=moved, speeds=[1000.0] * 4) - stand(speeds=[1000.0] * 4)
    # x × (weight along +z) = −x m g about y
    np.testing.assert_allclose(difference, [0, 0, 0, 0, -0.003 * 6.39612, 0], atol=1e-12)


def test_tilt_matrix_is_a_rotation():
    rotation = tilt_matrix(0.3, -0.5)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("infill", [25, 50, 75, 100])
def test_specimen_has_the_thesis_properties(infill):
    plastic = Truth().plastic[infill]
    physics = TensilePhysics(plastic, 1.0, 0.0, RNG(0))
    physics.moving = True
    strain, stress = [], []
    while not physics.broken:
        physics.process(0.01)
        strain.append(physics.displacement_mm / GAUGE_MM)
        stress.append(physics.force_n() / SECTION_MM2 * 1e6)
    strain, stress = np.array(strain), np.array(stress)
    elastic = (stress > 1e6) & (stress < 0.55 * plastic.yield_pa) & (strain < 0.01)
    assert np.polyfit(strain[elastic], stress[elastic], 1)[0] == pytest.approx(plastic.modulus_pa, rel=0.01)
    assert stress.max() == pytest.approx(plastic.ultimate_pa, rel=0.005)
    line = plastic.modulus_pa * (strain - 0.002)
    crossing = stress[np.flatnonzero((line > stress) & (strain > 0.003))[0]]
    assert crossing == pytest.approx(plastic.yield_pa, rel=0.01)


def test_programmes():
    trapezoid = Programme(TRAPEZOID, (0.2,) * 4, 2.0, 4.0, 0.0)
    assert programme_share(trapezoid, 1.0) == (0.5, YELLOW)
    assert programme_share(trapezoid, 3.0) == (1.0, GREEN)
    assert programme_share(trapezoid, 7.5) == (0.25, YELLOW)
    assert programme_share(trapezoid, 8.5) == (0.0, RED)
    sine = Programme(SINE, (0.2,) * 4, 0.0, 20.0, 0.25)
    assert programme_share(sine, 2.0)[0] == pytest.approx(1.0)  # half a period
    assert programme_share(sine, 4.0)[0] == pytest.approx(0.0)
    assert Programme.unpack(trapezoid.pack()) == trapezoid
    assert programme_of(EXPERIMENTS[22]) == ("b", Programme(SINE, (0.2,) * 4, 0.0, 20.0, 0.25))
    assert programme_of(EXPERIMENTS[48])[0] == "t" and programme_of(EXPERIMENTS[16])[0] == "y"


def test_truth_keeps_the_thesis_and_round_trips(tmp_path):
    truth = draw_truth(7)
    assert truth.rotor.thrust_coefficient_n_s2 == 1.3877e-6
    assert truth.rotor.torque_coefficient_n_m_s2 == 1.8558e-8
    assert (truth.vehicle.mass_kg, truth.vehicle.arm_m) == (0.652, 0.0884)
    assert truth.plastic[100].modulus_pa == 1.9482e9 and truth == draw_truth(7) != draw_truth(8)
    write_truth(truth, tmp_path / "sealed" / "truth.yaml", 7)
    assert read_truth(tmp_path / "sealed" / "truth.yaml") == truth


def test_low_pass_and_steadiness():
    slow = Steadiness(SteadyRule(1.0, 3, 0.5), 1 / (2 * math.pi))  # α = 1 − 1/e
    assert [slow.update((x,)) for x in (0.0, 1.0)] == [False, False]
    assert slow.spans() == pytest.approx([1 - math.exp(-1)])
    steady = Steadiness(SteadyRule(1e9, 3, 0.5), 1.0)  # lets everything pass
    assert [steady.update((x,)) for x in (0.0, 1.0, 1.2, 1.4, 1.9)] == [False, False, False, True, False]


def test_one_cell_alone_takes_a_load_from_the_command_line():
    """Clamped for its calibration, the load is its own; the other five hang unloaded."""
    ideal = Truth()
    world = build("bench", ideal, cell=3)
    world.physics.process(1.0)
    rest = world.physics.volts()
    world.physics.place_load("z", 500.48)
    world.physics.process(5.0)
    moved = world.physics.volts() - rest
    assert moved[2] == pytest.approx(500.48 * ideal.cells.volts_per_gf[2], rel=1e-3)
    assert np.abs(np.delete(moved, 2)).max() == 0
    for what, cell in (("bench", 7), ("rotor", 1)):
        with pytest.raises(ValueError, match="a cell is one of the bench"):
            build(what, ideal, cell=cell)
