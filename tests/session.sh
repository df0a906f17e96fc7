#!/bin/bash
# A sculpting session with real mouse and key events on a virtual display, a screenshot at each step.
#
#   tests/session.sh [VOLUME] [OUT]
#
# Needs Xvfb, xdotool and ImageMagick's import (Debian: xvfb xdotool imagemagick). VOLUME is any file that Voxclay opens
# (default: the built-in head). Uses target/release/voxclay, or $VOXCLAY. The pictures are to be looked at; what can be
# checked is checked: the project and the export exist and agree with the command line, and work that was not saved is
# offered again after the process is killed.
set -euo pipefail
cd "$(dirname "$0")/.."
volume=${1:-phantom:head:192}
out=${2:-out/session}
voxclay=${VOXCLAY:-target/release/voxclay}
rm -rf "$out"
mkdir -p "$out"
out=$(realpath "$out")
export VOXCLAY_HOME=$out/home
display=:$((90 + RANDOM % 100))
Xvfb $display -screen 0 1360x860x24 >/dev/null 2>&1 &
xvfb=$!
export DISPLAY=$display
trap 'kill $app $xvfb 2>/dev/null || true' EXIT
sleep 1

n=0
shot() { # name: waits for the picture to settle, then takes it
    sleep "${2:-2.5}"
    n=$((n + 1))
    import -window root "$out/$(printf %02d $n)-$1.png"
    echo "$(printf %02d $n) $1"
}
start() {
    "$voxclay" app "$@" 2>>"$out/stderr.txt" &
    app=$!
    for _ in $(seq 100); do
        window=$(xdotool search --onlyvisible --name Voxclay 2>/dev/null | head -1) && [ -n "$window" ] && break
        sleep 0.1
    done
    xdotool windowsize --sync "$window" 1360 860 2>/dev/null || true
    xdotool windowmove "$window" 0 0
    xdotool windowfocus "$window" 2>/dev/null || true
}
drag() { # x y dx dy [button]: as a hand does, in steps
    xdotool mousemove "$1" "$2"
    sleep 0.15
    xdotool mousedown "${5:-1}"
    for i in $(seq 12); do
        xdotool mousemove $(($1 + $3 * i / 12)) $(($2 + $4 * i / 12))
        sleep 0.04
    done
    [ "${held:-}" ] && shot "$held" 0.4
    xdotool mouseup "${5:-1}"
    sleep 0.3
}
key() { xdotool key --clearmodifiers "$@"; sleep 0.4; }
click() { xdotool mousemove "$1" "$2"; sleep 0.15; xdotool click "${3:-1}"; sleep 0.4; }
text() { xdotool type --delay 12 "$1"; sleep 0.3; }

start "$volume"
shot opened 6
# the shape in the texture cube: the hull, moved a little along an arrow, and back
click 1058 52; shot object-panel 0.6
key Tab; shot texture-cube
key Tab
# pull the jaw, then twist
key g
held=pulling drag 500 590 -70 45
shot jaw-pulled
key t
drag 560 300 90 0
shot twisted
key ctrl+z; key ctrl+z
shot undone-twice
key ctrl+shift+z
shot redone
# the transfer function
click 1180 52; shot look-panel 0.6
drag 1180 668 20 -30
shot transfer-edited
# modes, and one against another
key 2; shot exact 3
key 3; shot tets 5
key 1
key a; shot wipe 4
held= drag 540 460 -160 0
shot wipe-moved
key a
key m; shot slices 3
key m
key w; shot tessellation
key w
key F12; shot times 1
key F12
# save, export
key ctrl+s; sleep 0.6
key ctrl+a; text "$out/session.voxclay"; key Return
shot saved 4
key ctrl+e; shot export-panel 0.6
click 1080 310; shot exported 4
# one more stroke that is not saved, then the process is killed
key g
drag 500 400 50 -30
shot unsaved 5
kill -9 $app
sleep 0.5
start "$out/session.voxclay"
shot recovery 6
click 560 430; shot recovered 6
for file in "$out"/home/recovery/*.json; do [ -s "$file" ] || { echo "nothing was put aside"; exit 1; }; done
[ -s "$out/session.voxclay" ] || { echo "the project was not saved"; exit 1; }
"$voxclay" export "$out/session.voxclay" -o "$out/session.nrrd"
cmp "$out/session.nrrd" "$out/session-sculpted.nrrd"
echo "the window's export and the command line's are the same"
echo "pictures in $out"
