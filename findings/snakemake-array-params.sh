#!/usr/bin/env bash
# One would guess: Snakemake makes an output anew when a rule's params change, an array of NumPy among them.
#
# What happens: params are compared as they print. An array prints eight digits, and beyond 1000 elements only its
# ends: a change in the middle, from 1 to 99, or one below the eighth digit, is none. "Nothing to be done", and the old
# result stays. The same table as a list is seen.
#
# Why it matters: a calibration table that is handed to a rule as an array is corrected, all is up to date, and every
# number is that of the old table.
#
# Output seen:
#   snakemake 9.27.1
#   given 1 and 0.5: array 1.0, list 1.0, digits 0.5
#   given 99 and 0.500000001: array 1.0, list 99.0, digits 0.5
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
"${PYTHON:-python3}" -m venv env
env/bin/pip install --quiet --disable-pip-version-check snakemake==9.27.1 numpy==2.4.6
cat >Snakefile <<'END'
import numpy as np

table = np.ones(2000)
table[1000] = float(open("middle.txt").read())
small = np.array([float(open("small.txt").read())])

rule all:
    input: "array.txt", "list.txt", "digits.txt"

rule array:
    output: "array.txt"
    params: table=table
    run: open(output[0], "w").write(str(params.table[1000]))

rule digits:
    output: "digits.txt"
    params: small=small
    run: open(output[0], "w").write(repr(float(params.small[0])))

rule list:
    output: "list.txt"
    params: table=table.tolist()
    run: open(output[0], "w").write(str(params.table[1000]))
END
echo "snakemake $(env/bin/snakemake --version)"
export PATH="$PWD/env/bin:$PATH" XDG_CACHE_HOME="$PWD/cache"
for values in "1 0.5" "99 0.500000001"; do
    read -r middle small <<<"$values"
    echo "$middle" >middle.txt
    echo "$small" >small.txt
    env/bin/snakemake --cores 1 >log 2>&1 || { cat log; exit 1; }
    echo "given $middle and $small: array $(cat array.txt), list $(cat list.txt), digits $(cat digits.txt)"
done
[ "$(cat list.txt)" = 99.0 ]
[ "$(cat array.txt) $(cat digits.txt)" = "1.0 0.5" ] || { echo "a changed array is a reason now"; exit 1; }
