// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/lens.h"

#include <limits>

#include <nlohmann/json.hpp>

#include "base/text.h"

namespace lf {

namespace {

struct ModelInfo {
  std::string_view name;
  int num_params;
  int num_focal;
};

constexpr ModelInfo kModels[] = {
    {"SIMPLE_PINHOLE", 3, 1}, {"PINHOLE", 4, 2}, {"SIMPLE_RADIAL", 4, 1}, {"RADIAL", 5, 1}, {"OPENCV", 8, 2}};

const ModelInfo& info(LensModel model) { return kModels[static_cast<int>(model)]; }

// Returns the smallest positive root of d/dr [r (1 + k1 r^2 + k2 r^4)] = 1 + 3 k1 q + 5 k2 q^2, with q = r^2.
double first_fold_radius(double k1, double k2) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  const double a = 5 * k2, b = 3 * k1;
  if (a == 0) return b < 0 ? std::sqrt(-1 / b) : kNever;
  const double discriminant = b * b - 4 * a;
  if (discriminant < 0) return kNever;
  // 2 / (-b + sqrt(D)) is the numerically stable form of the smaller positive root.
  const double denominator = -b + std::sqrt(discriminant);
  if (denominator > 0) return std::sqrt(2 / denominator);
  // For k2 < 0, rays always fold back at some radius. If it is very large, rounding has cancelled the denominator.
  return a < 0 ? std::sqrt((b + std::sqrt(discriminant)) / (-2 * a)) : kNever;
}

}  // namespace

std::string_view lens_model_name(LensModel model) { return info(model).name; }
int lens_model_num_params(LensModel model) { return info(model).num_params; }
int lens_model_num_focal(LensModel model) { return info(model).num_focal; }

std::optional<LensModel> lens_model_from_code(unsigned code) {
  if (code >= std::size(kModels)) return std::nullopt;
  return static_cast<LensModel>(code);
}

std::optional<LensModel> lens_model_from_name(std::string_view name) {
  for (unsigned i = 0; i < std::size(kModels); i++)
    if (kModels[i].name == name) return static_cast<LensModel>(i);
  return std::nullopt;
}

Lens::Lens(LensModel model, const std::array<double, kMaxParams>& params) : model_(model) {
  const int n = num_params();
  for (int i = 0; i < n; i++) {
    params_[i] = params[i];
    if (!is_finite(params_[i])) throw Error("params[" + std::to_string(i) + "]: must be a finite number");
  }
  const int num_focal = info(model).num_focal;
  for (int i = 0; i < num_focal; i++)
    if (params_[i] <= 0) throw Error("params[" + std::to_string(i) + "]: the focal length must be positive");
  fx_ = params_[0];
  fy_ = params_[num_focal - 1];
  cx_ = params_[num_focal];
  cy_ = params_[num_focal + 1];
  const int first_distortion = num_focal + 2;
  if (n > first_distortion) k1_ = params_[first_distortion];
  if (n > first_distortion + 1) k2_ = params_[first_distortion + 1];
  if (model == LensModel::kOpenCv) {
    p1_ = params_[6];
    p2_ = params_[7];
  }
  max_radius_ = first_fold_radius(k1_, k2_);
}

Lens Lens::pinhole(double f, double cx, double cy) { return Lens(LensModel::kSimplePinhole, {f, cx, cy}); }

Lens Lens::from_fov_y(double fov_y_deg, int width, int height) {
  if (!(fov_y_deg > 0 && fov_y_deg < 180)) throw Error("fov_y: must be between 0 and 180 degrees");
  const double f = (height / 2.0) / std::tan(fov_y_deg * (M_PI / 180) / 2);
  return pinhole(f, (width - 1) / 2.0, (height - 1) / 2.0);
}

int Lens::num_params() const { return info(model_).num_params; }

Lens Lens::shifted(const Vec2& pixels) const {
  std::array<double, kMaxParams> params = params_;
  const auto centre = static_cast<size_t>(lens_model_num_focal(model_));
  for (int i = 0; i < 2; i++) params[centre + static_cast<size_t>(i)] += pixels[i];
  return {model_, params};
}

std::optional<Vec2> Lens::distort(const Vec2& u) const {
  if (!has_distortion()) return u;
  const double r2 = glm::dot(u, u);
  if (r2 > max_radius_ * max_radius_) return std::nullopt;
  const double radial = 1 + r2 * (k1_ + r2 * k2_);
  return Vec2(u.x * radial + 2 * p1_ * u.x * u.y + p2_ * (r2 + 2 * u.x * u.x),
              u.y * radial + p1_ * (r2 + 2 * u.y * u.y) + 2 * p2_ * u.x * u.y);
}

namespace {

// Detects that an iteration has returned to an earlier state (Brent 1980).
template <typename State>
class CycleFinder {
 public:
  // Returns how many of the remaining `left` steps are needed to reach the same final state.
  int left_of(int left, const State& state) {
    if (found_) return left;
    since_++;
    if (state == saved_) {
      found_ = true;
      return left % since_;
    }
    if (since_ == power_) {
      saved_ = state;
      power_ *= 2;
      since_ = 0;
    }
    return left;
  }

