"""What the recordings contain, for a person: `snakemake --cores 1 check_recordings`."""


def own_sets():
    """Names of the sets in the recordings folder: the folders with a vehicle file."""
    return sorted(path.parent.name for path in Path(CONFIG.recordings).glob("[!.]*/vehicle.yaml"))


def folders_to_check(wildcards):
    """Sets in the recordings folder, the imported public ones, and those made of the campaign."""
    made = [f"results/recordings/{name}" for name in CAMPAIGN_SETS]
    return [f"{CONFIG.recordings}/{name}" for name in own_sets()] + PUBLIC_SHOWN + made


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
