// SPDX-License-Identifier: LGPL-2.1-or-later
#include "quality/outliers.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "base/median.h"

namespace lf {
std::vector<size_t> unusually_low(const std::vector<double>& psnr_db) {
  std::vector<double> known;
  std::copy_if(psnr_db.begin(), psnr_db.end(), std::back_inserter(known), [](double v) { return std::isfinite(v); });
  if (known.empty()) return {};
  const double middle = median(known);
  for (double& v : known) v = std::abs(v - middle);
  constexpr double kSigmaPerMad = 1.4826;
  const double limit = middle - std::max(kLowDb, kLowDeviations * kSigmaPerMad * median(known));
  std::vector<size_t> low;
  for (size_t i = 0; i < psnr_db.size(); i++)
    if (psnr_db[i] < limit) low.push_back(i);
  return low;
}

std::vector<size_t> find_suspects(
    std::vector<double> psnr_db,
    const std::function<double(size_t camera, const std::vector<size_t>& without)>& predict) {
  std::vector<size_t> suspects, without;
  while (true) {
    std::vector<size_t> low = unusually_low(psnr_db);
    if (low.empty()) return suspects;
    const size_t worst = *std::ranges::min_element(low, {}, [&](size_t i) { return psnr_db[i]; });
    suspects.push_back(worst);
    without.insert(std::ranges::upper_bound(without, worst), worst);
    psnr_db[worst] = std::numeric_limits<double>::quiet_NaN();
    for (const size_t i : low)
      if (i != worst) psnr_db[i] = predict(i, without);
  }
}

}  // namespace lf
