// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

namespace lf {

// Everything geometric is double precision; floats appear only in weights and pixels (see render/).
using Vec2 = glm::dvec2;
using Vec3 = glm::dvec3;
using Mat3 = glm::dmat3;  // column-major: m[column][row]
using Quat = glm::dquat;  // constructor order w, x, y, z

// A rotation's quaternion in files and on the wire has a norm that is so near to 1.
inline constexpr double kUnitTolerance = 1e-6;

inline bool is_finite(double v) { return std::isfinite(v); }
inline bool is_finite(const Vec3& v) { return is_finite(v.x) && is_finite(v.y) && is_finite(v.z); }
inline bool is_finite(const Quat& q) { return is_finite(q.w) && is_finite(q.x) && is_finite(q.y) && is_finite(q.z); }

}  // namespace lf
