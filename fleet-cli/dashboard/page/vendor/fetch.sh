#!/usr/bin/env bash
# Brings the page's libraries from the npm registry (needs npm) and writes SHA256SUMS:
#   fetch.sh            the versions below, or fails if they are not what SHA256SUMS says
#   fetch.sh --new      after a version below was raised: writes SHA256SUMS anew
#   fetch.sh --check    only compares what is here with SHA256SUMS (no network)
set -euo pipefail
cd "$(dirname "$0")"

# package@version, file in the package, file here
files=(
  "lit-html@3.3.3 lit-html.js lit-html.js"
  "lit-html@3.3.3 directive.js directive.js"
  "lit-html@3.3.3 directive-helpers.js directive-helpers.js"
  "lit-html@3.3.3 directives/repeat.js directives/repeat.js"
  "lit-html@3.3.3 directives/live.js directives/live.js"
  "lit-html@3.3.3 LICENSE LICENSE-lit-html.txt"
  "uplot@1.6.32 dist/uPlot.iife.min.js uPlot.iife.min.js"
  "uplot@1.6.32 dist/uPlot.min.css uPlot.min.css"
  "uplot@1.6.32 LICENSE LICENSE-uPlot.txt"
  "d3-dispatch@3.0.2 dist/d3-dispatch.min.js d3-dispatch.min.js"
  "d3-selection@3.0.1 dist/d3-selection.min.js d3-selection.min.js"
  "d3-drag@3.0.1 dist/d3-drag.min.js d3-drag.min.js"
  "d3-color@3.1.1 dist/d3-color.min.js d3-color.min.js"
  "d3-interpolate@3.0.2 dist/d3-interpolate.min.js d3-interpolate.min.js"
  "d3-timer@3.0.2 dist/d3-timer.min.js d3-timer.min.js"
  "d3-ease@3.0.2 dist/d3-ease.min.js d3-ease.min.js"
  "d3-transition@3.0.2 dist/d3-transition.min.js d3-transition.min.js"
  "d3-zoom@3.0.1 dist/d3-zoom.min.js d3-zoom.min.js"
  "d3-zoom@3.0.1 LICENSE LICENSE-d3.txt"
)

if [ "${1-}" != --check ]; then
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' EXIT
  for line in "${files[@]}"; do
    read -r package from to <<<"$line"
    if [ ! -d "$folder/$package" ]; then
      mkdir "$folder/$package"
      archive=$(cd "$folder" && npm pack --silent "$package" 2>/dev/null)
      tar xzf "$folder/$archive" -C "$folder/$package" --strip-components 1
    fi
    mkdir -p "$(dirname "$to")"
    # Source maps are not served: without this line no browser asks for them.
    sed '/^\/\/# sourceMappingURL=/d' "$folder/$package/$from" >"$to"
  done
  if [ "${1-}" = --new ]; then
    for line in "${files[@]}"; do
      read -r _ _ to <<<"$line"
      sha256sum "$to"
    done >SHA256SUMS
  fi
fi
sha256sum --quiet --check SHA256SUMS
echo "the libraries are those of SHA256SUMS"
