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

python3 -c 'import ensurepip' 2>/dev/null || install_on_debian python3-venv
[ -x .venv/bin/python ] || python3 -m venv .venv
if [ "${1-}" = test ]; then
    .venv/bin/pip install -c requirements.lock -e '.[test]'
    .venv/bin/python -c 'import pinocchio' 2>/dev/null || install_on_debian libgomp1
else
    .venv/bin/pip install -c requirements.lock -e .
fi
