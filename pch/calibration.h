// SPDX-License-Identifier: LGPL-2.1-or-later
// What most files of lib/calibration include, compiled once for all of them. Each file still includes what it uses.
#ifndef LF_PCH_CALIBRATION_H
#define LF_PCH_CALIBRATION_H

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <ceres/ceres.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "base/vec.h"

#endif  // LF_PCH_CALIBRATION_H
