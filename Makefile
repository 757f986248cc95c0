# make run   the panel with a simulated robot, at http://127.0.0.1:8000; PANEL=mobile-robot make run: a robot that drives
# make test  all that needs no Rust and no ROS, with a real browser: 13 minutes on a bare machine
# make test-robot  on the real bridge, real ROS 2 nodes, brokers, proxies and other browsers
# make test-long  real time, floods, faults, every screen, packaging: an hour; writes docs/test-report.md
# make check  types and style
# make format  writes the style that `make check` checks
# make docs  the documentation as a site, in build/docs; a dead link is an error
# make faults  every fault in its long form; writes the results as a table into docs/reliability.md
# make screenshots  every page at every size, theme and language, in build/screenshots; the README's pictures
# make mutants  changes the code that decides, one place at a time; lists what no unit test notices
# make soak  normal operation for SOAK_S seconds (default: an hour)
# make bench  this panel and its rivals side by side (25 minutes); QUICK=1 only shows that it works
# make bench-setup  installs what the benchmark's rivals need into the cache
# make release  wheel, sdist, SBOM and documentation, checked in a clean environment, in dist/release
# make audit  known weaknesses of the locked dependencies, by pip-audit; says so where its data is not reached
# make dev   the panel; restarts whenever a file is saved

PYTHON ?= python3
CACHE := $(or $(XDG_CACHE_HOME),$(HOME)/.cache)/operator-panel
PIP_INSTALL := -m pip install --disable-pip-version-check --quiet --require-hashes --no-deps -r

BENCH := $(CACHE)/bench
FRONTEND := $(CACHE)/frontend
export BENCH_CACHE := $(BENCH)
export TEST_BRIDGE := $(CACHE)/bridge/release/test-bridge
export TEST_ROS_PYTHON := $(CURDIR)/.venv-ros/bin/python

.PHONY: fonts run test test-robot test-long check format dev docs wheel release audit faults screenshots soak mutants bench bench-setup test-parts bridge lock clean
.DELETE_ON_ERROR:

run: .venv/run .venv/bin/operator-panel
	@echo "starting the panel server"
	@.venv/bin/python -m app.cli run $(PANEL)

# A panel in another folder: `KIOSK_PANEL=… make dev`.
WATCHED := $(addprefix --reload-dir=,app templates static $(if $(KIOSK_PANEL),$(realpath $(dir $(KIOSK_PANEL)))))
WATCHED += $(patsubst %,'--reload-include=*.%',toml json json5 html css js po msg srv action sql)
dev: .venv/test
	KIOSK_DEV=1 KIOSK_LOG_LEVEL=debug .venv/bin/uvicorn app.main:app --reload $(WATCHED)

# The tests in three tiers (tests/tiers.py): WORKERS processes in parallel, a file in each.
# `ARGS="-k robot" make test`, with options of pytest, runs these tests of any tier in one process, and builds or
# installs only the real parts (bridge, ROS, browser) that they use. With ARGS, Debian packages are only named:
# `make system` installs them.
WORKERS ?= 4
IN_WORKERS = -n $(WORKERS) --dist loadfile --no-loadscope-reorder
# Bytecode of the tests is cached, even if PYTHONDONTWRITEBYTECODE is set, and is compiled once before
# the workers start. Otherwise each worker would spend 20 s on it.
test test-robot test-long: export PYTHONDONTWRITEBYTECODE :=
# Errors are reported by the workers.
COMPILE_TESTS = .venv/bin/pytest --collect-only -qq > /dev/null || true
ifdef ARGS
test: .venv/test
	@parts=$$(.venv/bin/python -m tests.tiers $(ARGS)) && $(MAKE) --no-print-directory .venv/test $$parts
	.venv/bin/pytest $(ARGS)
else
# Without the right to install packages, the tests that need no browser run, and the exit status is not 0.
test: .venv/test
	@sh tests/system.sh browser || echo "the tests without a browser run now"
	$(COMPILE_TESTS)
	.venv/bin/pytest --tier test $(IN_WORKERS)
endif

test-robot: test-parts
	$(COMPILE_TESTS)
	.venv/bin/pytest --tier robot $(IN_WORKERS)

test-long: test-parts
	$(COMPILE_TESTS)
	WORKERS=$(WORKERS) .venv/bin/python -m tests.long

