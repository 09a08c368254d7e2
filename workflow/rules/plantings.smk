"""Plantings in real flights: `snakemake --cores 2 plantings`.

Something exact is put into a real flight; the verdict is scored against the one on the flight untouched. Part of them:
`--config 'plantings={cases: ["neurobem/*/large/0"]}'`. What was judged by the code of now is never judged again.
"""

from rotorid_proof.plantings import plan as planted
from rotorid_proof.plantings.flights import flight as planted_flight

LISTED = planted.read_list(ROOT / "workflow/plantings.tsv")
try:
    plan.check_patterns([planting.name for planting in LISTED], CONFIG.plantings.cases, "plantings.cases")
except InputError as error:
    refuse(error)
PLANTINGS = planted.chosen(LISTED, CONFIG.plantings.cases)
PLANTED = planted.batches(PLANTINGS, CONFIG.plantings.batch)
PLANTED_FLIGHTS = list(dict.fromkeys(p.flight for p in PLANTINGS))
PLANTED_MEMORY = "cache/plantings"

if Path(CONFIG.plantings.kept).is_dir():
    refuse(f"config.yaml: plantings.kept is {CONFIG.plantings.kept!r}, a folder, expected a table")
if "plantings" in sys.argv:
    if not Path(CONFIG.plantings.kept).exists():
        print(
            f"Plantings: {CONFIG.plantings.kept} is not there, so no earlier rows are kept", file=sys.stderr
        )
    judged = [name for name in PLANTED if Path(f"results/plantings/verdicts/{name}").is_dir()]
    print(planted.announcement(PLANTED, judged), file=sys.stderr)


def planted_set(flight):
    """Folder of the public set that a flight is cut from."""
    return public_set(planted_flight(flight).set)


def set_of_flight(wildcards):
    """The same for a rule about a flight."""
    return planted_set(wildcards.flight)


def set_of_batch(wildcards):
    """The same for a rule about a batch."""
    return planted_set(PLANTED[wildcards.batch][0].flight)


def plantings_of(wildcards):
    """Names of the plantings in a batch."""
    return [p.name for p in PLANTED[wildcards.batch]]


def mistakes_of(wildcards):
    """Names of a flight's plantings that the search for mistakes has to name."""
    return [p.name for p in planted.mistakes(PLANTINGS, wildcards.flight)]


def kept_plantings(wildcards):
    """The table of plantings that were judged before, where there is one."""
    return [CONFIG.plantings.kept] if Path(CONFIG.plantings.kept).is_file() else []


rule judge_untouched:
    """The verdict on a real flight with nothing planted."""
    message:
        "Plantings: {wildcards.flight} untouched"
    input:
        recordings=set_of_flight,
    output:
        verdict="results/plantings/untouched/{flight}.json",
    params:
        memory=PLANTED_MEMORY,
        code=code_of("judge_untouched"),
    log:
        "results/logs/judge_untouched/{flight}.log",
    script:
        "../scripts/judge_untouched.py"


rule judge_plantings:
    """Verdicts on a batch of sets with something planted in one real flight."""
    message:
        "Plantings: judging, {wildcards.batch}"
    input:
        recordings=set_of_batch,
    output:
        verdicts=directory("results/plantings/verdicts/{batch}"),
    params:
        plantings=plantings_of,
        memory=PLANTED_MEMORY,
        code=code_of("judge_plantings"),
    log:
        "results/logs/judge_plantings/{batch}.log",
    script:
        "../scripts/judge_plantings.py"


rule tabulate_plantings:
    """What was reported of each planted cause, its size, which other names are new and which are lost."""
    message:
        "Plantings: tables"
    input:
        untouched=expand("results/plantings/untouched/{flight}.json", flight=PLANTED_FLIGHTS),
        verdicts=expand("results/plantings/verdicts/{batch}", batch=PLANTED),
        recordings=[planted_set(name) for name in PLANTED_FLIGHTS],
        kept=kept_plantings,
    output:
        table="results/plantings/plantings.csv",
        summary="results/plantings/plantings_summary.csv",
        beside="results/plantings/plantings_beside.csv",
    params:
        flights=PLANTED_FLIGHTS,
        judge=code_of("judge_plantings"),
        code=code_of("tabulate_plantings"),
    log:
        "results/logs/tabulate_plantings.log",
    script:
        "../scripts/tabulate_plantings.py"


def results_of_plantings(wildcards):
    """All results that the tables of plantings hang on."""
    return results_behind(*rules.tabulate_plantings.output)


rule plantings:
    """Plantings in real flights: tables under results/plantings."""
    message:
        "The plantings are in results/plantings: plantings_summary.csv first"
    input:
        results_of_plantings,


rule search_mistakes:
    """What the search for mistakes alone names of those planted in one flight."""
    message:
        "Plantings: the search for mistakes, {wildcards.flight}"
    input:
        recordings=set_of_flight,
    output:
        table="results/plantings/mistakes/{flight}.csv",
    params:
        plantings=mistakes_of,
        code=code_of("search_mistakes"),
    log:
        "results/logs/search_mistakes/{flight}.log",
    script:
        "../scripts/search_mistakes.py"


rule planted_mistakes:
    """Mistakes planted in real flights, by the search for mistakes alone: results/plantings/mistakes."""
    message:
        "The tables are in results/plantings/mistakes"
    input:
        expand("results/plantings/mistakes/{flight}.csv", flight=PLANTED_FLIGHTS),
