#!/usr/bin/env bash
# Bundles the 3D player of reports: three.js and player/*.js into one minified file beside the page's template.
# Needs node and npm, and the network; users and tests need neither, since the built file is package data. Its first
# line has the hash of what it was built from, which a test compares.
#
#   excite/views/bundle/build.sh
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
export LC_ALL=C

npm ci --no-audit --no-fund
sources=$(cat player/*.js package-lock.json | sha256sum | cut -d ' ' -f 1)
./node_modules/.bin/esbuild player/main.js --bundle --minify --format=iife --target=es2020 --legal-comments=none \
    --banner:js="/* sources $sources; includes three.js, MIT licence: see three.LICENSE */" \
    --outfile=../page/player.min.js.new
cp node_modules/three/LICENSE ../page/three.LICENSE
mv ../page/player.min.js.new ../page/player.min.js
