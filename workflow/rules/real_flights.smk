"""Causes in real flights: those that their authors state, and every public set, judged in the run that makes the report."""

# Flights of one vehicle whose authors say what they changed, and those of the vehicle as it is.
LABELLED = ["crazypad-normal", "crazypad-cut", "crazypad-weight"]
# Predicted and recorded speeds of rotors whose recorded ones were concealed from the stage.
CONCEALED_SPEEDS = [path for path in ("docs/proof/concealed_speeds.csv",) if (ROOT / path).is_file()]


rule compare_labelled:
    """What `rotorid compare` states of each labelled pair."""
    message:
        "Real flights: comparing labelled flights"
    input:
        normal=public_set("crazypad-normal"),
        weight=public_set("crazypad-weight"),
        cut=public_set("crazypad-cut"),
    output:
        found="results/real_flights/labelled.json",
    params:
        code=code_of("compare_labelled"),
    log:
        "results/logs/compare_labelled.log",
    script:
        "../scripts/compare_labelled.py"


rule chapter_real_flights:
    """Figures and tables of the real flights' chapter."""
    message:
        "Chapter real flights: figures and tables"
    input:
        notebook="notebooks/real_flights.ipynb",
        labelled=expand("results/proof/real/{study}.json", study=[s for s in LABELLED if s in STUDIES]),
        residuals=expand("results/proof/real/{study}.csv", study=[s for s in LABELLED if s in STUDIES]),
        compared=rules.compare_labelled.output.found,
        speeds=CONCEALED_SPEEDS,
        real=rules.tabulate_real.output.table,
        coefficients=rules.tabulate_real.output.coefficients,
    output:
        mission=report(
            "results/report/real_flights/mission.svg",
            category="Real flights",
            caption="../report/captions/real_flights.rst",
            labels={"figure": "a cut propeller, before and after"},
        ),
        moments=report(
            "results/report/real_flights/moments.svg",
            category="Real flights",
            caption="../report/captions/real_flights.rst",
            labels={"figure": "moments of all three sets"},
        ),
        state="results/report/real_flights/state.json",
        named="results/report/real_flights/named.csv",
        errors="results/report/real_flights/errors.csv",
        differences="results/report/real_flights/differences.csv",
        concealed="results/report/real_flights/concealed.csv",
        studies="results/report/real_flights/studies.csv",
        published="results/report/real_flights/published.csv",
    params:
        code=code_of_chapter("real_flights"),
    log:
        "results/logs/chapter_real_flights/run.log",
        notebook="results/notebooks/real_flights.ipynb",
    script:
        "../scripts/run_notebook.py"