PYTHON_FOLDERS := app tests bench deploy docs
FRONTEND_FOLDERS := static bench docs/examples
BIOME := $(FRONTEND)/node_modules/.bin/biome
BIOME_OPTIONS := --config-path=tests/frontend
check: .venv/test $(FRONTEND)/ready
	.venv/bin/ruff check $(PYTHON_FOLDERS)
	.venv/bin/ruff format --check $(PYTHON_FOLDERS)
	$(BIOME) ci --error-on-warnings $(BIOME_OPTIONS) $(FRONTEND_FOLDERS)
	$(FRONTEND)/node_modules/.bin/tsc --project tests/frontend
	.venv/bin/mypy
	.venv/bin/python -m app.i18n
	.venv/bin/python -m docs._generate --check

format: .venv/test $(FRONTEND)/ready
	.venv/bin/ruff check --fix $(PYTHON_FOLDERS)
	.venv/bin/ruff format $(PYTHON_FOLDERS)
	$(BIOME) check --write $(BIOME_OPTIONS) $(FRONTEND_FOLDERS)

# Warnings are errors. The generated parts of the pages are written first.
docs: .venv-docs/ready
	.venv-docs/bin/python -m docs._generate
	.venv-docs/bin/sphinx-build -W -n -E -a --keep-going --quiet --doctree-dir build/doctrees docs build/docs
	@echo "build/docs/index.html"

# FORM=short: the short form, as in `make test`.
FORM ?= long
FAULTS_TESTS := tests/faults/test_faults_of_*.py tests/cell/permission/test_at_random.py tests/records/test_killed.py \
	tests/bridge/test_publishers_on_bridge.py tests/bridge/test_reference_system.py \
	tests/cell/session/test_nothing_grows.py tests/cell/commands/test_holds.py tests/cell/permission/test_control_authority.py \
	tests/ros/messages/test_fields.py tests/ros/messages/test_values.py tests/ros/messages/test_cdr_on_ros.py \
	tests/cell/commands/test_final_check.py tests/cell/robot/test_topics.py tests/panel/test_toml_lines.py \
	tests/panel/test_mistakes.py tests/web/test_openapi.py tests/tools/kiosk/test_watcher.py
FAULTS_RESULTS := $(CACHE)/faults.jsonl
faults: test-parts
	mkdir -p $(CACHE)
	rm -f $(FAULTS_RESULTS)
	FAULTS=$(FORM) FAULTS_RESULTS=$(FAULTS_RESULTS) .venv/bin/pytest --timeout 0 $(FAULTS_TESTS) $(ARGS)
	FAULTS_RESULTS=$(FAULTS_RESULTS) .venv/bin/python -m tests.faults.power
	FAULTS=$(FORM) .venv/bin/python -m tests.faults.results $(FAULTS_RESULTS) docs/reliability.md

screenshots: system .venv/test
	.venv/bin/python -m tests.screenshots

soak: test-parts
	.venv/bin/python -m tests.faults.soak

# `ARGS="--only verify" make mutants`: of one module; `--most 600`: so many, evenly spread.
mutants: test-parts
	.venv/bin/python -m tests.mutants $(ARGS)

wheel: .venv/build .venv/bin/operator-panel
	.venv/bin/python -m hatchling build --target wheel --directory dist

# `make release TAG=v0.2.0` also checks that the version and the changelog match the tag.
# It needs a green `make test-long` of this commit.
release: docs .venv-release/ready .venv/test
	.venv/bin/python -m tests.long --check
	.venv-release/bin/hadolint deploy/Containerfile
	.venv-release/bin/python deploy/release.py dist/release $(if $(TAG),--tag $(TAG))

audit: .venv-release/ready
	.venv-release/bin/python deploy/audit.py

test-parts: system .venv/test .venv-ros/ready bridge

.PHONY: system browser
system:
	$(if $(ARGS),INSTALL=no )sh tests/system.sh

browser:
	$(if $(ARGS),INSTALL=no )sh tests/system.sh browser

# zenohd is a program without a library: cargo installs it, with its own lock, from what the workspace has built.
ZENOH = $(shell sed -n 's/^zenoh-config = "=\(.*\)"/\1/p' tests/bridge_crate/Cargo.toml)
bridge: system
	@[ -x $(CACHE)/bridge/bin/zenohd ] || echo "building the bridge, a node on hiroz and zenohd for the tests: once, 8 to 15 minutes"
	cargo build --release --locked --config tests/profile.toml --workspace --manifest-path tests/Cargo.toml --target-dir $(CACHE)/bridge
	cargo install --quiet --locked --config tests/profile.toml zenohd@$(ZENOH) --root $(CACHE)/bridge --target-dir $(CACHE)/bridge

