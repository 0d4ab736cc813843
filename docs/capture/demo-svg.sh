#!/usr/bin/env bash
# Makes docs/demo.svg: runs the demo in a terminal of 100 × 30 and captures its picture mid-way.
# Needs tmux and python3. FLEET_CLI names the binary (default: target/release/fleet-cli).
set -euo pipefail
cd "$(dirname "$0")/../.."
cli=${FLEET_CLI:-target/release/fleet-cli}
out=${1:-docs/demo.svg}
at_s=${AT_S:-33} # simulated seconds at which the picture is taken
[ -x "$cli" ] || { echo "no $cli: cargo build --release, or set FLEET_CLI" >&2; exit 1; }

socket=$(mktemp -d)/tmux
tmux() { command tmux -S "$socket" -f /dev/null "$@"; }
trap 'tmux kill-server 2>/dev/null || true; rm -rf "$(dirname "$socket")"' EXIT
tmux new-session -d -x 100 -y 30 "env TERM=screen-256color '$cli' demo"
tmux set-option -g status off
tmux resize-window -x 100 -y 30

simulated() { # whole seconds in the picture's title; nothing before there is a picture
  tmux capture-pane -p 2>/dev/null | sed -nE 's/.* ([0-9]+)\.[0-9] s simulated.*/\1/p' | head -n 1
}
for _ in $(seq 600); do
  now=$(simulated || true)
  if [ -n "$now" ] && [ "$now" -ge "$at_s" ]; then
    tmux capture-pane -e -p | python3 docs/capture/ansi2svg.py 100 30 >"$out.new"
    mv "$out.new" "$out"
    echo "$out: the demo at $now simulated seconds"
    exit 0
  fi
  sleep 0.1
done
echo "no picture of the demo at $at_s s within a minute" >&2
exit 1
