"""The load-cell bench: calibration from raw logs, reconstruction, static, dynamic and tensile tests."""

BENCH_GEOMETRY = "raw/thesis/table_2_3.csv"
BENCH_SETS = {name: f"results/recordings/campaign-bench-{name}" for name in ("al", "pla", "jr3")}


rule calibrate_campaign:
    """Lines of the six cells from the campaign's raw logs, and how well they hold."""
    message:
        "Calibration: load cells of the campaign"
    input:
        prepared="results/filtered/calibration/bench.parquet",
        samples="results/ingest/calibration/bench.parquet",
        recordings="results/ingest/calibration/bench.csv",
    output:
        readings="results/calibration/campaign_readings.csv",
        coefficients="results/calibration/campaign.json",
    params:
        code=code_of("calibrate_campaign"),
    log:
        "results/logs/calibrate_campaign.log",
    script:
        "../scripts/calibrate_campaign.py"


rule bench_recordings:
    """Static tests of each platform as a recording set."""
    message:
        "Bench: static tests as recording sets"
    input:
        bench=["results/filtered/static/bench.parquet", "results/ingest/static/bench.csv"],
        jr3=["results/filtered/static/jr3.parquet", "results/ingest/static/jr3.csv"],
        calibration=rules.calibrate_campaign.output.coefficients,
        geometry=BENCH_GEOMETRY,
    output:
        **{platform: directory(path) for platform, path in BENCH_SETS.items()},
    params:
        noise_n=CONFIG.bench.noise_n,
        reference_noise_n=CONFIG.bench.reference_noise_n,
        code=code_of("bench_recordings"),
    log:
        "results/logs/bench_recordings.log",
    script:
        "../scripts/bench_recordings.py"


rule reconstruct_static:
    """Force of every static recording, by the thesis's equations and by a calibration matrix."""
    message:
        "Bench: static tests"
    input:
        bench=["results/filtered/static/bench.parquet", "results/ingest/static/bench.csv"],
        jr3=["results/filtered/static/jr3.parquet", "results/ingest/static/jr3.csv"],
        combined=["results/filtered/combined/bench.parquet", "results/ingest/combined/bench.csv"],
        calibration=rules.calibrate_campaign.output.coefficients,
        geometry=BENCH_GEOMETRY,
    output:
        points="results/bench/static_points.csv",
        loads="results/bench/static_loads.csv",
        series="results/bench/static_series.csv",
        comparison="results/bench/reconstruction.json",
    params:
        matrix_largest_n=CONFIG.bench.matrix_largest_n,
        code=code_of("reconstruct_static"),
    log:
        "results/logs/reconstruct_static.log",
    script:
        "../scripts/reconstruct_static.py"


rule evaluate_dynamic:
    """Thrust over time on three platforms, three sets."""
    message:
        "Bench: dynamic tests"
    input:
        bench=["results/filtered/dynamic/bench.parquet", "results/ingest/dynamic/bench.csv"],
        jr3=["results/filtered/dynamic/jr3.parquet", "results/ingest/dynamic/jr3.csv"],
        calibration=rules.calibrate_campaign.output.coefficients,
        geometry=BENCH_GEOMETRY,
    output:
        flights="results/bench/dynamic.parquet",
        figures="results/bench/dynamic_flights.csv",
        levels="results/bench/dynamic_levels.csv",
        summary="results/bench/dynamic.json",
    params:
        code=code_of("evaluate_dynamic"),
    log:
        "results/logs/evaluate_dynamic.log",
    script:
        "../scripts/evaluate_dynamic.py"


rule evaluate_tensile:
    """Modulus, strength and yield of printed PLA by infill density."""
    message:
        "Bench: tensile tests"
    input:
        samples="results/ingest/tensile/tensile.parquet",
        recordings="results/ingest/tensile/tensile.csv",
        printed="raw/thesis/table_2_5.csv",
    output:
        specimens="results/bench/tensile_specimens.csv",
        infill="results/bench/tensile.csv",
        curves="results/bench/tensile.parquet",
    params:
        code=code_of("evaluate_tensile"),
    log:
        "results/logs/evaluate_tensile.log",
    script:
        "../scripts/evaluate_tensile.py"


rule chapter_bench:
    """Figures and tables of the bench chapter."""
    message:
        "Chapter bench: figures and tables"
    input:
        notebook="notebooks/bench.ipynb",
        campaign=rules.calibrate_campaign.output.coefficients,
        thesis=rules.calibrate_load_cells.output.coefficients,
        readings=rules.calibrate_campaign.output.readings,
        prepared="results/filtered/calibration/bench.parquet",
        recordings="results/ingest/calibration/bench.csv",
        points=rules.reconstruct_static.output.points,
        loads=rules.reconstruct_static.output.loads,
        series=rules.reconstruct_static.output.series,
        reconstruction=rules.reconstruct_static.output.comparison,
        flights=rules.evaluate_dynamic.output.flights,
        flight_figures=rules.evaluate_dynamic.output.figures,
        ratios=rules.evaluate_dynamic.output.summary,
        specimens=rules.evaluate_tensile.output.specimens,
        infill=rules.evaluate_tensile.output.infill,
        curves=rules.evaluate_tensile.output.curves,
    output:
        reading=report(
            "results/report/bench/reading.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "reading"},
        ),
        calibration=report(
            "results/report/bench/calibration.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "calibration"},
        ),
        residuals=report(
            "results/report/bench/residuals.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "residuals"},
        ),
        static_z=report(
            "results/report/bench/static_z.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "static z"},
        ),
        static_axes=report(
            "results/report/bench/static_axes.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "static axes"},
        ),
        methods=report(
            "results/report/bench/methods.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "methods"},
        ),
        dynamic=report(
            "results/report/bench/dynamic.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "dynamic"},
        ),
        tensile=report(
            "results/report/bench/tensile.svg",
            category="Load-cell bench",
            caption="../report/captions/bench.rst",
            labels={"figure": "tensile"},
        ),
        coefficients="results/report/bench/coefficients.csv",
        flagged="results/report/bench/flagged.csv",
        metrology="results/report/bench/metrology.csv",
        platforms="results/report/bench/platforms.csv",
        compared="results/report/bench/compared.csv",
        flown_table="results/report/bench/flown_table.csv",
    params:
        code=code_of_chapter("bench"),
    log:
        "results/logs/chapter_bench/run.log",
        notebook="results/notebooks/bench.ipynb",
    script:
        "../scripts/run_notebook.py"
