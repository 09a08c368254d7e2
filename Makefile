# Two commands for a newcomer with Python 3.11 or newer and make:
#   make report   measurements to results/report/report.pdf and report.html
#   make test     every check of the project
# Both make the environment (.venv, from the hashes in requirements.lock) when it is missing.

PYTHON ?= python3
CORES ?= 2
# More for Snakemake, e.g. make report OPTIONS="--configfile tests/configs/small.yaml"
OPTIONS ?=

# Compiled modules are kept: without them every start of Snakemake and every job takes two seconds more.
unexport PYTHONDONTWRITEBYTECODE

BIN := .venv/bin
READY := .venv/ready
TESTED := .venv/tested
SOURCES := $(shell find Snakefile config.yaml mkdocs.yml pyproject.toml README.md .pre-commit-config.yaml \
	src proof acquire firmware workflow notebooks tests raw docs \
	-type f ! -path '*/__pycache__/*' ! -path 'firmware/build/*' ! -name '* *' 2>/dev/null)

.PHONY: help report site proof plantings campaign test test-slow test-tree check environment lock sbom licences
.DEFAULT_GOAL := help

help: ## say what there is
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-12s %s\n", $$1, $$2 }' Makefile

report: $(READY) ## make the report from raw measurements
	@$(BIN)/snakemake --cores $(CORES) $(OPTIONS)
	@echo "The report: results/report/report.pdf and results/report/report.html"

site: $(READY) ## the pages as a site, strictly: results/site/index.html (SERVE=1 shows it while writing)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs $(if $(SERVE),serve,build --quiet)
	@echo "The site: results/site/index.html"

campaign: $(READY) ## record the emulated campaign anew into raw/campaign
	@$(BIN)/python -m rotorid_acquire.campaign

proof: $(READY) ## hide, find, score: about two hours; what is done stays done (kept in docs/proof)
	@$(BIN)/snakemake --cores $(CORES) proof $(OPTIONS)
	@mkdir -p docs/proof && cp results/proof/*.csv results/proof/state.json docs/proof/
	@echo "The proof: results/proof/summary.csv; its tables are kept in docs/proof for the report"

plantings: $(READY) ## put something exact into real flights and score what is named of it; kept in docs/proof
	@$(BIN)/snakemake --cores $(CORES) plantings $(OPTIONS)
	@mkdir -p docs/proof && cp results/plantings/plantings*.csv docs/proof/
	@echo "The plantings: results/plantings/plantings_summary.csv; their tables are kept in docs/proof"

test: $(TESTED) ## run every check; does nothing when nothing has changed since it last passed
	@echo "Every check has passed on these files."

check: $(READY) ## the checks of form alone: lint, format, types of the open modules, stripped notebooks
	@$(BIN)/ruff check --quiet .
	@$(BIN)/ruff format --check --quiet .
	@$(BIN)/mypy --no-error-summary
	@$(BIN)/snakefmt --check Snakefile workflow 2>&1 || { echo "Run: .venv/bin/snakefmt Snakefile workflow"; exit 1; }
	@$(BIN)/nbstripout --verify notebooks/*.ipynb || { echo "Run: .venv/bin/nbstripout notebooks/*.ipynb"; exit 1; }

$(TESTED): $(READY) $(SOURCES)
	@$(MAKE) --no-print-directory check
	@$(BIN)/pytest -m "not slow" -n 2 --dist loadfile
	@touch $@

# Those that copy the tree, list it or start programs in it (or Snakemake itself), and those of what public sets become.
TREE := tests/test_tree.py tests/workflow tests/acquire/test_at_the_bench.py tests/unit/cli/test_pages.py \
	tests/unit/proof/test_plantings.py tests/unit/proof/test_changes_rows.py tests/unit/test_wrong_config.py \
	tests/unit/recordings/importers/test_public_sets.py

test-tree: $(READY) ## of the checks those that could see what a report leaves in the tree; tests/tree.py holds the others
	@$(BIN)/pytest -m "not slow" -n 2 --dist loadfile $(TREE)

test-slow: $(READY) ## the tests on whole recordings and whole builds that `make test` leaves out
	@$(BIN)/pytest -m slow -n 2 --dist loadfile

environment: $(READY) ## make the environment alone

# uv, itself from the lock, installs the rest in seconds; where it cannot, or is not to be had, pip does it in a minute
# without it. Both take packages from where the user set either of them. Both compile them: where
# Python is set to write no bytecode, as in many containers, every start would compile the libraries anew.
$(READY): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "rotorid needs Python 3.11 or newer, and $(PYTHON) is not; say which to use: make PYTHON=python3.12 ..."; \
		exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
		echo "$(PYTHON) cannot make environments (no ensurepip); on Debian and Ubuntu: apt install python3-venv"; \
		exit 1; }
	@echo "Environment: making .venv and installing the locked packages"
	@$(PYTHON) -m venv --clear .venv
	@sed -n '/^uv==/,/# via/p' requirements.lock > .venv/uv.lock
	@sed '/^uv==/,/# via/d' requirements.lock > .venv/without-uv.lock
	@indexes=$$($(BIN)/python .ci/package_index.py) && eval "$$indexes" || exit 1; \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r .venv/uv.lock \
		&& $(BIN)/uv pip install --quiet --compile-bytecode --python $(BIN)/python --require-hashes -r requirements.lock \
		|| { echo "Environment: uv did not work here; installing with pip, about a minute"; \
		$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r .venv/without-uv.lock; }
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable . $(if $(wildcard proof/pyproject.toml),--editable ./proof)
	@$(BIN)/python -m compileall -q src $(wildcard proof)
	@touch $@

lock: $(READY) ## resolve the dependencies of pyproject.toml anew
	@$(BIN)/uv pip compile --quiet pyproject.toml --extra dev --universal --generate-hashes \
		--python-version 3.11 --no-header --output-file requirements.lock

sbom: $(READY) ## what is installed as a CycloneDX bill of materials: results/sbom.json
	@mkdir -p results
	@$(BIN)/uv tool run --from cyclonedx-bom==7.5.0 cyclonedx-py environment --output-reproducible --pyproject pyproject.toml --of JSON \
		--output-file results/sbom.json $(BIN)/python
	@echo "The bill of materials: results/sbom.json"

licences: $(READY) ## what each locked package is licensed under: results/licences.md
	@mkdir -p results
	@$(BIN)/python docs/hooks/licences.py > results/licences.md
	@echo "The licences: results/licences.md"
