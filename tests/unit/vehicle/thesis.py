"""The thesis's vehicle for the tests (table 4.1, contract numbering)."""

from rotorid.recordings.vehicle import Vehicle

D = 0.0884


def thesis_vehicle(**changes) -> Vehicle:
    values = dict(
        name="thesis",
        kind="flight",
        mass_kg=0.652,
        inertia_kg_m2=dict(xx=2.489e-3, yy=2.5743e-3, zz=4.6838e-3),
        rotors=[
            dict(x_m=D, y_m=D, spin="ccw"),
            dict(x_m=D, y_m=-D, spin="cw"),
            dict(x_m=-D, y_m=-D, spin="ccw"),
            dict(x_m=-D, y_m=D, spin="cw"),
        ],
        thrust_coefficient_n_s2=1.3877e-6,
        torque_coefficient_n_m_s2=1.8558e-8,
    )
    return Vehicle.model_validate(values | changes)
