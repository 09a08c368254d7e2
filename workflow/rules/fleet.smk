"""Every recording set of a folder and what they show together: `snakemake --cores 2 fleet --config recordings=DIR`.

Sets are judged in batches, a job each, so that starting Python is not the cost; a set that fails costs only itself.
What was judged by the code of now is never judged again, however sets come and go. On a cluster add
`--workflow-profile workflow/profiles/slurm`.
"""

import hashlib
import os

FLEET_MEMORY = "cache/fleet"


def fleet_sets():
    """Names of the sets of the folder, sorted."""
    return sorted(path.parent.name for path in Path(CONFIG.recordings).glob("[!.]*/vehicle.yaml"))


def fleet_batches():
    """Names of the sets by batch."""
    names, size = fleet_sets(), CONFIG.fleet.batch
    return {f"{start // size:04d}": names[start : start + size] for start in range(0, len(names), size)}


def folders_of_batch(wildcards):
    """Folders of a batch's sets."""
    found = fleet_batches()
    if wildcards.batch not in found:
        refuse(f"{CONFIG.recordings}: no sets for batch {wildcards.batch} of the fleet")
    return [f"{CONFIG.recordings}/{name}" for name in found[wildcards.batch]]


def stamp_of_batch(wildcards):
    """Hash of the names, sizes and times of the files of a batch's sets.

    Where it changes the batch is gone through once more, and what changed in content is judged. The files are no inputs:
    Snakemake looks at every input of every waiting job each second, which took half a core from a thousand sets.
    """
    return stamp_of(folders_of_batch(wildcards))


def stamp_of(folders):
    """Hash of the names, sizes and times of the files in some folders."""
    found = hashlib.sha256()
    for folder in folders:
        for path in sorted(Path(folder).glob("*")):
            about = path.lstat()
            found.update(os.fsencode(path) + f"\0{about.st_size}\0{about.st_mtime_ns}\0".encode())
    return found.hexdigest()


def folders_of_fleet(wildcards):
    """Folders of all sets."""
    return [f"{CONFIG.recordings}/{name}" for name in fleet_sets()]


def stamp_of_fleet(wildcards):
    """Hash of the names, sizes and times of the files of all sets."""
    return stamp_of(folders_of_fleet(wildcards))


def verdicts_of_fleet(wildcards):
    """Folders of verdicts, one a batch."""
    if not fleet_sets():
        refuse(f"{CONFIG.recordings}: no recording sets (folders with vehicle.yaml) in it")
    return [f"results/fleet/verdicts/{batch}" for batch in fleet_batches()]


rule judge_fleet:
    """Verdicts on a batch of recording sets."""
    message:
        "Fleet: judging, batch {wildcards.batch}"
    output:
        verdicts=directory("results/fleet/verdicts/{batch}"),
    params:
        folders=folders_of_batch,
        stamp=stamp_of_batch,
        memory=FLEET_MEMORY,
        code=code_of("judge_fleet"),
    log:
        "results/logs/judge_fleet/{batch}.log",
    wildcard_constraints:
        batch="[0-9]+",
    script:
        "../scripts/judge_fleet.py"


rule fleet_history:
    """What changed in each vehicle of the fleet since its first sets."""
    message:
        "Fleet: history of each vehicle"
    output:
        numbers="results/fleet/history.csv",
        events="results/fleet/events.csv",
        figure="results/fleet/history.svg",
        pages=directory("results/fleet/vehicles"),
    params:
        folders=folders_of_fleet,
        stamp=stamp_of_fleet,
        good=CONFIG.fleet.good,
        code=code_of("fleet_history"),
    log:
        "results/logs/fleet_history.log",
    script:
        "../scripts/fleet_history.py"


rule fleet:
    """What the sets of a folder show together: tables, figure and page."""
    message:
        "Fleet: summary"
    input:
        batches=verdicts_of_fleet,
        events="results/fleet/events.csv" if CONFIG.fleet.history else [],
        history="results/fleet/history.svg" if CONFIG.fleet.history else [],
    output:
        sets="results/fleet/sets.csv",
        effects="results/fleet/effects.csv",
        parameters="results/fleet/parameters.csv",
        figure="results/fleet/fleet.svg",
        page="results/fleet/fleet.html",
    params:
        recordings=CONFIG.recordings,
        code=code_of("summarise_fleet"),
    log:
        "results/logs/fleet.log",
    localrule: True
    script:
        "../scripts/summarise_fleet.py"
