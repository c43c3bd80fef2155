#!/usr/bin/env bash
# Makes three.js and vega.js of this folder again, with the licence of three. Needs node, npm and magtip's .venv.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python=$here/../../../../.venv/bin/python
{ echo '(() => {'; "$python" -c 'import vl_convert; print(vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;"))'; echo '})();'; } > "$here/vega.js"
cd "$work"
npm install --silent --no-fund --no-audit three@0.187.0 esbuild@0.28.2
cp "$here/three_entry.js" .
npx esbuild three_entry.js --bundle --minify --charset=utf8 --format=iife --global-name=THREE --legal-comments=inline --outfile="$here/three.js"
cp node_modules/three/LICENSE "$here/three.LICENSE"
