#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Builds the installed versions of GLib and GStreamer's core with ThreadSanitizer.
#   tests/sanitize/libraries.sh FOLDER   into FOLDER/lib, FOLDER/plugins and FOLDER/bin, unless up to date
# GLib's locks use atomics and futexes. In an uninstrumented GLib, ThreadSanitizer does not see the locks and reports
# races on all data that they guard. Suppressions would have to cover all code below GStreamer, including ours.
set -euo pipefail
mkdir -p "$1"
cd "$1"

version_of() { dpkg-query -W -f '${source:Package}=${source:Version}' "$1"; }
sources=("$(version_of libglib2.0-0)" "$(version_of libgstreamer1.0-0)")
[[ -f built && $(<built) == "${sources[*]}" ]] && exit
rm -rf built src lib plugins bin
mkdir -p src/sources/parts src/sources/lists/partial lib plugins bin

as_root=()
((EUID == 0)) || as_root=(sudo)
# dpkg-query also succeeds for known packages that are not installed, so count the installed ones.
[[ $(dpkg-query -W -f '${db:Status-Status}\n' dpkg-dev flex bison 2>/dev/null | grep -cx installed) == 3 ]] ||
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -y --no-install-recommends install dpkg-dev flex bison \
    >/dev/null

# Sources come from the same archives as the installed packages.
apt-get indextargets --format 'deb-src $(REPO_URI) $(CODENAME) main' 'Created-By: Packages' 'Origin: Debian' \
  'Component: main' | sort -u -k 3 >src/sources/parts/debian.list
cd src
apt=(apt-get -qq -o Dir::Etc::sourcelist=/dev/null -o "Dir::Etc::sourceparts=$PWD/sources/parts"
  -o "Dir::State::lists=$PWD/sources/lists" -o APT::Sandbox::User=root)
"${apt[@]}" update
"${apt[@]}" source "${sources[@]}" >sources.log 2>&1 || { cat sources.log >&2; exit 1; }
cd ..

export CC=${CC:-gcc}
export CFLAGS='-fsanitize=thread -O1 -g1 -fno-omit-frame-pointer -w' LDFLAGS=-fsanitize=thread
like_debian=(--prefix=/usr --libdir="lib/$(gcc -print-multiarch)" --sysconfdir=/etc --localstatedir=/var
  -Dbuildtype=plain -Db_lundef=false)
# Reads reference counts atomically, as GLib does.
sed -i -E 's/(\(\(GObject \*\) object\)|G_OBJECT \(\*?[a-z]+\))->ref_count/g_atomic_int_get (\&\1->ref_count)/g' \
  src/gstreamer1.0-*/gst/gstobject.c
# Disables the assembler version of bit locks, which is not instrumented.
sed -i 's/# *define USE_ASM_GOTO 1/#undef USE_ASM_GOTO/' src/glib2.0-*/glib/gbitlock.c
echo "building GLib and GStreamer with ThreadSanitizer"
meson setup src/glib src/glib2.0-*/ "${like_debian[@]}" -Dtests=false -Dman=false -Dgtk_doc=false -Dselinux=disabled \
  -Dlibmount=disabled -Dsysprof=disabled -Dnls=disabled -Dglib_debug=disabled >src/glib.log
ninja -C src/glib --quiet >>src/glib.log
meson setup src/gst src/gstreamer1.0-*/ "${like_debian[@]}" -Dauto_features=disabled -Dcheck=enabled -Dtools=enabled \
  -Dcoretracers=enabled -Dgobject-cast-checks=enabled -Dglib-asserts=enabled -Dglib-checks=enabled >src/gst.log
ninja -C src/gst --quiet >>src/gst.log

find src/glib src/gst -name 'lib*-?.0.so.0.*' -type f ! -path '*.p/*' ! -name '*.py' | while read -r library; do
  name=${library##*/}
  cp "$library" "lib/${name%.so.0.*}.so.0"
done
cp src/gst/plugins/*/libgst*.so plugins
cp src/gst/tools/gst-{launch,inspect}-1.0 bin
echo "${sources[*]}" >built
