// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/lens_json.h"

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace lf {

Lens parse_lens(const JsonValue& object) {
  const JsonValue model_value = object.at("model");
  const std::string name = model_value.text();
  const std::optional<LensModel> model = lens_model_from_name(name);
  if (!model) {
    std::string known;
    for (unsigned code = 0; const auto each = lens_model_from_code(code); code++)
      known += (code ? ", " : "") + std::string(lens_model_name(*each));
    model_value.fail("unknown lens model \"" + name + "\"; known are " + known);
  }
  const JsonValue params_value = object.at("params");
  const std::vector<JsonValue> values = params_value.elements();
  if (values.size() != static_cast<size_t>(lens_model_num_params(*model)))
    params_value.fail(name + " takes " + std::to_string(lens_model_num_params(*model)) + " numbers, has " +
                      std::to_string(values.size()));
  std::array<double, Lens::kMaxParams> params{};
  for (size_t i = 0; i < values.size(); i++) params[i] = values[i].number();
  try {
    return Lens(*model, params);
  } catch (const Error& e) {
    object.fail_inside(e.what());
  }
}

void put_lens(const Lens& lens, nlohmann::ordered_json& object) {
  object["model"] = lens_model_name(lens.model());
  object["params"] = std::vector<double>(lens.params().begin(), lens.params().begin() + lens.num_params());
}

}  // namespace lf
