"""Black box: the stand's wrench by the thesis's network, and an honest comparison."""


rule prepare_experiments:
    """The 48 dynamics experiments as samples."""
    message:
        "Black box: samples of the 48 experiments"
    input:
        quadrotor=ingested("dynamics", "quadrotor"),
        wrench=ingested("dynamics", "wrench"),
        thrust=rules.fit_white_box.output.thrust,
    output:
        experiments="results/black_box/experiments.csv",
    params:
        code=code_of("prepare_experiments"),
    log:
        "results/logs/prepare_experiments.log",
    script:
        "../scripts/prepare_experiments.py"


rule train_black_box:
    """The thesis's network and its held-out samples."""
    message:
        "Black box: training the 6-20-20-6 network"
    input:
        experiments=rules.prepare_experiments.output.experiments,
    output:
        history="results/black_box/history.csv",
        tested="results/black_box/held_out_samples.csv",
        scored="results/black_box/held_out_scores.csv",
    params:
        epochs=CONFIG.black_box.epochs,
        rate=CONFIG.black_box.rate,
        hidden=CONFIG.black_box.hidden,
        held_out=CONFIG.black_box.held_out_samples,
        seed=CONFIG.black_box.seed,
        checkpoint="results/black_box/checkpoint.npz",
        code=code_of("train_black_box"),
    log:
        "results/logs/train_black_box.log",
    script:
        "../scripts/train_black_box.py"


rule compare_black_box:
    """Models compared on whole experiments held out."""
    message:
        "Black box: comparison on whole experiments"
    input:
        experiments=rules.prepare_experiments.output.experiments,
        vehicle=THESIS_VEHICLE,
    output:
        metrics="results/black_box/metrics.csv",
        predictions="results/black_box/predictions.csv",
        summary="results/black_box/summary.json",
    params:
        epochs=CONFIG.black_box.epochs,
        rate=CONFIG.black_box.rate,
        hidden=CONFIG.black_box.hidden,
        fold_count=CONFIG.black_box.folds,
        share=CONFIG.black_box.share,
        seed=CONFIG.black_box.seed,
        code=code_of("compare_black_box"),
    log:
        "results/logs/compare_black_box.log",
    script:
        "../scripts/compare_black_box.py"


rule chapter_black_box:
    """Figures and tables of the black-box chapter."""
    message:
        "Chapter black box: figures and tables"
    input:
        notebook="notebooks/black_box.ipynb",
        history=rules.train_black_box.output.history,
        tested=rules.train_black_box.output.tested,
        held_out=rules.train_black_box.output.scored,
        metrics=rules.compare_black_box.output.metrics,
        predictions=rules.compare_black_box.output.predictions,
        summary=rules.compare_black_box.output.summary,
        parameters=rules.fit_white_box.output.parameters,
    output:
        training=report(
            "results/report/black_box/training.svg",
            category="Black box",
            caption="../report/captions/black_box.rst",
            labels={"figure": "training"},
        ),
        samples=report(
            "results/report/black_box/samples.svg",
            category="Black box",
            caption="../report/captions/black_box.rst",
            labels={"figure": "samples"},
        ),
        comparison=report(
            "results/report/black_box/comparison.svg",
            category="Black box",
            caption="../report/captions/black_box.rst",
            labels={"figure": "comparison"},
        ),
        coverage=report(
            "results/report/black_box/coverage.svg",
            category="Black box",
            caption="../report/captions/black_box.rst",
            labels={"figure": "coverage"},
        ),
        scores="results/report/black_box/scores.csv",
        held_out_table="results/report/black_box/held_out.csv",
        effects="results/report/black_box/effects.csv",
        statements="results/report/black_box/statements.csv",
    params:
        code=code_of_chapter("black_box"),
    log:
        "results/logs/chapter_black_box/run.log",
        notebook="results/notebooks/black_box.ipynb",
    script:
        "../scripts/run_notebook.py"
