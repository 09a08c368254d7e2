"""Gradient boosting of the residual on the regime variables, read by permutation importance.

A black box names no physics: what a channel is found to depend on is read as the effect that a textbook would put
there (`READING`). A channel counts when half-kept training blocks are predicted better than by nothing.
"""

import numpy as np

from rotorid_proof.peers.problem import Answer, Problem, fit

WORTH = 0.05
"""Share of a channel's squares that must be predicted on the blocks kept back."""
MOST_ROWS = 4000
READING = {
    ("force_xy", "forward_speed_m_s"): "rotor_drag",
    ("force_xy", "sideward_speed_m_s"): "rotor_drag",
    ("force_xy", "airspeed_m_s"): "rotor_drag",
    ("force_xy", "rotor_speed_rad_s"): "thrust_tilt",
    ("force_xy", "tilt_rad"): "accelerometer_error",
    ("force_xy", "body_rate_rad_s"): "imu_lever_arm",
    ("force_z", "airspeed_m_s"): "translational_lift",
    ("force_z", "forward_speed_m_s"): "translational_lift",
    ("force_z", "sideward_speed_m_s"): "translational_lift",
    ("force_z", "vertical_speed_over_hover_inflow"): "axial_inflow",
    ("force_z", "height_over_rotor_radius"): "ground_effect",
    ("force_z", "rotor_speed_rad_s"): "thrust_curve",
    ("force_z", "rotor_acceleration_rad_s2"): "motor_lag",
    ("force_z", "battery_voltage_v"): "battery_sag",
    ("moment_xy", "rotor_speed_rad_s"): "com_offset",
    ("moment_xy", "forward_speed_m_s"): "flapping_moment",
    ("moment_xy", "sideward_speed_m_s"): "flapping_moment",
    ("moment_xy", "airspeed_m_s"): "flapping_moment",
    ("moment_xy", "body_rate_rad_s"): "rotational_damping",
    ("moment_xy", "rotor_acceleration_rad_s2"): "delay",
    ("moment_z", "rotor_acceleration_rad_s2"): "rotor_acceleration_torque",
    ("moment_z", "body_rate_rad_s"): "rotational_damping",
    ("moment_z", "rotor_speed_rad_s"): "unequal_rotors",
}


def ask(problem: Problem) -> Answer:
    """Fit each channel's residual, read what it depends on most."""
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.inspection import permutation_importance

    columns, beta, _ = fit(problem, [], problem.training)
    left = problem.y - problem.x[:, :, columns] @ beta
    names = list(problem.regime)
    features = np.stack([problem.regime[name] for name in names], axis=1)
    half = problem.block % 4 == 0
    rng = np.random.default_rng(0)
    after, found = left.copy(), {}
    for c, channel in enumerate(problem.channels):
        learn, check = np.flatnonzero(problem.training & ~half), np.flatnonzero(problem.training & half)
        learn = rng.permutation(learn)[:MOST_ROWS]
        model = HistGradientBoostingRegressor(max_iter=60, max_leaf_nodes=15, random_state=0)
        model.fit(features[learn], left[learn, c])
        share = 1 - np.mean((left[check, c] - model.predict(features[check])) ** 2) / np.mean(left[check, c] ** 2)
        if not share > WORTH:
            continue
        after[:, c] = left[:, c] - model.predict(features)
        kept = rng.permutation(check)[:1500]
        importance = permutation_importance(model, features[kept], left[kept, c], n_repeats=2, random_state=0)
        name = names[int(np.argmax(importance.importances_mean))]
        place = channel if channel.endswith("z") else f"{channel.split('_')[0]}_xy"
        effect = READING.get((place, name))
        if effect:
            found[effect] = min(found.get(effect, 1.0), float(1 - min(share, 1.0)))
    return Answer(found=found, values={}, refitted=left, after=after)
