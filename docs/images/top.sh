#!/usr/bin/env bash
# Makes top-80x24.png and top-160x50.png: the cockpit as a simulated fleet shows it. Needs Chromium.
#   bash docs/images/top.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
here=docs/images
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
cargo build --workspace --bins
cargo run -p fleet-tests --example cockpit -- "$made"
for size in 80x24 160x50; do
  svg=$made/top-$size.svg
  width=$(sed -n "s/.* width='\([0-9]*\)' height=.*/\1/p;q" "$svg" | head -1)
  height=$(sed -n "s/.* height='\([0-9]*\)' font.*/\1/p;q" "$svg" | head -1)
  chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size="$width,$height" \
    --screenshot="$PWD/$here/top-$size.png" "file://$svg" 2>/dev/null
done
ls -l "$here"/top-*.png
