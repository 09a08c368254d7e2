"""What each rule of the mismatch stage is worth: `snakemake --cores 2 ablation`.

Concealed sets are judged with all rules, then without each rule those in which it fired. Of
`ablation.cases`, whose sets no rule was made with; the table is `results/ablation/rules.csv`.
"""

from fnmatch import fnmatchcase

from rotorid.mismatch.decide.rules import RULES

ABLATION_CASES = [
    entry.case
    for entry in CASES
    if any(fnmatchcase(entry.case, pattern) for pattern in CONFIG.ablation.cases)
]


rule record_ablation:
    """Concealed sets for the ablation, and apart from them their answers."""
    message:
        "Ablation: recording concealed sets"
    output:
        sets=directory("results/ablation/sets"),
        answers=directory("results/ablation/sealed"),
    params:
        cases=ABLATION_CASES,
        concealing=code_that_conceals,
        code=code_of("conceal"),
    log:
        "results/logs/ablation/record.log",
    script:
        "../scripts/conceal.py"


rule judge_with_all_rules:
    """Every set judged with all rules, and which rules fired."""
    message:
        "Ablation: judging with all rules"
    input:
        sets="results/ablation/sets",
    output:
        verdicts="results/ablation/all_rules.jsonl",
    params:
        code=code_of("ablate"),
    log:
        "results/logs/ablation/all_rules.log",
    script:
        "../scripts/ablate.py"


rule judge_without_rule:
    """Sets in which a rule fired, judged without it."""
    message:
        "Ablation: judging without {wildcards.rule}"
    input:
        sets="results/ablation/sets",
        base="results/ablation/all_rules.jsonl",
    output:
        verdicts="results/ablation/without/{rule}.jsonl",
    params:
        most=CONFIG.ablation.most,
        code=code_of("ablate"),
    log:
        "results/logs/ablation/{rule}.log",
    script:
        "../scripts/ablate.py"


rule score_ablation:
    """What each rule rights and wrongs, one line a rule."""
    message:
        "Ablation: the table"
    input:
        base="results/ablation/all_rules.jsonl",
        without=expand("results/ablation/without/{rule}.jsonl", rule=sorted(RULES)),
        answers="results/ablation/sealed",
    output:
        table="results/ablation/rules.csv",
    params:
        code=code_of("score_ablation"),
    log:
        "results/logs/ablation/table.log",
    script:
        "../scripts/score_ablation.py"


rule ablation:
    """What each rule of the mismatch stage is worth."""
    input:
        "results/ablation/rules.csv",
