"""Where a simulation and recordings part, why, and a better model: `results/mismatch/<set>/verdict.json`."""

import json


def set_folder(name):
    """Folder of a set: below `recordings`, else among those made of the campaign or of public recordings."""
    own = Path(CONFIG.recordings) / name
    made = {s for names in PUBLIC_SETS_OF.values() for s in names} | set(CAMPAIGN_SETS)
    if own.is_dir() or name not in made:
        return str(own)
    return public_set(name)


def set_files(wildcards):
    """Files of a set, each watched by content; of a public or campaign set its folder, which a rule makes."""
    folder = set_folder(wildcards.set)
    if folder == public_set(wildcards.set):
        return [folder]
    files = sorted(str(path) for path in Path(folder).glob("*") if path.is_file())
    if not files:
        refuse(f"{folder}: no such recording set (a folder with vehicle.yaml and runs)")
    for path in files:
        if set(path) & set("{}<>"):
            refuse(
                f"{path}: Snakemake takes braces and angle brackets in a name for its own; rename it without them"
            )
    return files


def set_folder_of(wildcards):
    """Folder that the script reads."""
    return set_folder(wildcards.set)


rule mismatch:
    """Locate, explain, model, improve: the verdict on one recording set, its page and the improved vehicle."""
    message:
        "Mismatch: {wildcards.set}"
    input:
        files=set_files,
    output:
        verdict="results/mismatch/{set}/verdict.json",
        page="results/mismatch/{set}/report.html",
        improved="results/mismatch/{set}/improved_vehicle.yaml",
        ledger="results/mismatch/{set}/ledger.json",
    params:
        folder=set_folder_of,
        off=CONFIG.rules.off,
        code=code_of("mismatch"),
    log:
        "results/logs/mismatch/{set}.log",
    benchmark:
        "results/logs/mismatch/{set}.benchmark.tsv"
    wildcard_constraints:
        set="[^/]+",
    script:
        "../scripts/mismatch.py"


def say_verdicts():
    """Print the sentence of each verdict that this run made."""
    for path in sorted(Path("results/mismatch").glob("*/verdict.json")):
        if path.stat().st_mtime >= STARTED:
            verdict = json.loads(path.read_text(encoding="utf-8"))
            page = path.with_name("report.html")
            print(f"\n{verdict['set']}: {verdict['sentence']}\n{page}", file=sys.stderr)
