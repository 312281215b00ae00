// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

namespace lf {

// Which of these figures (PSNR of one camera each, dB) are unusually low: below the median by more than kLowDb and by more
// than kLowDeviations robust standard deviations (1.4826 MAD). Those that are not numbers are never.
inline constexpr double kLowDb = 3, kLowDeviations = 4;
std::vector<size_t> unusually_low(const std::vector<double>& psnr_db);

// Cameras of which something is wrong, from how well each is predicted by the others: the worst first. A bad camera spoils
// the predictions of its neighbours; so the worst is taken out and those that were unusually low are predicted again
// without it, until none is. `psnr_db`: of all cameras. `predict(camera, without)`: PSNR of a camera predicted without
// these (ascending), dB; not a number where nothing is predicted.
std::vector<size_t> find_suspects(std::vector<double> psnr_db,
                                  const std::function<double(size_t camera, const std::vector<size_t>& without)>& predict);

}  // namespace lf