 private:
  State saved_{};
  int since_ = 0, power_ = 1;
  bool found_ = false;
};

struct Bracket {
  double r, low, high;
  bool operator==(const Bracket&) const = default;
};

}  // namespace

std::optional<Vec2> Lens::undistort(const Vec2& distorted, int* steps) const {
  if (!has_distortion()) return distorted;
  const double target = glm::length(distorted);
  const auto radial = [&](double r) { return r * (1 + r * r * (k1_ + r * r * k2_)); };
  const bool has_tangential = p1_ != 0 || p2_ != 0;
  // Tangential distortion adds at most 3 |p| r^2. The slack is far above rounding and the tolerance of the result.
  const double reach =
      radial(max_radius_) + (has_tangential ? 3 * std::hypot(p1_, p2_) * max_radius_ * max_radius_ : 0);
  if (std::isfinite(max_radius_) && target > reach + 1e-9 * (1 + target + reach)) return std::nullopt;

  // Solve the radial part first. r (1 + k1 r^2 + k2 r^4) increases on [0, max_radius], so bracketed Newton always
  // converges.
  double low = 0, high = max_radius_;
  if (std::isinf(high))
    for (high = 1 + target; radial(high) < target && std::isfinite(high); high *= 2) {
    }
  if (!has_tangential && !(radial(high) >= target)) return std::nullopt;
  double r = std::min(target, high);
  CycleFinder<Bracket> brackets;
  for (int left = kMaxRadialSteps; left > 0;) {
    if (steps) ++*steps;
    const double value = radial(r) - target;
    (value > 0 ? high : low) = r;
    const double slope = 1 + r * r * (3 * k1_ + 5 * k2_ * r * r);
    double next = r - value / slope;
    if (!(next >= low && next <= high)) next = (low + high) / 2;
    if (std::abs(next - r) <= 1e-16 * (1 + r)) break;
    r = next;
    left = brackets.left_of(left - 1, {r, low, high});
  }
  Vec2 u = target > 0 ? distorted * (r / target) : Vec2(0, 0);
  if (!has_tangential) return u;

  // Then solve the whole system by Newton's method with the analytic Jacobian of distort(). It converges within a few
  // steps wherever the lens has an inverse.
  CycleFinder<Vec2> cycle;
  for (int left = kMaxNewtonSteps; left > 0;) {
    if (steps) ++*steps;
    const double r2 = glm::dot(u, u), g = 1 + r2 * (k1_ + r2 * k2_), dg = 2 * k1_ + 4 * k2_ * r2;
    const Vec2 f(u.x * g + 2 * p1_ * u.x * u.y + p2_ * (r2 + 2 * u.x * u.x) - distorted.x,
                 u.y * g + p1_ * (r2 + 2 * u.y * u.y) + 2 * p2_ * u.x * u.y - distorted.y);
    const double xx = g + u.x * u.x * dg + 2 * p1_ * u.y + 6 * p2_ * u.x;
    const double xy = u.x * u.y * dg + 2 * p1_ * u.x + 2 * p2_ * u.y;
    const double yy = g + u.y * u.y * dg + 6 * p1_ * u.y + 2 * p2_ * u.x;
    const double det = xx * yy - xy * xy;
    if (det == 0) return std::nullopt;
    const Vec2 step((yy * f.x - xy * f.y) / det, (xx * f.y - xy * f.x) / det);
    u -= step;
    if (glm::dot(step, step) <= 1e-32 * (1 + glm::dot(u, u))) break;
    left = cycle.left_of(left - 1, u);
  }
  const std::optional<Vec2> check = distort(u);
  if (!check || !(glm::length(*check - distorted) <= 1e-12 * (1 + target))) return std::nullopt;
  return u;
}

double Lens::mean_iterations(int width, int height) const {
  if (!has_distortion()) return 0;
  constexpr int kPlaces = 8;
  int steps = 0;
  for (int j = 0; j < kPlaces; j++)
    for (int i = 0; i < kPlaces; i++) {
      const Vec2 pixel((i + 0.5) / kPlaces * width - 0.5, (j + 0.5) / kPlaces * height - 0.5);
      undistort(Vec2((pixel.x - cx_) / fx_, (pixel.y - cy_) / fy_), &steps);
    }
  return 1 + static_cast<double>(steps) / (kPlaces * kPlaces);
}

std::optional<Vec2> Lens::project(const Vec3& x) const {
  if (!(x.z > 0)) return std::nullopt;
  const std::optional<Vec2> d = distort(Vec2(x.x / x.z, x.y / x.z));
  if (!d) return std::nullopt;
  return Vec2(fx_ * d->x + cx_, fy_ * d->y + cy_);
}

std::optional<Vec2> Lens::unproject(const Vec2& pixel) const {
  return undistort(Vec2((pixel.x - cx_) / fx_, (pixel.y - cy_) / fy_));
}

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
