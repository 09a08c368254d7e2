"""What the recordings contain, for a person: `snakemake --cores 1 check_recordings`."""


def own_sets():
    """Names of the sets in the recordings folder: the folders with a vehicle file."""
    return sorted(path.parent.name for path in Path(CONFIG.recordings).glob("*/vehicle.yaml"))


def folders_to_check(wildcards):
    """Sets in the recordings folder and the imported public ones (of the bench, one set a propeller)."""
    own = [f"{CONFIG.recordings}/{name}" for name in own_sets()]
    public = [name for names in PUBLIC_SETS_OF.values() for name in names]
    per_motor = {name for name in public if name.startswith("strawson-") and name.count("-") > 1}
    return own + [public_set(name) for name in public if name not in per_motor]


rule check_recordings:
    """Runs, rates, gaps, and what is missing and so cannot be tested."""
    message:
        "Checking the recordings"
    input:
        sets=folders_to_check,
    output:
        text="results/public/check_recordings.txt",
    params:
        code=code_of("check_recordings"),
    log:
        "results/logs/check_recordings.log",
    script:
        "../scripts/check_recordings.py"
