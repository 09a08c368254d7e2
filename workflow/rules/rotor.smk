"""Thrust coefficients of propellers from the stand runs of another laboratory."""


rule fit_rotor_coefficients:
    """C_F of each motor and propeller, and of each propeller over its motors."""
    message:
        "Rotor: thrust coefficients"
    input:
        sets=[public_set(name) for name in PUBLIC_SETS_OF["strawson-5inch-bench"] if not of_one_motor(name)],
    output:
        summary="results/rotor/coefficients.json",
        motors="results/rotor/motors.csv",
        points="results/rotor/points.csv",
    params:
        speed_noise_relative=CONFIG.rotor.speed_noise_relative,
        outlying_above=CONFIG.rotor.outlying_above,
        code=code_of("fit_rotor_coefficients"),
    log:
        "results/logs/fit_rotor_coefficients.log",
    script:
        "../scripts/fit_rotor_coefficients.py"


rule chapter_rotor_coefficients:
    """Figures and tables of the rotor chapter."""
    message:
        "Chapter rotor coefficients: figures and tables"
    input:
        notebook="notebooks/rotor_coefficients.ipynb",
        summary=rules.fit_rotor_coefficients.output.summary,
        motors=rules.fit_rotor_coefficients.output.motors,
        points=rules.fit_rotor_coefficients.output.points,
    output:
        apparent=report(
            "results/report/rotor_coefficients/apparent.svg",
            category="Thrust coefficients",
            caption="../report/captions/rotor_coefficients.rst",
            labels={"figure": "apparent"},
        ),
        by_motor=report(
            "results/report/rotor_coefficients/by_motor.svg",
            category="Thrust coefficients",
            caption="../report/captions/rotor_coefficients.rst",
            labels={"figure": "by motor"},
        ),
        pooled="results/report/rotor_coefficients/pooled.csv",
    params:
        code=code_of_chapter("rotor_coefficients"),
    log:
        "results/logs/chapter_rotor_coefficients/run.log",
        notebook="results/notebooks/rotor_coefficients.ipynb",
    script:
        "../scripts/run_notebook.py"
