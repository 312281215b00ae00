// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

namespace lf {

// A camera's `source`, or any text that may contain one, without the secrets in it: user names and passwords of URIs
// ("rtsp://user:password@host/" becomes "rtsp://host/"), and the values of properties such as `user-pw`,
// `password` and `passphrase`, the parameters of URIs but for a few such as `channel` and `size`, and the paths of RTMP,
// which name the stream's key (all become "***"). Everything that is shown, logged or sent goes through this
// function. What looks like a secret is hidden, too: the text is for people and cannot be opened any more.
std::string location_text(const std::string& text);

}  // namespace lf
