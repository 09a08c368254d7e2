"""The proof: concealed sets, verdicts on them, and only then the answers: `snakemake --cores 2 proof`.

Answers lie in results/sealed, which the scoring rule alone opens.
"""

import sys

from rotorid.errors import InputError
from rotorid_proof import plan, studies as real

CASES = plan.read_index(ROOT / "proof/rotorid_proof/concealed/cases.tsv")
ANEW = plan.released(CASES, CONFIG.proof.release)
TABLES_OF_PROOF = [
    f"{name}.csv" for name in "summary cases families effects confusion power peers real coefficients".split()
] + ["state.json"]
NAMES_OF_CASES = [entry.case for entry in CASES + ANEW]
try:
    plan.check_families(CASES, CONFIG.proof.seeds)
    plan.check_families(
        [entry for entry in CASES if plan.DEVELOPMENT in entry.case], CONFIG.proof.released, "proof.released"
    )
    plan.check_patterns(NAMES_OF_CASES, CONFIG.proof.cases, "proof.cases")
    plan.check_patterns(NAMES_OF_CASES, CONFIG.ablation.cases, "ablation.cases")
    plan.check_tables(CONFIG.proof.tables, TABLES_OF_PROOF)
except InputError as error:
    refuse(error)
CHOSEN = plan.choose(CASES, CONFIG.proof.seeds, CONFIG.proof.cases)
RELEASED = plan.choose(ANEW, CONFIG.proof.released, CONFIG.proof.cases)
try:
    plan.check_chosen(CHOSEN, RELEASED, CONFIG.proof.release)
except InputError as error:
    refuse(error)
BATCHES = plan.batches(CHOSEN + RELEASED, CONFIG.proof.batch)
# Concealed sets whose delivered vehicle is put to the test: as many, evenly over the whole list.
DELIVERED = plan.batches(plan.spread(CASES, CONFIG.proof.delivered), CONFIG.proof.batch)
STUDIES = [study.name for study in real.STUDIES] if CONFIG.proof.real else []

if "proof" in sys.argv:
    judged = [name for name in BATCHES if Path(f"results/proof/verdicts/{name}").is_dir()]
    print(plan.announcement(BATCHES, judged, CONFIG.proof.peers), file=sys.stderr)


def code_that_conceals(wildcards):
    """Hashes of the code that recordings come from: outside the library, they stand next to that of the script."""
    files = sorted((ROOT / "proof/rotorid_proof/concealed").rglob("*.py"))
    return [CODE.of(path.relative_to(ROOT)) for path in files]


def cases_of(wildcards):
    """Names of the cases in a batch."""
    return [entry.case for entry in {**DELIVERED, **BATCHES}[wildcards.batch]]


def peers_asked(wildcards):
    """Folders with the peers' verdicts, where peers are asked."""
    return expand("results/proof/peers/{batch}", batch=BATCHES) if CONFIG.proof.peers else []


rule conceal:
    """Recording sets with something hidden in them, and apart from them the answers."""
    message:
        "Proof: recording concealed sets, {wildcards.batch}"
    output:
        sets=directory("results/proof/sets/{batch}"),
        answers=directory("results/sealed/{batch}"),
    params:
        cases=cases_of,
        concealing=code_that_conceals,
        code=code_of("conceal"),
    log:
        "results/logs/conceal/{batch}.log",
    script:
        "../scripts/conceal.py"


rule judge:
    """Verdicts of the mismatch stage on a batch of sets, without their answers."""
    message:
        "Proof: judging, {wildcards.batch}"
    input:
        sets="results/proof/sets/{batch}",
    output:
        verdicts=directory("results/proof/verdicts/{batch}"),
    params:
        code=code_of("judge"),
    log:
        "results/logs/judge/{batch}.log",
    script:
        "../scripts/judge.py"


rule ask_peers:
    """What other methods say of the same sets, without their answers either."""
    message:
        "Proof: asking other methods, {wildcards.batch}"
    input:
        sets="results/proof/sets/{batch}",
    output:
        peers=directory("results/proof/peers/{batch}"),
    params:
        code=code_of("ask_peers"),
    log:
        "results/logs/ask_peers/{batch}.log",
    script:
        "../scripts/ask_peers.py"


rule score_proof:
    """Verdicts against answers: the only rule that opens the sealed folder."""
    message:
        "Proof: opening the answers"
    input:
        verdicts=expand("results/proof/verdicts/{batch}", batch=BATCHES),
        answers=expand("results/sealed/{batch}", batch=BATCHES),
        peers=peers_asked,
    output:
        summary="results/proof/summary.csv",
        cases="results/proof/cases.csv",
        effects="results/proof/effects.csv",
        confusion="results/proof/confusion.csv",
        power="results/proof/power.csv",
        parameters="results/proof/parameters.csv",
        peers="results/proof/peers.csv",
        families="results/proof/families.csv",
        state="results/proof/state.json",
    params:
        judging=code_of("judge"),
        code=code_of("score_proof"),
    log:
        "results/logs/score_proof.log",
    script:
        "../scripts/score_proof.py"


def set_of_study(wildcards):
    """Folder of the public set that a study is about."""
    return public_set(real.study(wildcards.study).set)


rule study_real:
    """The mismatch stage on one set of real recordings."""
    message:
        "Proof: real recordings, {wildcards.study}"
    input:
        recordings=set_of_study,
    output:
        result="results/proof/real/{study}.json",
        residuals="results/proof/real/{study}.csv",
    params:
        code=code_of("study_real"),
    log:
        "results/logs/study_real/{study}.log",
    script:
        "../scripts/study_real.py"


