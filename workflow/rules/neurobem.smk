"""The NeuroBEM flights against the plain rigid body and against NeuroBEM's own prediction."""


rule neurobem_residuals:
    """Force and moment that the rigid body leaves over, by flight and by airspeed."""
    message:
        "NeuroBEM flights: rigid-body residuals"
    input:
        recordings=public_set("neurobem"),
    output:
        summary="results/neurobem/residuals.json",
        flights="results/neurobem/flights.csv",
        bins="results/neurobem/by_airspeed.csv",
        points="results/neurobem/points.csv",
    params:
        cutoff_hz=CONFIG.residuals.cutoff_hz,
        airspeed_bin_m_s=CONFIG.residuals.airspeed_bin_m_s,
        block_s=CONFIG.residuals.block_s,
        seed=CONFIG.residuals.seed,
        code=code_of("neurobem_residuals"),
    log:
        "results/logs/neurobem_residuals.log",
    script:
        "../scripts/neurobem_residuals.py"


rule chapter_neurobem:
    """Figures and tables of the NeuroBEM chapter."""
    message:
        "Chapter NeuroBEM: figures and tables"
    input:
        notebook="notebooks/neurobem.ipynb",
        summary=rules.neurobem_residuals.output.summary,
        flights=rules.neurobem_residuals.output.flights,
        bins=rules.neurobem_residuals.output.bins,
        points=rules.neurobem_residuals.output.points,
    output:
        airspeed=report(
            "results/report/neurobem/airspeed.svg",
            category="Fast flight",
            caption="../report/captions/neurobem.rst",
            labels={"figure": "airspeed"},
        ),
        rmse=report(
            "results/report/neurobem/rmse.svg",
            category="Fast flight",
            caption="../report/captions/neurobem.rst",
            labels={"figure": "rmse"},
        ),
        by_flight="results/report/neurobem/by_flight.csv",
    params:
        code=code_of_chapter("neurobem"),
    log:
        "results/logs/chapter_neurobem/run.log",
        notebook="results/notebooks/neurobem.ipynb",
    script:
        "../scripts/run_notebook.py"
