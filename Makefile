# Glint: `make render` draws the demo, `make test` runs the tests; both set everything up first.
#
#   make render SCENE=any.blend FRAME=7 OUT=pictures     render a file of yours
#   make render BPY=4.2.x                                with another Blender: 4.2.x, 4.5.x, 5.0.x (default), 5.2.x
#   make test ARGS="-k camera"                           pass options to pytest

.PHONY: help setup render test slow test-blenders sanitize extension wheels windows release bench contact-sheet gallery references lint manual clean
.DEFAULT_GOAL := help

BPY ?=
SCENE ?=
FRAME ?=
OUT ?= out
ARGS ?=

# Any Python from 3.11 on can start the scripts; they look for the one that the chosen Blender needs.
START := $(firstword $(foreach name,$(PYTHON) python3.11 python3 python3.12 python3.13,\
  $(shell $(name) -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 && echo $(name))))
ifeq ($(START),)
  $(error Glint's make needs Python 3.11. Debian 12 and Ubuntu: apt-get install python3.11 python3.11-venv; elsewhere: pyenv install 3.11)
endif
GO := $(START) packaging

help:
	@awk '/^#/ { sub(/^# ?/, ""); print; next } { exit }' Makefile
	@echo "targets: setup render test slow test-blenders sanitize extension wheels windows release bench contact-sheet gallery references lint manual clean"

setup:
	@$(GO)/environment.py --bpy "$(BPY)"

render:
	@$(GO)/render_scene.py --bpy "$(BPY)" --scene "$(SCENE)" --frame "$(FRAME)" --out "$(OUT)"

test:
	@$(GO)/run_tests.py --bpy "$(BPY)" $(if $(ARGS),,--parallel) -- -m "not slow" $(ARGS)

slow:
	@$(GO)/run_tests.py --bpy "$(BPY)" $(if $(ARGS),,--parallel) -- -m slow $(ARGS)

test-blenders:
	@$(GO)/blender_matrix.py $(ARGS)

sanitize:
	@$(GO)/sanitize.py

extension:
	@$(GO)/extension_zips.py --bpy "$(BPY)"

wheels:
	@$(GO)/wheels.py --bpy "$(BPY)" $(ARGS)

windows:
	@$(GO)/foreign.py --bpy "$(BPY)" windows-x64 $(ARGS)

release:
	@$(GO)/release.py --bpy "$(BPY)" $(ARGS)

bench:
	@$(GO)/run_tool.py --bpy "$(BPY)" tests/bench/bench.py $(ARGS)

contact-sheet:
	@$(GO)/run_tool.py --bpy "$(BPY)" tests/cycles/contact_sheet.py $(ARGS)

gallery:
	@$(GO)/run_tool.py --bpy "$(BPY)" tests/cycles/gallery.py $(ARGS)
	@$(GO)/run_tool.py --bpy "$(BPY)" tests/cycles/accuracy_pictures.py

references:
	@$(GO)/run_tool.py --bpy "$(BPY)" tests/engine/renew_references.py $(ARGS)

lint:
	@$(GO)/lint.py --bpy "$(BPY)"

manual:
	@$(GO)/manual.py --bpy "$(BPY)"

clean:
	rm -rf build dist out .pytest_cache .ruff_cache .hypothesis
