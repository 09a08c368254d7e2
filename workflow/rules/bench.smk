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


for bench_name, bench_folder in BENCH_SETS.items():
    bench_instrument = "jr3" if bench_name == "jr3" else "bench"

    rule:
        """Static tests of one platform as a recording set."""
        name:
            f"bench_recordings_{bench_name}"
        message:
            f"Bench: static tests on {bench_name} as a recording set"
        input:
            prepared=f"results/filtered/static/{bench_instrument}.parquet",
            recordings=f"results/ingest/static/{bench_instrument}.csv",
            calibration=rules.calibrate_campaign.output.coefficients,
            geometry=BENCH_GEOMETRY,
        output:
            folder=directory(bench_folder),
        params:
            platform=bench_name,
            noise_n=CONFIG.bench.reference_noise_n if bench_name == "jr3" else CONFIG.bench.noise_n,
            code=code_of("bench_recordings"),
        log:
            f"results/logs/bench_recordings/{bench_name}.log",
        script:
            "../scripts/bench_recordings.py"
