#!/usr/bin/env bash
# Bundle three.js, with its licence in front, into graspdb/view/assets/three.min.js. Needs npm.
# Run it again after a change of package.json or parts.js, and commit what it writes.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cp package.json parts.js "$scratch"
cd "$scratch"
npm install --silent --no-audit --no-fund
npx esbuild parts.js --bundle --minify --format=iife --global-name=THREE --target=es2022 --legal-comments=none \
    --charset=ascii --banner:js="/*!$(printf '\n%s\n' "$(cat node_modules/three/LICENSE)")
*/" --outfile=three.min.js
cp three.min.js "$OLDPWD/../../graspdb/view/assets/three.min.js"
