// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <string_view>

namespace lf {

// Prepares text for a terminal, because it may quote a hostile file or camera. Replaces control characters except line
// breaks and tabs, also U+0080 to U+009F, and bytes that are not UTF-8, by "?".
std::string terminal_text(std::string_view text);

// Returns true if `text` contains a control character, also U+007F to U+009F.
bool has_control_characters(std::string_view text);

}  // namespace lf
