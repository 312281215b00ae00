// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>

#include "rig/rig.h"

namespace lf {

// Whether a camera's `source` describes elements ("libcamerasrc camera-name=a ! video/x-raw,width=640") instead of
// naming a URI or a file: it has a "!" between spaces, or begins with "NAME PROPERTY=".
bool is_bin_description(const std::string& source);

// The same, unless a file of that name exists: a file may be called "take ! two.mkv".
bool describes_elements(const Rig& rig, const std::string& source);

// The first part of a camera's `source` that may do more than give pictures, as text for a message ("filesink");
// nothing for a file, for a URI of a short list of schemes (http, rtsp, v4l2, ...), and for a description of elements
// on a short list of sources and converters. A rig with such a part is opened only if its user trusts it: elements can
// write files and run programs.
std::optional<std::string> untrusted_part(const std::string& source);

// Whether an element is on that list, by the name of its factory.
bool is_trusted_element(const std::string& name);

// Throws Error unless the camera's source may be opened. `path` is the file that the rig was read from ("":
// none); a program that opens a copy checks the original.
// - A source that describes elements needs a rig file that only this user and root can write.
// - A source that may do more than give pictures (see untrusted_part()) needs `trusted`: the user has said that this
//   rig may run any element.
void require_trust(const Camera& camera, const std::string& path, bool trusted);
// The same for all cameras of a rig; the error names the camera.
void require_trust(const Rig& rig, const std::string& path, bool trusted);

// A camera's `source`, or any text that may contain one, without the secrets in it: user names and passwords of URIs
// ("rtsp://user:password@host/" becomes "rtsp://host/"), and the values of properties such as `user-pw`, `password` and
// `passphrase`, the parameters of URIs but for a few such as `channel` and `size`, and the paths of RTMP, which name
// the stream's key (all become "***"). Everything that is shown, logged or sent goes through this function. What looks
// like a secret is hidden, too: the text is for people and cannot be opened any more.
std::string location_text(const std::string& text);

}  // namespace lf
