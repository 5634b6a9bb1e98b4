#!/bin/sh
# Install what a make target needs and does not find; a second call finds everything and returns at once.
#
#   sh tools/setup.sh run    .venv: layerfit, editable, with the locked packages that it runs on
#   sh tools/setup.sh dev    .venv: the same, and what tests and checks it
#   sh tools/setup.sh wheel  .venv-wheel: the wheel in dist/ with the packages that it runs on, pytest and nothing else
#
# Python 3.11 or later is all it takes; PYTHON=python3.12 chooses one. uv is used where it is found, because it is faster.
set -eu
cd "$(dirname "$0")/.."
goal=$1

say() { echo "setup: $*" >&2; }

installed() { "$@" --version >/dev/null 2>&1; }

version() { "$1" -c 'import sys; assert sys.version_info >= (3, 11); print(sys.version)' 2>/dev/null; }

find_python() {
    for python in ${PYTHON:-python3.13 python3.12 python3.11 python3 python}; do
        if version "$python" >/dev/null; then echo "$python" && return; fi
    done
    say "no Python 3.11 or later as ${PYTHON:-python3.13, python3.12, python3.11, python3 or python}: install one, or name it by make PYTHON=..."
    return 1
}

# An environment in folder $1, made anew where there is none or PYTHON asks for another version than it has.
environment() {
    if version "$1/bin/python" >/dev/null; then
        if [ -z "${PYTHON:-}" ] || [ "$(version "$1/bin/python")" = "$(version "$PYTHON")" ]; then return; fi
    fi
    python=$(find_python)
    rm -rf "$1"
    say "making $1 with $("$python" --version)"
    if installed uv; then
        uv venv --quiet --python "$(command -v "$python")" "$1"
    elif ! "$python" -m venv "$1"; then
        rm -rf "$1"
        say "$python cannot make an environment; on Debian or Ubuntu: apt-get install -y python3-venv"
        return 1
    fi
}

# `pip install`: the environment, then its arguments.
packages() {
    venv=$1
    shift
    if installed uv; then
        uv pip install --quiet --compile-bytecode --python "$venv/bin/python" "$@"
    else
        "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$@"
    fi
}

# System packages $2... for purpose $1: installed where that is possible, named where it is not.
system_packages() {
    purpose=$1
    shift
    install="apt-get install -y --no-install-recommends $*"
    if [ "$(id -u)" = 0 ] && installed apt-get; then
        say "$purpose: $install"
        export DEBIAN_FRONTEND=noninteractive
        if apt-get update -qq && $install -qq >/dev/null; then return; fi
    fi
    say "missing: $purpose. On Debian or Ubuntu run as root: $install"
}

has_gl() { .venv/bin/python -c 'import moderngl; moderngl.create_context(standalone=True, require=330, backend="egl")' 2>/dev/null; }

# The stamp of an environment is what it was made from.
wanted=$(cat pyproject.toml requirements/*.txt | cksum)

up_to_date() { [ "$(cat "$1" 2>/dev/null)" = "$wanted" ]; }

case $goal in
run | dev)
    environment .venv
    if ! up_to_date ".venv/$goal"; then
        say "installing the packages of requirements/$goal.txt"
        rm -f .venv/run .venv/dev
        if [ "$goal" = run ]; then
            packages .venv --require-hashes -r requirements/run.txt -r requirements/build.txt
        else
            packages .venv --require-hashes -r requirements/dev.txt
            echo "$wanted" >.venv/dev
        fi
        packages .venv --no-deps --no-build-isolation --editable .
        echo "$wanted" >.venv/run
    fi
    has_gl || system_packages "an OpenGL driver, to render shaders" libegl1 libgl1 libgl1-mesa-dri
    if [ "$goal" = dev ] && ! { command -v glslangValidator && command -v spirv-val; } >/dev/null; then
        system_packages "the GLSL and SPIR-V validators, for the tests" glslang-tools spirv-tools
    fi
    ;;
wheel)
    environment .venv-wheel
    if ! up_to_date .venv-wheel/wheel; then
        packages .venv-wheel --require-hashes -r requirements/run.txt -r requirements/wheel.txt
        echo "$wanted" >.venv-wheel/wheel
    fi
    packages .venv-wheel --no-deps --force-reinstall dist/*.whl
    ;;
esac
