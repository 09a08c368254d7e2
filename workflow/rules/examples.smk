"""Worked examples of the mismatch stage and their chapter, made in the run that makes the report."""

# Sets recorded by the simulators of the proof, in which something is hidden, or nothing.
EXAMPLE_CASES = {
    "bench": "bench/single/crosstalk/moderate/0",
    "clean": "clean/000",
    "undecided": "outside/tether/0",
}


rule judge_examples:
    """The mismatch stage on three examples."""
    message:
        "Mismatch: worked examples"
    output:
        state="results/examples/state.json",
        channels="results/examples/channels.csv",
        effects="results/examples/effects.csv",
        locations="results/examples/locations.csv",
        traces="results/examples/traces.csv",
    params:
        cases=EXAMPLE_CASES,
        folder="results/examples",
        concealing=code_that_conceals,
        code=code_of("judge_examples"),
    log:
        "results/logs/judge_examples.log",
    script:
        "../scripts/judge_examples.py"


# The campaign's own sets are judged where the index lists every kind of test that they are made of.
NEEDED_BY_SETS = {
    tuple(BENCH_SETS.values()): {("calibration", "bench"), ("static", "bench"), ("static", "jr3")},
    tuple(STAND_SETS.values()): {
        *(("dynamics", instrument) for instrument in ("quadrotor", "wrench")),
        *(("torque", instrument) for instrument in ("rotor", "wrench")),
        ("thrust", "rotor"),
    },
}
JUDGED_OF_CAMPAIGN = {
    Path(folder).name: folder
    for folders, needed in NEEDED_BY_SETS.items()
    if needed <= KINDS_RECORDED
    for folder in folders
}


def sealed_truth(wildcards):
    """What the emulators were given, where the project's own emulated campaign is what was recorded."""
    emulated = SESSIONS and all(row["source"] == "emulator" for row in SESSIONS)
    return ["tests/sealed/campaign_stated.yaml"] if emulated and CONFIG.raw == "raw" else []


rule score_campaign:
    """Verdicts on the campaign's own sets, against what the emulators were given."""
    message:
        "Mismatch: the campaign's own sets against what is true"
    input:
        verdicts=expand("results/mismatch/{set}/verdict.json", set=JUDGED_OF_CAMPAIGN),
        ledgers=expand("results/mismatch/{set}/ledger.json", set=JUDGED_OF_CAMPAIGN),
        truth=sealed_truth,
        recordings=list(JUDGED_OF_CAMPAIGN.values()),
    output:
        state="results/campaign/state.json",
        channels="results/campaign/channels.csv",
        sets="results/campaign/sets.csv",
        numbers="results/campaign/numbers.csv",
    params:
        sets=JUDGED_OF_CAMPAIGN,
        code=code_of("score_campaign"),
    log:
        "results/logs/score_campaign.log",
    script:
        "../scripts/score_campaign.py"


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
        campaign=rules.score_campaign.output.state,
        campaign_channels=rules.score_campaign.output.channels,
        campaign_sets=rules.score_campaign.output.sets,
        campaign_numbers=rules.score_campaign.output.numbers,
    output:
        bench_error=report(
            "results/report/mismatch/bench_error.svg",
            category="Mismatch",
            caption="../report/captions/mismatch.rst",
            labels={"figure": "bench error"},
        ),
        verdicts="results/report/mismatch/verdicts.csv",
        example_channels="results/report/mismatch/example_channels.csv",
        set_channels="results/report/mismatch/set_channels.csv",
        sets="results/report/mismatch/sets.csv",
        numbers="results/report/mismatch/numbers.csv",
        bench_effects="results/report/mismatch/bench_effects.csv",
    params:
        code=code_of_chapter("mismatch"),
    log:
        "results/logs/chapter_mismatch/run.log",
        notebook="results/notebooks/mismatch.ipynb",
    script:
        "../scripts/run_notebook.py"
