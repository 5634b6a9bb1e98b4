# `make demo` and `make test` set up what they need. PYTHON=python3.12 chooses the interpreter.
PYTHON ?=
export PYTHON
BIN := .venv/bin
PYTEST_ARGS ?=
UPGRADE ?=
# What touches each package, without the packages that only the tests bring.
LOWEST := tests/test_cli.py tests/test_exr.py tests/test_scene.py tests/test_spectra.py tests/test_report.py tests/test_batch.py tests/test_cache.py tests/test_documents.py
LOCK := uv pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-header --annotation-style line

.DEFAULT_GOAL := help
.PHONY: demo test run dev lint pytest audit lowest coverage wheel format docs gallery lock clean help

demo: run  ## fit a layered material to a render and print a verified shader, into out/demo
	$(BIN)/layerfit demo -o out/demo

test: lint pytest wheel  ## everything that has to hold before a change lands

run:  # .venv, to run layerfit
	@sh tools/setup.sh run

dev:  ## .venv, to work on layerfit
	@sh tools/setup.sh dev

lint: dev  ## style and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright --pythonpath $(BIN)/python

audit:  ## known vulnerabilities of the packages that layerfit runs on (needs uv, and asks pypi.org; no answer is a failure)
	uv tool run pip-audit --strict --disable-pip --require-hashes -r requirements/run.txt

lowest: dev  ## tests on the lowest versions that pyproject.toml allows (needs uv)
	uv venv --quiet --clear .venv-lowest
	uv pip install --quiet --python .venv-lowest/bin/python --resolution lowest-direct ".[metals,table,plot]" --group wheel
	.venv-lowest/bin/python -m pytest -W default $(LOWEST)

coverage: dev  ## which lines of the source the tests run
	$(BIN)/pytest --numprocesses auto --dist worksteal --cov layerfit --cov-report term:skip-covered --ignore tests/test_wheel.py $(PYTEST_ARGS)

# Without test_wheel.py, which `make wheel` runs where it belongs.
pytest: dev  ## the tests, on the source tree; PYTEST_ARGS="-k fresnel" for some of them
	$(BIN)/pytest --numprocesses auto --dist worksteal --durations 10 --ignore tests/test_wheel.py $(PYTEST_ARGS)

wheel: dev  ## build the wheel and run the tests marked `wheel` on it, away from the source tree
	rm -rf dist
	$(BIN)/python -m build --no-isolation --outdir dist >/dev/null
	@sh tools/setup.sh wheel
	.venv-wheel/bin/pytest -m wheel $$(grep -l 'mark\.wheel' tests/test_*.py)

format: dev  ## put the sources in form
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: dev  ## the documentation as a site in out/site; every link in it leads somewhere
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

gallery: dev  ## print and draw what ships: the shaders and pictures beside the presets, and docs/gallery.md
	$(BIN)/python tools/gallery.py

lock:  ## lock the packages that pyproject.toml names (needs uv); UPGRADE=--upgrade for newer ones
	$(LOCK) $(UPGRADE) pyproject.toml -o requirements/run.txt
	$(LOCK) $(UPGRADE) -c requirements/run.txt --group build -o requirements/build.txt
	$(LOCK) $(UPGRADE) -c requirements/run.txt --group wheel -o requirements/wheel.txt
	$(LOCK) $(UPGRADE) -c requirements/run.txt -c requirements/build.txt -c requirements/wheel.txt \
		pyproject.toml --extra cluster --extra digits --extra interchange --extra metals --extra notebook --extra plot --extra study --extra table --extra window --group dev -o requirements/dev.txt

clean:  ## remove what make made
	rm -rf .venv .venv-wheel .venv-lowest dist out .pytest_cache .ruff_cache .hypothesis

help:  ## this list
	@sed -n 's/^\([a-z]*\):[^#]*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 10
