"""Recordings of other laboratories: obtained, checked, and turned into contract sets under results/recordings."""

import os

from rotorid.importers.manifest import read_manifest

MANIFEST = "workflow/public_data.yaml"
PUBLIC_SOURCES = read_manifest(MANIFEST)
PUBLIC_SETS_OF = {source: entry["sets"] for source, entry in PUBLIC_SOURCES.items()}
# Where the files already are; empty means that they are downloaded into cache/public.
PUBLIC_FOLDER = os.environ.get("ROTORID_PUBLIC_DATA", "")
if PUBLIC_FOLDER:
    PUBLIC_FOLDER = str((ROOT / PUBLIC_FOLDER).resolve())


def public_set(name):
    """Folder of an imported set."""
    return f"results/recordings/{name}"


def public_files(source):
    """Files of a source that are in the folder, so that a changed one is imported again."""
    if not PUBLIC_FOLDER:
        return []
    paths = [Path(PUBLIC_FOLDER) / source / file["path"] for file in PUBLIC_SOURCES[source]["files"]]
    return [str(path) for path in paths if path.is_file()]


for source in PUBLIC_SOURCES:

    rule:
        """Files of one laboratory as contract sets."""
        name:
            f"import_public_{source.replace('-', '_')}"
        message:
            f"Public recordings: {source}"
        input:
            files=public_files(source),
            manifest=MANIFEST,
            vehicles=sorted(str(path) for path in Path("workflow/vehicles").glob("*.yaml")),
        output:
            sets=[directory(public_set(name)) for name in PUBLIC_SETS_OF[source]],
            status=f"results/public/{source}.json",
        params:
            source=source,
            folder=PUBLIC_FOLDER,
            cache="cache/public",
            parent="results/recordings",
            code=code_of("import_public"),
        log:
            f"results/logs/import_public/{source}.log",
        script:
            "../scripts/import_public.py"


rule public:
    """Every public recording as a contract set."""
    input:
        expand("results/public/{source}.json", source=PUBLIC_SOURCES),
