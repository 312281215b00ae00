#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Tests an installation: installs BUILD into a new prefix, then builds and runs examples/ and the programs of
# docs/guides/embedding.md with pkg-config alone. Prints TAP.
# usage: tests/examples.sh BUILD
set -uo pipefail
build=${1:?the build folder}
source=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

number=0
report() { # STATUS NAME LOG
  number=$((number + 1))
  if (($1 == 0)); then
    echo "ok $number - $2"
  else
    sed 's/^/# /' "$3"
    echo "not ok $number - $2"
  fi
}
skip() {
  number=$((number + 1))
  echo "ok $number - $1 # SKIP $2"
}

if nm -D --undefined-only "$build/gst/libgstlightfield.so" | grep -q -e __asan_ -e __tsan_ -e __ubsan_; then
  echo "1..0 # SKIP a build with sanitizers is not for other programs"
  exit
fi
echo 1..26
DESTDIR=$work/root meson install -C "$build" --no-rebuild >"$work/log" 2>&1
report $? "meson install" "$work/log"

pc=$(find "$work/root" -name lightfield.pc)
plugin=$(find "$work/root" -name libgstlightfield.so)
export PKG_CONFIG_PATH=${pc%/*}
sed -i "s|^prefix=|prefix=$work/root|" "${pc%/*}"/*.pc  # the installed prefix lacks DESTDIR
bin=$(dirname "$(find "$work/root" -path '*/bin/lf-scene')")

# Other exported symbols could be mistaken for the library that an application links.
nm -D --defined-only "$plugin" | grep -v ' gst_plugin_lightfield_\(get_desc\|register\)$' >"$work/log"
if [[ -s $work/log ]]; then status=1; else status=0; fi
report $status "the plugin shows two symbols" "$work/log"
ldd "$plugin" 2>&1 | grep -i -e opencv -e ceres >"$work/log"
if [[ -s $work/log ]]; then status=1; else status=0; fi
report $status "the plugin loads no OpenCV" "$work/log"

library=$(find "$work/root" -name liblightfield.so)
calibration=$(find "$work/root" -name liblightfield-calibration.so)
include=$(dirname "$(find "$work/root" -path '*/lightfield/lightfield.h')")
export LD_LIBRARY_PATH=${library%/*}
nm -DC --defined-only "$library" "$calibration" | sed -n 's/^[0-9a-f]* [A-Z] //p' >"$work/symbols"
grep -v '^\(\(typeinfo\|typeinfo name\|vtable\) for \)\?lightfield::' "$work/symbols" >"$work/log"
if [[ -s $work/log || $(wc -l <"$work/symbols") -lt 40 ]]; then status=1; else status=0; fi
report $status "the libraries show the public API alone" "$work/log"
grep -e ::State -e ::Data "$work/symbols" >"$work/log"
if [[ -s $work/log ]]; then status=1; else status=0; fi
report $status "and nothing of the insides of its classes" "$work/log"
ldd "$library" 2>&1 | grep -i -e opencv -e ceres -e gst -e glib -e yaml >"$work/log"
if [[ -s $work/log ]]; then status=1; else status=0; fi
report $status "liblightfield needs no OpenCV, Ceres or GStreamer" "$work/log"
{ find "$work/root" -name '*.a' ! -name libgstlightfield.a ! -name liblightfield.a; find "$work/root" -name '*.h' ! -path "$include/*"; } >"$work/log"
if [[ -s $work/log || $(find "$include" -name '*.h' | wc -l) -ne 9 ]]; then status=1; else status=0; fi
report $status "nothing else of the library is installed" "$work/log"
status=0
for header in "$include"/*.h; do
  echo "#include <lightfield/${header##*/}>" |
    ${CXX:-g++} -std=c++17 -Wall -Wextra -pedantic -Werror -fsyntax-only -I"${include%/*}" -x c++ - >"$work/log" 2>&1 || {
    status=1
    break
  }
done
report $status "each header stands by itself, in C++17, too" "$work/log"

opencv=()
compile() { # NAME SOURCE PACKAGE...
  local flags
  if ! flags=$(pkg-config --cflags --libs "${@:3}" 2>"$work/log"); then return 1; fi
  # shellcheck disable=SC2086  # flags are words
  ${CXX:-g++} -std=c++20 -O1 -Wall -Wextra -pedantic -Werror "${opencv[@]:0:2}" "$2" $flags "${opencv[@]:2}" \
    -o "$work/$1" >"$work/log" 2>&1
}

"$bin/lf-scene" --out "$work/scene" --grid 3x3 --width 64 --height 48 --frames 8 --samples 1 >"$work/log" 2>&1
report $? "lf-scene makes a film" "$work/log"
rig=$work/scene/rig.json
export GST_PLUGIN_PATH=${plugin%/*} GST_REGISTRY=$work/registry.bin G_DEBUG=fatal-criticals

compile view "$source/examples/view.cc" gstreamer-app-1.0 && timeout 60 "$work/view" "$rig" 20 >"$work/log" 2>&1
report $? "examples/view.cc" "$work/log"
"$work/view" "$work/none.json" >"$work/log" 2>&1
if (($? == 1)) && grep -q 'none.json' "$work/log"; then status=0; else status=1; fi
report $status "examples/view.cc says what is wrong" "$work/log"
compile own_frames "$source/examples/own_frames.cc" gstreamer-app-1.0 && timeout 60 "$work/own_frames" >"$work/log" 2>&1
report $? "examples/own_frames.cc" "$work/log"
compile own_transport "$source/examples/own_transport.cc" lightfield && timeout 60 "$work/own_transport" >"$work/log" 2>&1
report $? "examples/own_transport.cc" "$work/log"
# The header comment of render.cc contains the commands that create the images.
sed -n '\|^//   for still in|,\|^//   done|s|^//||p' "$source/examples/render.cc" >"$work/make_images"
(cd "$work" && bash -e make_images) >"$work/log" 2>&1
compile render "$source/examples/render.cc" lightfield && timeout 60 "$work/render" "$rig" "$work/out.ppm" >"$work/log" 2>&1 &&
  [[ $(wc -c <"$work/out.ppm") == $((3 * 640 * 480 + 15)) ]]
report $? "examples/render.cc" "$work/log"
# shellcheck disable=SC2046  # flags are words
${CXX:-g++} -std=c++20 "$source/examples/render.cc" $(pkg-config --cflags --libs --static lightfield |
  sed 's/-llightfield/-l:liblightfield.a/') -o "$work/static" >"$work/log" 2>&1 && ! ldd "$work/static" | grep lightfield &&
  "$work/static" "$rig" "$work/static.ppm" >"$work/log" 2>&1 && cmp "$work/static.ppm" "$work/out.ppm"
report $? "examples/render.cc with the static library" "$work/log"
compile calibrate "$source/examples/calibrate.cc" lightfield-calibration && timeout 60 "$work/calibrate" >"$work/log" 2>&1
report $? "examples/calibrate.cc" "$work/log"

module=$(find "$work/root" -name 'lightfield.cpython*')
python=/usr/bin/python3
export PYTHONPATH=${module%/*}
if [[ $module ]]; then
  (cd "$work" && timeout 60 $python "$source/examples/render.py" "$rig" python.ppm && cmp out.ppm python.ppm) \
    >"$work/log" 2>&1
  report $? "examples/render.py makes the same bits as render.cc" "$work/log"
  timeout 120 $python "$source/tests/api/python_test.py" "$work/calibrate" >"$work/log" 2>&1
  report $? "tests/api/python_test.py" "$work/log"
  awk '/^```py$/ {on = 1; next} /^```/ {on = 0} on' "$source/docs/guides/embedding.md" >"$work/guide.py"
  (cd "$work/scene" && timeout 60 $python "$work/guide.py") >"$work/log" 2>&1
  report $? "docs/guides/embedding.md, program in Python" "$work/log"
else
  skip "examples/render.py" "pybind11-dev is not installed"
  skip "docs/guides/embedding.md, program in Python" "pybind11-dev is not installed"
  skip "tests/api/python_test.py" "pybind11-dev is not installed"
fi
if command -v cmake >/dev/null; then
  mkdir "$work/cmake" && printf '%s\n' 'cmake_minimum_required(VERSION 3.16)' 'project(render CXX)' 'set(CMAKE_CXX_STANDARD 20)' \
    'find_package(lightfield 0.1 REQUIRED COMPONENTS calibration)' "add_executable(render $source/examples/render.cc)" \
    "add_executable(calibrate $source/examples/calibrate.cc)" 'target_link_libraries(render lightfield::lightfield)' \
    'target_link_libraries(calibrate lightfield::calibration)' >"$work/cmake/CMakeLists.txt"
  (cd "$work/cmake" && cmake -DCMAKE_PREFIX_PATH="${library%/*}/cmake" . && make && ./render "$rig" cmake.ppm &&
    cmp cmake.ppm ../out.ppm) >"$work/log" 2>&1
  report $? "CMake finds the libraries" "$work/log"
else
  skip "CMake finds the libraries" "cmake is not installed"
fi

awk -v to="$work/guide" '/^```cpp/ {on = ++n; next} /^```/ {on = 0} on {print > (to n ".cc")}' "$source/docs/guides/embedding.md"
for n in 1 2; do
  compile "guide$n" "$work/guide$n.cc" lightfield && timeout 60 "$work/guide$n" "$rig" >"$work/log" 2>&1
  report $? "docs/guides/embedding.md, program $n" "$work/log"
done
(
  opencv=(-isystem /usr/include/opencv4 -lopencv_core -lopencv_imgproc -lopencv_imgcodecs)
  compile rgbd "$source/examples/rgbd.cc" gstreamer-app-1.0 gstreamer-video-1.0
) && (cd "$work" && timeout 60 ./rgbd "$rig" 5 && rm rgbd.png) >"$work/log" 2>&1
report $? "examples/rgbd.cc" "$work/log"
if "$python" -c 'import cv2' 2>/dev/null; then
  (cd "$work" && timeout 60 "$python" "$source/examples/rgbd.py" "$rig" 5 && rm rgbd.png) >"$work/log" 2>&1
  report $? "examples/rgbd.py" "$work/log"
else
  skip "examples/rgbd.py" "python3-opencv is not installed"
fi
if "$python" -c 'import gi; gi.require_version("GstApp", "1.0"); from gi.repository import GstApp' 2>/dev/null; then
  timeout 60 "$python" "$source/examples/view.py" "$rig" 20 >"$work/log" 2>&1
  report $? "examples/view.py" "$work/log"
else
  skip "examples/view.py" "python3-gi and gir1.2-gst-plugins-base-1.0 are not installed"
fi
compile static_plugin "$source/tests/examples/static_plugin.cc" gstlightfield &&
  GST_PLUGIN_PATH='' GST_REGISTRY=$work/other.bin timeout 60 "$work/static_plugin" >"$work/log" 2>&1
report $? "the plugin as a static library" "$work/log"
