"""The bench for decisions: `snakemake --cores 2 decisions`.

Evidence of many sets is kept once (hours of one core; it may be stopped, and goes on where it stopped), then decisions are
scored on all of them in minutes. `snakemake decisions_so_far` scores what is kept already. ROTORID_EVIDENCE names the
folder of the evidence, cache/evidence without it.
"""

from rotorid_proof.decisions import plan as bench

EVIDENCE = os.environ.get("ROTORID_EVIDENCE", "") or "cache/evidence"
try:
    plan.check_families(CASES, CONFIG.decisions.seeds, "decisions.seeds")
    plan.check_patterns(
        [planting.name for planting in LISTED], CONFIG.decisions.plantings, "decisions.plantings"
    )
except InputError as error:
    refuse(error)
KEPT_PLANTINGS = planted.chosen(LISTED, CONFIG.decisions.plantings)
KEPT_FLIGHTS = list(dict.fromkeys(p.flight for p in KEPT_PLANTINGS))
KEPT_STUDIES = real.STUDIES if CONFIG.decisions.studies else ()
KEPT_ITEMS = [
    *bench.untouched(KEPT_FLIGHTS),
    *bench.planted(KEPT_PLANTINGS),
    *bench.studies(KEPT_STUDIES),
    *bench.drawn(plan.choose(CASES, CONFIG.decisions.seeds, ["*"])),
]
if not KEPT_ITEMS:
    refuse("config.yaml: decisions.seeds, decisions.plantings and decisions.studies leave no set")
# What judges a set is the mismatch stage without its page: another layout of that is no other evidence.
JUDGING = ["analyse", "instrument/analyse", "tell/verdict"]


def hash_of_engine(wildcards):
    """Hash of the code that judges the sets."""
    return bench.joint([CODE.of(f"src/rotorid/mismatch/{name}.py") for name in JUDGING])


def hashes_of_evidence(wildcards):
    """Hashes of the code that draws, plants and judges the sets."""
    return {
        "drawing": bench.joint(code_that_conceals(wildcards)),
        "planting": CODE.of("proof/rotorid_proof/plantings/sow.py"),
        "engine": hash_of_engine(wildcards),
    }


rule collect_evidence:
    """Gram matrices of many sets as the engine's last search sees them, its verdict next to them."""
    message:
        f"Decisions: keeping the evidence of {len(KEPT_ITEMS)} sets"
    input:
        recordings=sorted(
            {public_set(planted_flight(name).set) for name in KEPT_FLIGHTS}
            | {public_set(s.set) for s in KEPT_STUDIES}
        ),
    output:
        kept="results/decisions/kept.json",
    params:
        wanted=KEPT_ITEMS,
        folder=EVIDENCE,
        public="results/recordings",
        hashes=hashes_of_evidence,
        code=code_of("collect_evidence"),
    log:
        "results/logs/collect_evidence.log",
    script:
        "../scripts/collect_evidence.py"


rule score_decisions:
    """Every decision on every set that is kept, in one table."""
    message:
        "Decisions: scoring"
    input:
        kept=rules.collect_evidence.output.kept,
    output:
        table="results/decisions/decisions.csv",
        words="results/decisions/decisions.md",
        sets="results/decisions/sets.csv",
    params:
        folder=EVIDENCE,
        engine=hash_of_engine,
        code=code_of("score_decisions"),
    threads: workflow.cores
    log:
        "results/logs/score_decisions.log",
    script:
        "../scripts/score_decisions.py"


rule decisions:
    """The bench for decisions: tables under results/decisions."""
    message:
        "The decisions are in results/decisions: decisions.md first"
    input:
        rules.score_decisions.output,


rule decisions_so_far:
    """The same on what is kept already: results/decisions/so_far."""
    message:
        "Decisions: scoring what is kept so far"
    output:
        table="results/decisions/so_far/decisions.csv",
        words="results/decisions/so_far/decisions.md",
        sets="results/decisions/so_far/sets.csv",
    params:
        folder=EVIDENCE,
        engine=hash_of_engine,
        kept=len(list(Path(EVIDENCE).glob("*.json"))),
        code=code_of("score_decisions"),
    threads: workflow.cores
    log:
        "results/logs/decisions_so_far.log",
    script:
        "../scripts/score_decisions.py"
