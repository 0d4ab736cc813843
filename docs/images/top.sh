#!/usr/bin/env bash
# Makes top-80x24.png and top-160x50.png: the cockpit as a simulated fleet shows it. Needs Chromium.
#   bash docs/images/top.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
here=docs/images
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
cargo build --workspace --bins --example cockpit
"${CARGO_TARGET_DIR:-target}/debug/examples/cockpit" "$made"
for size in 80x24 160x50; do
  svg=$made/top-$size.svg
  # Cells of 9 by 18, and a margin.
  width=$((${size%x*} * 9 + 16)) height=$((${size#*x} * 18 + 16))
  chromium --headless --no-sandbox --disable-gpu --hide-scrollbars --window-size="$width,$height" \
    --screenshot="$PWD/$here/top-$size.png" "file://$svg" 2>/dev/null
done
ls -l "$here"/top-*.png