rule tabulate_real:
    """Real recordings in one table, published coefficients next to ours."""
    message:
        "Proof: table of real recordings"
    input:
        studies=expand("results/proof/real/{study}.json", study=STUDIES),
        flights="results/neurobem/flights.csv",
    output:
        table="results/proof/real.csv",
        coefficients="results/proof/coefficients.csv",
    params:
        judging=code_of("judge"),
        code=code_of("tabulate_real"),
    log:
        "results/logs/tabulate_real.log",
    script:
        "../scripts/tabulate_real.py"


rule prove_next_flight:
    """Open questions, the flight planned for each, and what both sets together say: slow, on request."""
    message:
        "Proof: the next flight"
    input:
        limits="workflow/proof_room.yaml",
    output:
        table="results/proof/next_flight.csv",
        summary="results/proof/next_flight_summary.csv",
    params:
        so_far="results/next_flight/rows.csv",
        concealing=code_that_conceals,
        code=code_of("prove_next_flight"),
    log:
        "results/logs/prove_next_flight.log",
    script:
        "../scripts/prove_next_flight.py"


rule prove_changes:
    """Pairs of sets in which it is known what changed, and what `rotorid compare` says: slow, on request."""
    message:
        "Proof: what changed between two sets"
    input:
        plantings="workflow/plantings.tsv",
        public=PUBLIC_SHOWN,
    output:
        table="results/proof/changes.csv",
        summary="results/proof/changes_summary.csv",
    params:
        so_far="results/changes/rows.csv",
        recordings="results/recordings",
        seed=CONFIG.proof.release or "development",
        concealing=code_that_conceals,
        code=code_of("prove_changes"),
    log:
        "results/logs/prove_changes.log",
    script:
        "../scripts/prove_changes.py"


rule prove_fleet:
    """Vehicles over ten flights in which it is known what changed since when: slow, on request."""
    message:
        "Proof: a fleet's history"
    output:
        table="results/proof/fleet.csv",
    params:
        so_far="results/changes/fleet.csv",
        seed=CONFIG.proof.release or "development",
        concealing=code_that_conceals,
        code=code_of("prove_fleet"),
    log:
        "results/logs/prove_fleet.log",
    script:
        "../scripts/prove_fleet.py"


rule prove_path:
    """The path from command to thrust: real flights whose rotor speeds are concealed, drawn flights in gusts; slow."""
    message:
        "Proof: the path from command to thrust"
    input:
        public=PUBLIC_SHOWN,
    output:
        speeds="results/proof/concealed_speeds.csv",
        speeds_summary="results/proof/concealed_speeds_summary.csv",
        feedback="results/proof/feedback.csv",
        feedback_summary="results/proof/feedback_summary.csv",
    params:
        so_far="results/path",
        recordings="results/recordings",
        folder=PUBLIC_FOLDER,
        seed=CONFIG.proof.release or "development",
        each=CONFIG.proof.released.get("feedback", 5),
        concealing=code_that_conceals,
        code=code_of("prove_path"),
    log:
        "results/logs/prove_path.log",
    script:
        "../scripts/prove_path.py"


rule prove_next_session:
    """The same of stands and benches, drawn for the release: on request."""
    message:
        "Proof: the next session of stands and benches"
    output:
        table="results/proof/next_flight_stands.csv",
        summary="results/proof/next_flight_stands_summary.csv",
    params:
        so_far="results/next_flight/rows_stands.csv",
        release=CONFIG.proof.release or "development",
        concealing=code_that_conceals,
        code=code_of("prove_next_session"),
    log:
        "results/logs/prove_next_session.log",
    script:
        "../scripts/prove_next_session.py"


rule draw_proof:
    """Figures of the proof next to its tables."""
    message:
        "Proof: drawing"
    input:
        confusion=rules.score_proof.output.confusion,
        power=rules.score_proof.output.power,
        cases=rules.score_proof.output.cases,
    output:
        confusion="results/proof/confusion.svg",
        instruments="results/proof/instruments.svg",
        power="results/proof/power.svg",
        oracle="results/proof/oracle.svg",
    params:
        code=code_of("draw_proof"),
    log:
        "results/logs/draw_proof.log",
    script:
        "../scripts/draw_proof.py"


rule chapter_proof:
    """Table of the proof's chapter, from the folder that the configuration names."""
    message:
        "Chapter proof: tables"
    input:
        notebook="notebooks/proof.ipynb",
        cases=f"{CONFIG.proof.tables}/cases.csv",
        releases="docs/proof/releases.csv",
        plantings="docs/proof/plantings_summary.csv",
    output:
        counted="results/report/proof/counted.csv",
        state="results/report/proof/state.json",
    params:
        code=code_of_chapter("proof"),
    log:
        "results/logs/chapter_proof/run.log",
        notebook="results/notebooks/proof.ipynb",
    script:
        "../scripts/run_notebook.py"


def results_of_proof(wildcards):
    """All results that the proof hangs on."""
    return results_behind(
        *rules.score_proof.output,
        *rules.draw_proof.output,
        *rules.tabulate_real.output,
        *rules.chapter_proof.output,
    )


rule proof:
    """The whole proof: tables and figures under results/proof, and its chapter."""
    message:
        "The proof is in results/proof: summary.csv first"
    input:
        results_of_proof,
