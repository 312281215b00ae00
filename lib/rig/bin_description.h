// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>

namespace lf {

struct Rig;

// Whether a camera's `source` describes elements ("libcamerasrc camera-name=a ! video/x-raw,width=640") instead of
// naming a URI or a file: it has a "!" between spaces, or begins with "NAME PROPERTY=".
bool is_bin_description(const std::string& source);

// The same, unless a file of that name exists: a file may be called "take ! two.mkv".
bool describes_elements(const Rig& rig, const std::string& source);

// The first part of a camera's `source` that may do more than give pictures, as text for a message ("filesink");
// nothing for a file, for a URI of a short list of schemes (http, rtsp, v4l2, ...), and for a description of elements on a short list of sources and
// converters. A rig with such a part is opened only if its user trusts it: elements can write files and run programs.
std::optional<std::string> untrusted_part(const std::string& source);

// Whether an element is on that list, by the name of its factory.
bool is_trusted_element(const std::string& name);

}  // namespace lf
