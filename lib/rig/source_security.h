// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>

#include "rig/rig.h"

namespace lf {

// True if a camera's `source` describes GStreamer elements instead of a URI or a file, for example "libcamerasrc
// camera-name=a ! video/x-raw,width=640". Such a text contains " ! " or starts with "NAME PROPERTY=".
bool is_launch_description(const std::string& source);

// True if is_launch_description() and no file has that name. (A file may be called "take ! two.mkv".)
bool is_launch_line(const Rig& rig, const std::string& source);

// Returns the first part of a camera's `source` that could do more than deliver images, as text for a message
// ("filesink"), because elements can write files and run programs. Returns nullopt for a file, a URI with an allowed
// scheme (http, rtsp, v4l2, ...), or a description with only allowed sources and converters. A rig with any other
// source only opens if the user trusts the rig.
std::optional<std::string> untrusted_component(const std::string& source);

bool is_trusted_element(const std::string& name);

// Throws Error unless the camera's source may be opened. `path` is the rig file ("": none). A program that opens a copy
// must pass the path of the original.
// - A source that describes elements requires a rig file that only this user and root can write.
// - A source that could do more than deliver images (see untrusted_component()) requires `trusted`, the user's
//   permission for this rig to run any element.
void require_trust(const Camera& camera, const std::string& path, bool trusted);
void require_trust(const Rig& rig, const std::string& path, bool trusted);

// Removes secrets from a camera's `source`, or from a text that may contain a source. Pass all text through this
// function before displaying, logging or sending it.
// - User names and passwords of URIs are dropped: "rtsp://user:password@host/" becomes "rtsp://host/".
// - Values of properties such as `user-pw`, `password` and `passphrase` become "***".
// - URI parameters become "***", except for a few such as `channel` and `size`.
// - RTMP paths become "***", because they contain the stream key.
// Anything else that looks like a secret is hidden as well. The result is for display and cannot be opened.
std::string redacted_location(const std::string& text);

// True if a source of the camera contains text that redacted_location() hides.
bool has_secret(const Camera& camera);

// Returns a warning if the rig has a secret and other users can read or change its file `path`; otherwise "".
// "cameras[2]: its source contains a password or key, and other users can read or change this file (mode 644): run
// chmod 600 rig.json"
std::string secret_warning(const Rig& rig, const std::string& path);

}  // namespace lf
