# Entry points of the project; `make help` lists them.
# Variables: CORES (cores of a sweep; the tests have one worker more, because they also wait for other processes), PYTHON (the Python
# that .venv is made with).

SHELL := bash
.DEFAULT_GOAL := help
CORES ?= 2
BIN := .venv/bin
STAMP := .local/setup.done
CCX_BUILD := scripts/ccx/build.sh $(wildcard scripts/ccx/patches/*.patch)
export PATH := $(CURDIR)/$(BIN):$(PATH)

# Set-up is redone when its inputs are newer than the stamp, or when .venv was removed.
ABSENT := $(if $(wildcard $(BIN)/limo),,absent)

.PHONY: help setup cluster ccx-tuned sweep test lint format benchmark performance accuracy standard docs schemas lock clean-setup absent

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "make %-12s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(STAMP) ## make .venv, install the locked packages and CalculiX, and tune that

$(STAMP): pyproject.toml requirements.lock scripts/setup.sh scripts/system_packages.sh $(CCX_BUILD) $(ABSENT)
	@bash scripts/setup.sh
	@mkdir -p $(@D) && touch $@

CLUSTER := .local/cluster.done
cluster: $(CLUSTER) ## add what sweeps on a Slurm cluster need (docs/cluster.md)

$(CLUSTER): $(STAMP) requirements-cluster.lock scripts/cluster.sh
	@bash scripts/cluster.sh
	@touch $@

ccx-tuned: setup ## build CalculiX for this processor (set-up tries it, too; here a failure is an error)
	@bash scripts/ccx/build.sh

sweep: setup ## solve the pressure-volume study, print its table and draw its figure
	@$(BIN)/limo sweep pressure_volume --cores $(CORES); code=$$?; \
		[ $$code -ne 0 -a $$code -ne 3 ] || $(BIN)/limo table results/studies/pressure_volume/study.nc; exit $$code

test: setup lint cluster ## lint, then run every test
	@bash scripts/browser.sh
	@bash scripts/slurm.sh install
	@OMP_NUM_THREADS=1 $(BIN)/pytest --numprocesses $$(($(CORES) + 1)) --dist loadscope --no-loadscope-reorder

lint: setup ## check style of Python and Snakemake files
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/snakefmt --check Snakefile workflow
	@$(BIN)/snakemake --lint

format: setup ## format Python and Snakemake files in place
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .
	@$(BIN)/snakefmt Snakefile workflow

benchmark: setup ## print where the time of the solved cases went
	@$(BIN)/limo benchmark

# What is measured together, its configuration, and cores if not CORES; every batch is resumed where it was stopped.
BATCHES := levers:config/levers/config.yaml stock:config/stock/config.yaml grid_preview_calculix:config/grids/preview_calculix.yaml \
	grid_preview_newton:config/grids/preview_newton.yaml grid_paper_density_newton:config/grids/paper_density_newton.yaml \
	alone_newton:config/grids/alone_newton.yaml:1

performance: setup ## measure what everything costs (hours) and write docs/performance.md
	@set -e; for batch in $(BATCHES); do \
		IFS=: read -r name config cores <<<"$$batch"; \
		OMP_NUM_THREADS=1 $(BIN)/snakemake --cores $${cores:-$(CORES)} --config file=$$config; \
		$(BIN)/limo performance record $$name --config $$config; \
	done
	$(BIN)/limo performance overhead --config config/grids/preview_newton.yaml
	$(BIN)/limo docs docs/performance.md README.md

accuracy: setup ## measure errors (hours) and write docs/accuracy.md
	@OMP_NUM_THREADS=1 $(BIN)/snakemake --cores $(CORES) accuracy
	$(BIN)/limo docs docs/accuracy.md README.md

# As much as is not there yet, here or elsewhere: may be stopped and started again, and committed in between.
SETS := standard as_in_paper
standard: setup ## solve what docs/gallery/standard and docs/gallery/as_in_paper lack (hours), add it, and check the paper's statements
	@for set in $(SETS); do chosen="--set $$set --config config/$$set.yaml"; \
		lacks=$$($(BIN)/limo gallery $$chosen --lacking) && { [ -z "$$lacks" ] || \
		OMP_NUM_THREADS=1 $(BIN)/snakemake --cores $(CORES) --keep-going --config file=config/$$set.yaml -- $$lacks; }; \
		$(BIN)/limo gallery $$chosen; \
	done
	$(BIN)/limo docs docs/paper_check.md docs/paper_check.csv README.md

docs: setup ## write what is generated in the documents and needs no solver: README, references, reports
	@$(BIN)/limo docs

schemas: setup ## write the schemas of the configuration files
	@$(BIN)/python -m limo.config.json_schemas workflow/schemas

lock: ## write requirements.lock anew from pyproject.toml (delete it first to renew every pin)
	@"$${PYTHON:-python3}" -m venv --clear .local/lock
	@.local/lock/bin/python -m pip install --quiet --disable-pip-version-check uv
	@.local/lock/bin/uv pip compile --quiet --universal --generate-hashes --python-version 3.11 --extra dev \
		--no-annotate --no-emit-index-url --custom-compile-command 'make lock' --output-file requirements.lock pyproject.toml
	@.local/lock/bin/uv pip compile --quiet --universal --generate-hashes --python-version 3.11 --extra cluster \
		--constraints requirements.lock --no-header --no-annotate --no-emit-index-url --output-file .local/lock/all pyproject.toml
	@{ echo '# By `make lock`: what sweeps on a cluster need besides requirements.lock.'; \
		awk 'NR == FNR {if (/^[^ #]/) seen[$$1]; next} /^[^ ]/ {on = !($$1 in seen)} on' requirements.lock .local/lock/all; \
		} >requirements-cluster.lock
	@rm -rf .local/lock

clean-setup: ## remove what `make setup` made in this folder
	rm -rf .venv .local
