// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/lens_json.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "support/expect_error.h"

namespace lf {
namespace {

Lens parse(const std::string& text) {
  const std::string name = "f.json";
  const nlohmann::json root = parse_json(text, name);
  return parse_lens(JsonValue(root, name).at("camera"));
}

TEST(LensJson, RoundTripsEveryModelToTheLastBit) {
  for (const LensModel model : {LensModel::kSimplePinhole, LensModel::kPinhole, LensModel::kSimpleRadial,
                                LensModel::kRadial, LensModel::kOpenCv}) {
    std::array<double, Lens::kMaxParams> params{};
    for (int i = 0; i < lens_model_num_params(model); i++) params[i] = 1 / (3.0 + i);
    const Lens lens(model, params);
    nlohmann::ordered_json object;
    put_lens(lens, object);
    EXPECT_EQ(parse("{\"camera\": " + object.dump() + "}"), lens);
  }
}

TEST(LensJson, ErrorsNameThePlace) {
  struct {
    const char* camera;
    const char* message;
  } const cases[] = {
      {R"({"params": [1, 0, 0]})", "f.json: camera: key \"model\" is missing"},
      {R"({"model": "RADIAL"})", "f.json: camera: key \"params\" is missing"},
      {R"({"model": 3, "params": []})", "f.json: camera.model: must be a string"},
      {R"({"model": "THIN_PRISM", "params": []})",
       "f.json: camera.model: unknown lens model \"THIN_PRISM\"; known are SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, "
       "RADIAL, OPENCV"},
      {R"({"model": "RADIAL", "params": [1, 0, 0, 0]})", "f.json: camera.params: RADIAL takes 5 numbers, has 4"},
      {R"({"model": "PINHOLE", "params": 7})", "f.json: camera.params: must be an array"},
      {R"({"model": "PINHOLE", "params": [1, 1, "NaN", 0]})", "f.json: camera.params[2]: must be a finite number"},
      {R"({"model": "PINHOLE", "params": [1, 0, 0, 0]})",
       "f.json: camera.params[1]: the focal length must be positive"},
  };
  for (const auto& c : cases) EXPECT_ERROR(parse(std::string("{\"camera\": ") + c.camera + "}"), c.message);
}

}  // namespace
}  // namespace lf