NEW_ENOUGH := $(PYTHON) -c 'import sys; sys.exit(None if sys.version_info >= (3, 11) else "the panel needs Python 3.11 or later, and this is %d.%d: make $(MAKECMDGOALS) PYTHON=python3.11" % sys.version_info[:2])'

.venv/bin/python:
	@$(NEW_ENOUGH)
	@$(PYTHON) -c "import ensurepip" 2>/dev/null || PYTHON=$(PYTHON) sh tests/system.sh python3-venv
	@echo "making a Python environment in .venv: once, some seconds"
	@$(PYTHON) -m venv .venv

.venv/run: deploy/requirements.lock | .venv/bin/python
	@echo "installing the server's packages into .venv: once, up to a minute"
	@.venv/bin/python $(PIP_INSTALL) $<
	@touch $@

.venv/build: deploy/build.lock | .venv/bin/python
	.venv/bin/python $(PIP_INSTALL) $<
	touch $@

# The command of this checkout, from any folder. -P: Python does not import an `app` of the current folder.
.venv/bin/operator-panel: Makefile | .venv/bin/python
	@printf '%s\n' '#!/bin/sh' 'here=$$(dirname "$$(readlink -f "$$0")")' \
		'PYTHONPATH="$$here/../.." exec "$$here/python" -P -m app.cli "$$@"' >$@
	@chmod +x $@

.venv-docs/ready: docs/requirements.lock
	@$(NEW_ENOUGH)
	$(PYTHON) -m venv --clear .venv-docs
	.venv-docs/bin/python $(PIP_INSTALL) $<
	touch $@

.venv-release/ready: deploy/release.lock
	@$(NEW_ENOUGH)
	$(PYTHON) -m venv --clear .venv-release
	.venv-release/bin/python $(PIP_INSTALL) $<
	touch $@

.venv/test: tests/requirements.lock | .venv/bin/python
	@echo "installing the packages of the tests into .venv: once, up to two minutes"
	@.venv/bin/python $(PIP_INSTALL) $<
	@touch $@ .venv/run .venv/build

# `ready` is a copy of the lock file that was installed: checkouts with the same lock share the packages.
$(FRONTEND)/ready: tests/frontend/package.json tests/frontend/package-lock.json
	@sh tests/system.sh npm
	@cmp -s tests/frontend/package-lock.json $@ || { \
		echo "installing what checks scripts and style sheets: once, some seconds" && mkdir -p $(@D) && \
		cp tests/frontend/package.json tests/frontend/package-lock.json $(@D) && \
		npm ci --prefix $(@D) --ignore-scripts --no-audit --no-fund --loglevel=error; }
	@cp tests/frontend/package-lock.json $@

FOR_ROS := $(PYTHON) -c 'import sys; sys.exit(None if sys.version_info[:2] == (3, 11) else "the ROS 2 wheels of the tests are for Python 3.11: make test PYTHON=python3.11")'

.venv-ros/ready: tests/ros_nodes/requirements.lock | system
	@$(FOR_ROS)
	@echo "installing ROS 2 for the tests into .venv-ros: once, up to two minutes"
	@$(PYTHON) -m venv .venv-ros
	@.venv-ros/bin/python $(PIP_INSTALL) $<
	@touch $@

