"""The vehicle on the six-axis sensor: one clock, mean wrenches, rotor characteristics."""

STAND_SETS = {
    "dynamics": "results/recordings/campaign-stand",
    "torque": "results/recordings/campaign-torque",
    "thrust": "results/recordings/campaign-thrust",
}
CAMPAIGN_SETS = sorted(Path(folder).name for folder in (*BENCH_SETS.values(), *STAND_SETS.values()))


rule stand_recordings:
    """The stand's tests as recording sets."""
    message:
        "Stand: tests as recording sets"
    input:
        quadrotor=ingested("dynamics", "quadrotor"),
        wrench=ingested("dynamics", "wrench"),
        torque_rotor=ingested("torque", "rotor"),
        torque_wrench=ingested("torque", "wrench"),
        thrust=ingested("thrust", "rotor"),
        vehicle="raw/vehicle/thesis.yaml",
    output:
        **{key: directory(folder) for key, folder in STAND_SETS.items()},
    params:
        clock_error=CONFIG.stand.clock_error,
        force_noise_n=CONFIG.stand.force_noise_n,
        moment_noise_n_m=CONFIG.stand.moment_noise_n_m,
        thrust_noise_n=CONFIG.stand.thrust_noise_n,
        speed_noise_relative=CONFIG.stand.speed_noise_relative,
        code=code_of("stand_recordings"),
    log:
        "results/logs/stand_recordings.log",
    script:
        "../scripts/stand_recordings.py"


rule campaign_sets:
    """Every recording set made of the campaign."""
    input:
        [*BENCH_SETS.values(), *STAND_SETS.values()],
