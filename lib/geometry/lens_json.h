// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "base/json_value.h"
#include "geometry/lens.h"

namespace lf {

// The members "model" and "params" of a camera or a view. Throws Error naming the place.
Lens parse_lens(const JsonValue& object);
void put_lens(const Lens& lens, nlohmann::ordered_json& object);

}  // namespace lf