# ARGS: phases and peers, such as `ARGS="down up --peers plain"`. A quick run does not overwrite the
# results of the last full run.
bench: .venv/test bridge $(BENCH)/kiosk/ready
	rm -rf $(BENCH)/kiosk/dist
	.venv/bin/python -m build --wheel --no-isolation --outdir $(BENCH)/kiosk/dist >/dev/null
	$(BENCH)/kiosk/bin/python -m pip install --disable-pip-version-check --quiet --no-deps --force-reinstall $(BENCH)/kiosk/dist/*.whl
	.venv/bin/python -m bench $(if $(QUICK),--results $(BENCH)/quick,--page docs/benchmark.md) $(ARGS)
	$(if $(QUICK),,.venv/bin/python -m docs._generate)

# This panel, the robot, and the rivals, each in a separate environment. See bench/README.md.
bench-setup: system .venv/test bridge $(addprefix $(BENCH)/,kiosk/ready robot/ready rosbridge/ready nicegui/ready pages/ready router)

$(BENCH)/kiosk/ready: deploy/requirements.lock
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python $(PIP_INSTALL) $<
	touch $@

$(BENCH)/robot/ready: tests/ros_nodes/requirements.lock tests/requirements.lock | system
	@$(FOR_ROS)
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python $(PIP_INSTALL) $<
	sed -n '/^eclipse-zenoh==/,/[^\\]$$/p' tests/requirements.lock >$(@D)/zenoh.lock
	$(@D)/bin/python $(PIP_INSTALL) $(@D)/zenoh.lock
	touch $@

$(BENCH)/rosbridge/ready: bench/peers/rosbridge_rs/requirements.lock bench/peers/rosbridge_rs/shims.sh | system
	@$(FOR_ROS)
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python $(PIP_INSTALL) $<
	chmod +x $(@D)/lib/python3.11/site-packages/rosbridge_server_rs/rosbridge_server_rs_jazzy
	sh bench/peers/rosbridge_rs/shims.sh $(@D)
	touch $@

$(BENCH)/nicegui/ready: bench/peers/nicegui_zenoh/requirements.lock | system
	$(PYTHON) -m venv --clear $(@D)
	$(@D)/bin/python $(PIP_INSTALL) $<
	touch $@

$(BENCH)/pages/ready: bench/peers/package.json bench/peers/package-lock.json bench/peers/bundle.cjs $(wildcard bench/peers/*/page.js)
	sh tests/system.sh npm
	mkdir -p $(@D)
	cp bench/peers/package.json bench/peers/package-lock.json $(@D)
	npm ci --prefix $(@D) --ignore-scripts --no-audit --no-fund --loglevel=error
	node bench/peers/bundle.cjs $(@D)
	touch $@

.PHONY: $(BENCH)/router
$(BENCH)/router: system
	nice cargo build --quiet --release --locked --manifest-path bench/peers/router/Cargo.toml --target-dir $@

# Renews the locked versions, then the message definitions that rosbags has. Needs uv.
lock:
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 pyproject.toml -o deploy/requirements.lock
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 --group build -o deploy/build.lock
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 --group release -o deploy/release.lock
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 pyproject.toml --extra replay --extra mqtt --extra oidc --extra edit --extra postgres --group test -o tests/requirements.lock
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 pyproject.toml --group docs -o docs/requirements.lock
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 tests/ros_nodes/requirements.in -o tests/ros_nodes/requirements.lock
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 bench/peers/rosbridge_rs/requirements.in -o bench/peers/rosbridge_rs/requirements.lock
	uv pip compile --quiet --upgrade --generate-hashes --no-header --no-annotate --python-version 3.11 bench/peers/nicegui_zenoh/requirements.in -o bench/peers/nicegui_zenoh/requirements.lock
	$(MAKE) --no-print-directory .venv/test
	.venv/bin/python -m app.ros.messages.make_builtin

# The panel's fonts from npm's @fontsource packages, and the widths of their letters. The Japanese one keeps only what
# is needed.
fonts: .venv/test
	mkdir -p build/fonts
	cd build/fonts && for name in ibm-plex-sans noto-sans-jp; do npm pack --silent @fontsource/$$name@5.3.0 && tar xzf fontsource-$$name-5.3.0.tgz && cp package/LICENSE ../../static/fonts/$$name.LICENSE && mv package $$name || exit 1; done
	$(PYTHON) deploy/font_characters.py > build/fonts/characters.txt
	for weight in 400 700; do \
		cp build/fonts/ibm-plex-sans/files/ibm-plex-sans-latin-$$weight-normal.woff2 static/fonts/ibm-plex-sans-$$weight.woff2 && \
		.venv/bin/python -m fontTools.subset build/fonts/noto-sans-jp/files/noto-sans-jp-japanese-$$weight-normal.woff2 --text-file=build/fonts/characters.txt --flavor=woff2 --layout-features=kern,palt,locl,ccmp --desubroutinize --no-hinting --output-file=static/fonts/noto-sans-jp-$$weight.woff2 || exit 1; \
	done
	.venv/bin/python -m deploy.font_widths

clean:
	rm -rf .venv .venv-ros .venv-docs .venv-release dist build .mypy_cache .ruff_cache
