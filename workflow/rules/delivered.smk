"""What is delivered, put to the test: `snakemake --cores 2 delivered`.

Every public set, the sets of the campaign and a share of the concealed ones: what error is left on the runs held out,
is any channel worse there, does the vehicle hover, is it a body, does every engine that is installed fly it.
"""

DELIVERED_SETS = {Path(folder).name: folder for folder in [*BENCH_SETS.values(), *STAND_SETS.values()]}
if CONFIG.proof.real:
    DELIVERED_SETS |= {Path(folder).name: folder for folder in PUBLIC_SHOWN}


def delivered_set(wildcards):
    """Folder of a set by its name."""
    return DELIVERED_SETS[wildcards.set]


rule deliver_set:
    """What is delivered of one set."""
    message:
        "Delivered: {wildcards.set}"
    input:
        sets=delivered_set,
    output:
        rows="results/delivered/sets/{set}.json",
    params:
        one=True,
        code=code_of("deliver_sets"),
    log:
        "results/logs/deliver_sets/{set}.log",
    script:
        "../scripts/deliver_sets.py"


rule deliver_concealed:
    """What is delivered of a batch of concealed sets."""
    message:
        "Delivered: concealed sets, {wildcards.batch}"
    input:
        sets="results/proof/sets/{batch}",
    output:
        rows="results/delivered/concealed/{batch}.json",
    params:
        one=False,
        code=code_of("deliver_sets"),
    log:
        "results/logs/deliver_sets/{batch}.log",
    script:
        "../scripts/deliver_sets.py"


rule delivered:
    """All of it in one table."""
    message:
        "Delivered: table"
    input:
        sets=expand("results/delivered/sets/{set}.json", set=DELIVERED_SETS),
        concealed=expand("results/delivered/concealed/{batch}.json", batch=DELIVERED),
    output:
        table="results/proof/delivered.csv",
    params:
        code=code_of("tabulate_delivered"),
    log:
        "results/logs/delivered.log",
    script:
        "../scripts/tabulate_delivered.py"
