"""White box: rotor coefficients, mass properties and the thesis's attitude-control simulation."""

THESIS_VEHICLE = "raw/vehicle/thesis.yaml"


def ingested_if_recorded(kind, instrument):
    """Samples and recordings of one kind of test and instrument; nothing where the index lists too few."""
    return ingested(kind, instrument) if (kind, instrument) in KINDS_RECORDED else []


rule fit_white_box:
    """C_F and C_Q from the rotor tests, mass and inertia from the components."""
    message:
        "White box: rotor coefficients and mass properties"
    input:
        thrust_tests=ingested_if_recorded("thrust", "rotor"),
        torque_tests=ingested_if_recorded("torque", "rotor"),
        torque_wrench=ingested_if_recorded("torque", "wrench"),
        components="raw/vehicle/components.csv",
    output:
        thrust="results/white_box/thrust_points.csv",
        torque="results/white_box/torque_points.csv",
        parameters="results/white_box/parameters.json",
        table="results/white_box/parameters.csv",
    params:
        code=code_of("fit_white_box"),
    log:
        "results/logs/fit_white_box.log",
    script:
        "../scripts/fit_white_box.py"


rule simulate_attitude:
    """The attitude-control simulation of the thesis."""
    message:
        "White box: attitude-control simulation"
    input:
        vehicle=THESIS_VEHICLE,
    output:
        flight="results/white_box/attitude.csv",
        summary="results/white_box/attitude.json",
    params:
        duration_s=CONFIG.simulation.duration_s,
        step_s=CONFIG.simulation.step_s,
        moment_n_m=CONFIG.simulation.moment_n_m,
        correlation_s=CONFIG.simulation.correlation_s,
        rate_noise=CONFIG.simulation.rate_noise_rad_s,
        acceleration_noise=CONFIG.simulation.acceleration_noise_rad_s2,
        seed=CONFIG.simulation.seed,
        code=code_of("simulate_attitude"),
    log:
        "results/logs/simulate_attitude.log",
    # First of all: the simulator is compiled once, and kept for whatever else flies.
    priority: 1
    script:
        "../scripts/simulate_attitude.py"


rule chapter_white_box:
    """Figures and tables of the white-box chapter."""
    message:
        "Chapter white box: figures and tables"
    input:
        notebook="notebooks/white_box.ipynb",
        thrust=rules.fit_white_box.output.thrust,
        torque=rules.fit_white_box.output.torque,
        parameters=rules.fit_white_box.output.parameters,
        compared=rules.fit_white_box.output.table,
        components="raw/vehicle/components.csv",
        flight=rules.simulate_attitude.output.flight,
        summary=rules.simulate_attitude.output.summary,
    output:
        control=report(
            "results/report/white_box/control.svg",
            category="White box",
            caption="../report/captions/white_box.rst",
            labels={"figure": "controller"},
        ),
        parts="results/report/white_box/parts.csv",
        rotor=report(
            "results/report/white_box/rotor.svg",
            category="White box",
            caption="../report/captions/white_box.rst",
            labels={"figure": "rotor"},
        ),
        attitude=report(
            "results/report/white_box/attitude.svg",
            category="White box",
            caption="../report/captions/white_box.rst",
            labels={"figure": "attitude"},
        ),
        motion=report(
            "results/report/white_box/motion.svg",
            category="White box",
            caption="../report/captions/white_box.rst",
            labels={"figure": "motion"},
        ),
        view=report(
            "results/report/white_box/view.svg",
            category="White box",
            caption="../report/captions/white_box.rst",
            labels={"figure": "view"},
        ),
        moving="results/report/white_box/moving.svg",
    params:
        code=code_of_chapter("white_box"),
    log:
        "results/logs/chapter_white_box/run.log",
        notebook="results/notebooks/white_box.ipynb",
    script:
        "../scripts/run_notebook.py"
