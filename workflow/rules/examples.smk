"""Worked examples of the mismatch stage and their chapter, made in the run that makes the report."""

# A piece of two real flights: the first is fitted, the second held out.
EXAMPLE_FLIGHTS = {
    "flights": ["20210218170320seg2", "20210223104803seg2"],
    "start_s": 8.0,
    "stop_s": 22.0,
    "every": 2,
}
# Sets recorded by the simulators of the proof, in which something is hidden, or nothing.
EXAMPLE_CASES = {
    "bench": "bench/single/crosstalk/moderate/0",
    "clean": "clean/000",
    "undecided": "outside/tether/0",
}


rule judge_examples:
    """The mismatch stage on four examples."""
    message:
        "Mismatch: worked examples"
    input:
        flights=public_set("neurobem"),
    output:
        state="results/examples/state.json",
        channels="results/examples/channels.csv",
        effects="results/examples/effects.csv",
        locations="results/examples/locations.csv",
        traces="results/examples/traces.csv",
    params:
        real=EXAMPLE_FLIGHTS,
        cases=EXAMPLE_CASES,
        folder="results/examples",
        concealing=[CODE.of(path) for path in CONCEALING],
        code=code_of("judge_examples"),
    log:
        "results/logs/judge_examples.log",
    script:
        "../scripts/judge_examples.py"


rule chapter_mismatch:
    """Figures and tables of the mismatch chapter."""
    message:
        "Chapter mismatch: figures and tables"
    input:
        notebook="notebooks/mismatch.ipynb",
        examples=rules.judge_examples.output.state,
        channels=rules.judge_examples.output.channels,
        effects=rules.judge_examples.output.effects,
        locations=rules.judge_examples.output.locations,
        traces=rules.judge_examples.output.traces,
    output:
        real_error=report(
            "results/report/mismatch/real_error.svg",
            category="Mismatch",
            caption="../report/captions/mismatch.rst",
            labels={"figure": "real error"},
        ),
        real_channels=report(
            "results/report/mismatch/real_channels.svg",
            category="Mismatch",
            caption="../report/captions/mismatch.rst",
            labels={"figure": "real channels"},
        ),
        bench_error=report(
            "results/report/mismatch/bench_error.svg",
            category="Mismatch",
            caption="../report/captions/mismatch.rst",
            labels={"figure": "bench error"},
        ),
        verdicts="results/report/mismatch/verdicts.csv",
        real_effects="results/report/mismatch/real_effects.csv",
        bench_effects="results/report/mismatch/bench_effects.csv",
    params:
        code=code_of_chapter("mismatch"),
    log:
        "results/logs/chapter_mismatch/run.log",
        notebook="results/logs/chapter_mismatch/mismatch.ipynb",
    script:
        "../scripts/run_notebook.py"
