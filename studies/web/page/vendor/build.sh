#!/usr/bin/env bash
# Makes three.js, uPlot.iife.min.js and uPlot.min.css of this folder again, with their licences. Needs node and npm.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-fund --no-audit three@0.187.0 uplot@1.6.32 esbuild@0.28.2
cp "$here/three_entry.js" .
npx esbuild three_entry.js --bundle --minify --charset=utf8 --format=iife --global-name=THREE --legal-comments=inline --outfile="$here/three.js"
cp node_modules/uplot/dist/uPlot.iife.min.js node_modules/uplot/dist/uPlot.min.css "$here"
cp node_modules/uplot/LICENSE "$here/uPlot.LICENSE"
cp node_modules/three/LICENSE "$here/three.LICENSE"
