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
    """From force to strain, volts and counts of one cell, against the thesis's calibration."""
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


rule chapter_fem:
    """Figures and tables of the chapter on finite elements."""
    message:
        "Chapter fem: figures and tables"
    input:
        notebook="notebooks/fem.ipynb",
        bench=rules.solve_bench.output.bench,
        loads=rules.solve_bench.output.loads,
        study=rules.solve_bench.output.meshes,
        surface=rules.solve_bench.output.surface,
        benches=rules.vary_bench_sizes.output.benches,
        judged=rules.vary_bench_sizes.output.statements,
        checked=rules.verify_elasticity.output.verification,
        chain=rules.follow_signal_chain.output.chain,
        variants=rules.follow_signal_chain.output.variants,
        calibration=rules.calibrate_load_cells.output.coefficients,
    output:
        model=report(
            "results/report/fem/model.svg",
            category="Finite elements",
            caption="../report/captions/fem.rst",
            labels={"figure": "the model"},
        ),
        deformation=report(
            "results/report/fem/deformation.svg",
            category="Finite elements",
            caption="../report/captions/fem.rst",
            labels={"figure": "deformation"},
        ),
        stress=report(
            "results/report/fem/stress.svg",
            category="Finite elements",
            caption="../report/captions/fem.rst",
            labels={"figure": "stress"},
        ),
        lines=report(
            "results/report/fem/lines.svg",
            category="Finite elements",
            caption="../report/captions/fem.rst",
            labels={"figure": "against the load"},
        ),
        ratios=report(
            "results/report/fem/ratios.svg",
            category="Finite elements",
            caption="../report/captions/fem.rst",
            labels={"figure": "over the assumed sizes"},
        ),
        sensitivity=report(
            "results/report/fem/sensitivity.svg",
            category="Finite elements",
            caption="../report/captions/fem.rst",
            labels={"figure": "sensitivity of a cell"},
        ),
        verification="results/report/fem/verification.csv",
        meshes="results/report/fem/meshes.csv",
        parts="results/report/fem/parts.csv",
        statements="results/report/fem/statements.csv",
        chain_steps="results/report/fem/chain_steps.csv",
    params:
        code=code_of_chapter("fem"),
    log:
        "results/logs/chapter_fem/run.log",
        notebook="results/notebooks/fem.ipynb",
    script:
        "../scripts/run_notebook.py"
