"""Finite elements of the load-cell bench (thesis 2.5), and the signal chain of a cell."""

BENCH_SIZES = "workflow/bench_sizes.yaml"
BENCH_MODULI = "raw/thesis/table_2_4.csv"


rule verify_elasticity:
    """The solver on problems with a known answer."""
    message:
        "Finite elements: cantilever and plate with a hole"
    output:
        verification="results/fem/verification.csv",
    params:
        code=code_of("verify_elasticity"),
    log:
        "results/logs/verify_elasticity.log",
    script:
        "../scripts/verify_elasticity.py"


rule solve_bench:
    """Deformation and stress of the bench with pieces of aluminium and of PLA, on finer and finer meshes."""
    message:
        "Finite elements: the bench, {params.mesh} mesh"
    input:
        sizes=BENCH_SIZES,
        moduli=BENCH_MODULI,
        geometry=BENCH_GEOMETRY,
        readings="raw/thesis/table_2_7.csv",
    output:
        bench="results/fem/bench.json",
        loads="results/fem/loads.csv",
        meshes="results/fem/meshes.csv",
        surface="results/fem/surface.parquet",
    params:
        mesh=CONFIG.fem.mesh,
        code=code_of("solve_bench"),
    log:
        "results/logs/solve_bench.log",
    script:
        "../scripts/solve_bench.py"


rule vary_bench_sizes:
    """The same with other assumed sizes, and which of the thesis's statements follow on how many of them."""
    message:
        "Finite elements: other sizes of the bench"
    input:
        sizes=BENCH_SIZES,
        moduli=BENCH_MODULI,
        geometry=BENCH_GEOMETRY,
    output:
        benches="results/fem/sizes.csv",
        statements="results/fem/statements.json",
    params:
        mesh=CONFIG.fem.mesh,
        draws=CONFIG.fem.draws,
        seed=CONFIG.fem.seed,
        code=code_of("vary_bench_sizes"),
    log:
        "results/logs/vary_bench_sizes.log",
    script:
        "../scripts/vary_bench_sizes.py"


rule follow_signal_chain:
    """From force to strain, volts and counts of one cell, beside the thesis's calibration."""
    message:
        "Finite elements: from strain to counts"
    input:
        sizes=BENCH_SIZES,
        moduli=BENCH_MODULI,
        calibration=rules.calibrate_load_cells.output.coefficients,
    output:
        chain="results/fem/chain.json",
        variants="results/fem/chain.csv",
    params:
        mesh=CONFIG.fem.mesh,
        code=code_of("follow_signal_chain"),
    log:
        "results/logs/follow_signal_chain.log",
    script:
        "../scripts/follow_signal_chain.py"
