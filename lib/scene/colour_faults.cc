// SPDX-License-Identifier: LGPL-2.1-or-later
#include "scene/colour_faults.h"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "image/colour_model.h"

namespace lf {
namespace {

// SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t bits() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }
  double between(double least, double most) {
    return least + (most - least) * static_cast<double>(bits() >> 11) / 9007199254740992.0;
  }
  // Near enough to a normal distribution: the sum of four even ones.
  double normal() {
    const uint64_t b = bits();
    double sum = 0;
    for (int i = 0; i < 4; i++) sum += static_cast<double>((b >> (16 * i)) & 0xffff) / 65535.0 - 0.5;
    return sum * std::sqrt(3.0);
  }

 private:
  uint64_t state_;
};

constexpr double kSceneGamma = 2;

}  // namespace

std::vector<ColourFault> random_faults(size_t cameras, uint32_t seed, const ColourFaultOptions& options) {
  Random random(seed * 0x9e3779b97f4a7c15 + 1);
  const auto around = [&random](double most) { return random.between(-most, most); };
  std::vector<ColourFault> faults(cameras);
  for (ColourFault& fault : faults) {
    fault.gain = 1 + around(options.gain);
    for (int c = 0; c < 3; c++) fault.balance[c] = 1 + around(options.balance);
    for (int c = 0; c < 3; c++) fault.black[c] = options.black + around(options.black);
    fault.gamma = kSceneGamma * (1 + around(options.gamma));
    for (size_t row = 0; row < 3; row++) {
      double others = 0;
      for (size_t column = 0; column < 3; column++)
        if (column != row) others += fault.crosstalk[3 * row + column] = random.between(0, options.crosstalk);
      fault.crosstalk[3 * row + row] = 1 - others;
    }
    const double loss = random.between(options.vignetting / 2, options.vignetting);
    fault.vignetting = {-0.8 * loss, -0.2 * loss};
    fault.noise = options.noise;
  }
  return faults;
}

Image with_fault(const Image& rgb, const ColourFault& fault, const Vec2& principal_point, uint64_t seed) {
  const VignettingField field(rgb.width(), rgb.height(), principal_point);
  const ColourModel lens{.vignetting = fault.vignetting};
  double light[256];
  for (int v = 0; v < 256; v++) light[v] = std::pow(v / 255.0, kSceneGamma);
  Random random(seed);
  Image out(PixelFamily::kRgb, rgb.width(), rgb.height());
  for (int y = 0; y < rgb.height(); y++)
    for (int x = 0; x < rgb.width(); x++) {
      const uint8_t* const in = rgb.pixel(x, y);
      const double share = light_share(lens, field.square(x, y));
      for (int c = 0; c < 3; c++) {
        const double* const row = &fault.crosstalk[static_cast<size_t>(3 * c)];
        const double seen = share * (row[0] * light[in[0]] + row[1] * light[in[1]] + row[2] * light[in[2]]);
        const double level = fault.gain * fault.balance[c] * std::pow(seen, 1 / fault.gamma);
        const double value = fault.black[c] + (255 - fault.black[c]) * level + fault.noise * random.normal();
        out.pixel(x, y)[c] = static_cast<uint8_t>(std::clamp(value + 0.5, 0.0, 255.0));
      }
    }
  return out;
}

std::string faults_to_json(const Rig& rig, const std::vector<ColourFault>& faults) {
  nlohmann::ordered_json cameras = nlohmann::ordered_json::array();
  for (size_t i = 0; i < faults.size(); i++) {
    const ColourFault& f = faults[i];
    cameras.push_back({{"id", rig.cameras[i].id},
                       {"gain", f.gain},
                       {"balance", {f.balance.x, f.balance.y, f.balance.z}},
                       {"black", {f.black.x, f.black.y, f.black.z}},
                       {"gamma", f.gamma},
                       {"crosstalk", f.crosstalk},
                       {"vignetting", f.vignetting},
                       {"noise", f.noise}});
  }
  const nlohmann::ordered_json file = {
      {"format", "lightfield-colour-faults"}, {"version", 1}, {"cameras", std::move(cameras)}};
  return file.dump(1) + "\n";
}

}  // namespace lf
