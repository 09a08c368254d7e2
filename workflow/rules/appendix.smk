"""The report's back matter: the thesis item by item, the catalogue of effects, settings and what was read."""

APPENDIX_SECTIONS = ["filter", "bench", "stand", "rotor", "residuals", "simulation", "grey_box", "black_box"]


rule tabulate_appendix:
    """Settings, controller, excitation of the experiments, what was read."""
    message:
        "Appendix: tables"
    input:
        lock="requirements.lock",
        project="pyproject.toml",
        weights="raw/thesis/table_2_6.csv",
        readings="raw/thesis/table_2_7.csv",
        geometry=BENCH_GEOMETRY,
        moduli=BENCH_MODULI,
        strengths="raw/thesis/table_2_5.csv",
        coefficients="raw/thesis/table_2_8.csv",
        sizes=BENCH_SIZES,
        vehicle=THESIS_VEHICLE,
        components="raw/vehicle/components.csv",
        public=MANIFEST,
    output:
        gains="results/appendix/gains.csv",
        references="results/appendix/references.csv",
        experiments="results/appendix/experiments.csv",
        settings="results/appendix/settings.csv",
        hashes="results/appendix/hashes.csv",
        versions="results/appendix/versions.csv",
    params:
        config={name: getattr(CONFIG, name).model_dump() for name in APPENDIX_SECTIONS},
        code=code_of("tabulate_appendix"),
    log:
        "results/logs/tabulate_appendix.log",
    script:
        "../scripts/tabulate_appendix.py"


rule chapter_appendix:
    """The appendix's tables."""
    message:
        "Chapter appendix: tables"
    input:
        notebook="notebooks/appendix.ipynb",
        controller=rules.tabulate_appendix.output.gains,
        flown=rules.tabulate_appendix.output.references,
        programmes=rules.tabulate_appendix.output.experiments,
        configured=rules.tabulate_appendix.output.settings,
        read=rules.tabulate_appendix.output.hashes,
        installed=rules.tabulate_appendix.output.versions,
    output:
        gains="results/report/appendix/gains.csv",
        references="results/report/appendix/references.csv",
        experiments="results/report/appendix/experiments.csv",
        settings="results/report/appendix/settings.csv",
        hashes="results/report/appendix/hashes.csv",
        versions="results/report/appendix/versions.csv",
    params:
        code=code_of_chapter("appendix"),
    log:
        "results/logs/chapter_appendix/run.log",
        notebook="results/notebooks/appendix.ipynb",
    script:
        "../scripts/run_notebook.py"


rule chapter_catalogue:
    """Every effect with its equation, symbols and source."""
    message:
        "Chapter catalogue: table"
    input:
        notebook="notebooks/catalogue.ipynb",
    output:
        effects="results/report/catalogue/effects.csv",
    params:
        code=code_of_chapter("catalogue"),
    log:
        "results/logs/chapter_catalogue/run.log",
        notebook="results/notebooks/catalogue.ipynb",
    script:
        "../scripts/run_notebook.py"


rule chapter_thesis:
    """Each item of the thesis, its number, ours, and where it stands."""
    message:
        "Chapter thesis: table"
    input:
        notebook="notebooks/thesis.ipynb",
        calibration=rules.calibrate_load_cells.output.coefficients,
        moduli=BENCH_MODULI,
        infill="results/bench/tensile.csv",
        series="results/bench/static_series.csv",
        dynamic="results/bench/dynamic.json",
        fem="results/fem/bench.json",
        statements="results/fem/statements.json",
        white_box="results/white_box/parameters.json",
        attitude="results/white_box/attitude.json",
        rotor="results/grey_box/rotor.json",
        network="results/grey_box/inertia_network.json",
        improved="results/grey_box/inertias.json",
        validation="results/grey_box/validation.json",
        black_box="results/black_box/summary.json",
        held_out="results/black_box/held_out_scores.csv",
        experiments=rules.tabulate_appendix.output.experiments,
        gains=rules.tabulate_appendix.output.gains,
        references=rules.tabulate_appendix.output.references,
        vehicle=THESIS_VEHICLE,
        distances=BENCH_GEOMETRY,
        campaign="results/campaign/state.json",
    output:
        repeated="results/report/thesis/repeated.csv",
    params:
        code=code_of_chapter("thesis"),
    log:
        "results/logs/chapter_thesis/run.log",
        notebook="results/notebooks/thesis.ipynb",
    script:
        "../scripts/run_notebook.py"
