#!/bin/sh
# Make the environment .venv of this project; with the word "test", also what its tests and checks need.
#
# Debian's python3 cannot make virtual environments, and Pinocchio, an oracle of the tests, needs Debian's libgomp1. Only
# what is missing is installed on the system: as root, or with sudo, which then asks for your password.
set -eu
cd "$(dirname "$0")/.."

install_on_debian() {
    echo "set-up: $1 is missing; installing it with apt-get" >&2
    if [ "$(id -u)" = 0 ]; then as_root=; else as_root=sudo; fi
    $as_root sh -c "apt-get update && apt-get install -y $1"
}

refuse() {
    echo "set-up: $1" >&2
    exit 1
}

new_enough='import sys; sys.exit(sys.version_info < (3, 11))'
python3 -c "$new_enough" 2>/dev/null || refuse "python3 is missing or older than 3.11; install a newer Python, and write \
its name in place of python3 in docs/set-up.sh"
[ ! -e .venv ] || { .venv/bin/python -c "$new_enough" && .venv/bin/python -m pip --version >/dev/null; } 2>/dev/null ||
    refuse "the folder .venv is incomplete, or of a Python older than 3.11; delete it, and run this again"
python3 -c 'import ensurepip' 2>/dev/null || install_on_debian python3-venv
[ -x .venv/bin/python ] || python3 -m venv .venv
if [ "${1-}" = test ]; then
    .venv/bin/pip install -c requirements.lock -e '.[test]'
    .venv/bin/python -c 'import pinocchio' 2>/dev/null || install_on_debian libgomp1
else
    .venv/bin/pip install -c requirements.lock -e .
fi
