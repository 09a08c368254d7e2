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
        thrust_points=rules.fit_white_box.output.thrust,
        vehicle=THESIS_VEHICLE,
    output:
        **{key: directory(folder) for key, folder in STAND_SETS.items()},
        clocks="results/stand/clocks.csv",
        summary="results/stand/clocks.json",
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


rule evaluate_stand:
    """Steady wrenches of the 48 experiments, the weight under tilt, the rotor's characteristics."""
    message:
        "Stand: steady wrenches and characteristics"
    input:
        recordings=STAND_SETS["dynamics"],
        sessions="results/ingest/dynamics/wrench.csv",
        thrust=rules.fit_white_box.output.thrust,
        torque=rules.fit_white_box.output.torque,
        parameters=rules.fit_white_box.output.parameters,
    output:
        experiments="results/stand/experiments.csv",
        weight="results/stand/weight.json",
        characteristic="results/stand/characteristic.json",
        speed="results/stand/speed.csv",
    params:
        code=code_of("evaluate_stand"),
    log:
        "results/logs/evaluate_stand.log",
    script:
        "../scripts/evaluate_stand.py"


rule chapter_stand:
    """Figures and tables of the stand chapter."""
    message:
        "Chapter stand: figures and tables"
    input:
        notebook="notebooks/stand.ipynb",
        quadrotor="results/ingest/dynamics/quadrotor.parquet",
        wrench="results/ingest/dynamics/wrench.parquet",
        recordings=STAND_SETS["dynamics"],
        clock_table=rules.stand_recordings.output.clocks,
        summary=rules.stand_recordings.output.summary,
        experiments=rules.evaluate_stand.output.experiments,
        weight=rules.evaluate_stand.output.weight,
        characteristic=rules.evaluate_stand.output.characteristic,
        speed=rules.evaluate_stand.output.speed,
        thrust=rules.fit_white_box.output.thrust,
        torque=rules.fit_white_box.output.torque,
    output:
        clocks=report(
            "results/report/stand/clocks.svg",
            category="Stand",
            caption="../report/captions/stand.rst",
            labels={"figure": "clocks"},
        ),
        experiment=report(
            "results/report/stand/experiment.svg",
            category="Stand",
            caption="../report/captions/stand.rst",
            labels={"figure": "experiment"},
        ),
        steady=report(
            "results/report/stand/steady.svg",
            category="Stand",
            caption="../report/captions/stand.rst",
            labels={"figure": "steady"},
        ),
        weight_figure=report(
            "results/report/stand/weight_figure.svg",
            category="Stand",
            caption="../report/captions/stand.rst",
            labels={"figure": "weight"},
        ),
        characteristics=report(
            "results/report/stand/characteristics.svg",
            category="Stand",
            caption="../report/captions/stand.rst",
            labels={"figure": "characteristics"},
        ),
        means="results/report/stand/means.csv",
        parameters="results/report/stand/parameters.csv",
    params:
        code=code_of_chapter("stand"),
    log:
        "results/logs/chapter_stand/run.log",
        notebook="results/notebooks/stand.ipynb",
    script:
        "../scripts/run_notebook.py"
