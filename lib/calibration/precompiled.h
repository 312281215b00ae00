// SPDX-License-Identifier: LGPL-2.1-or-later
// Headers of other projects that most files of the calibration include: see lib/base/precompiled.h.
#ifndef LF_CALIBRATION_PRECOMPILED_H
#define LF_CALIBRATION_PRECOMPILED_H

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "base/precompiled.h"

#endif
