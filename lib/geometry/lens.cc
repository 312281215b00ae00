// SPDX-License-Identifier: LGPL-2.1-or-later
#include "geometry/lens.h"

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/text.h"

namespace lf {

namespace {

struct ModelInfo {
  std::string_view name;
  int num_params;
  int num_focal;
};

constexpr ModelInfo kModels[] = {{"SIMPLE_PINHOLE", 3, 1}, {"PINHOLE", 4, 2},
                                 {"SIMPLE_RADIAL", 4, 1},  {"RADIAL", 5, 1},
                                 {"OPENCV", 8, 2},         {"OPENCV_FISHEYE", 8, 2},
                                 {"FULL_OPENCV", 12, 2},   {"SIMPLE_RADIAL_FISHEYE", 4, 1},
                                 {"RADIAL_FISHEYE", 5, 1}, {"THIN_PRISM_FISHEYE", 12, 2}};

const ModelInfo& info(LensModel model) { return kModels[static_cast<int>(model)]; }

// Coefficients from the constant term on.
using Polynomial = std::vector<double>;

double value_at(const Polynomial& p, double x) {
  double sum = 0;
  for (size_t i = p.size(); i-- > 0;) sum = sum * x + p[i];
  return sum;
}

Polynomial product(const Polynomial& a, const Polynomial& b) {
  Polynomial out(a.size() + b.size() - 1);
  for (size_t i = 0; i < a.size(); i++)
    for (size_t j = 0; j < b.size(); j++) out[i + j] += a[i] * b[j];
  return out;
}

Polynomial derivative(const Polynomial& p) {
  Polynomial out;
  for (size_t i = 1; i < p.size(); i++) out.push_back(static_cast<double>(i) * p[i]);
  return out;
}

// Returns the places in (0, 1] where a polynomial changes its sign, ascending. It is monotonic between the places where
// its derivative changes its sign.
std::vector<double> sign_changes(const Polynomial& p) {
  if (p.size() < 2) return {};
  std::vector<double> ends = sign_changes(derivative(p)), changes;
  ends.push_back(1);
  double begin = 0;
  for (const double end : ends) {
    const bool positive = value_at(p, begin) > 0;
    double low = begin, high = end;
    begin = end;
    if ((value_at(p, high) > 0) == positive) continue;
    for (double middle = high / 2 + low / 2; middle > low && middle < high; middle = low + (high - low) / 2)
      ((value_at(p, middle) > 0) == positive ? low : high) = middle;
    changes.push_back(high);
  }
  return changes;
}

// Returns the smallest x > 0 where a polynomial with the constant term 1 changes its sign, or infinity.
double first_sign_change(Polynomial p) {
  while (p.size() > 1 && p.back() == 0) p.pop_back();
  // Scale x so that no coefficient is above 1. Then search for x in (0, 1], and for 1/x in (0, 1].
  double scale = 0, power = 1;
  for (size_t i = 1; i < p.size(); i++) scale = std::max(scale, std::pow(std::abs(p[i]), 1 / static_cast<double>(i)));
  if (!std::isfinite(scale)) return 0;
  for (double& c : p) {
    c *= power;
    power /= scale;
  }
  if (const std::vector<double> changes = sign_changes(p); !changes.empty()) return changes.front() / scale;
  std::ranges::reverse(p);
  const std::vector<double> changes = sign_changes(p);
  return changes.empty() ? std::numeric_limits<double>::infinity() : 1 / changes.back() / scale;
}

// Returns the smallest positive root of d/dr [r (1 + k1 r^2 + k2 r^4)] = 1 + 3 k1 q + 5 k2 q^2, with q = r^2.
double first_fold(double k1, double k2) {
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

// Returns the largest length of (a, b) up to which g sqrt(q) grows. Its derivative by sqrt(q) is
// (n d + 2 q (n' d - n d')) / d^2, where n and d are the numerator and denominator of g.
double first_fold(const Distortion<double>& of) {
  if (!of.is_general) return first_fold(of.k[0], of.k[1]);
  const Polynomial n{1, of.k[0], of.k[1], of.k[2], of.k[3]}, d{1, of.d[0], of.d[1], of.d[2]};
  Polynomial slope = product(n, d);
  const Polynomial plus = product(derivative(n), d), minus = product(n, derivative(d));
  for (size_t i = 0; i < plus.size(); i++) slope[i + 1] += 2 * (plus[i] - minus[i]);
  constexpr double kBeforePole = 1 - 1e-9;
  return std::sqrt(std::min(first_sign_change(slope), kBeforePole * first_sign_change(d)));
}

// g and its derivatives by q.
struct RadialFactor {
  RadialFactor(const Distortion<double>& of, double q) {
    const auto& [k1, k2, k3, k4] = of.k;
    const auto& [d1, d2, d3] = of.d;
    value = 1 + q * (k1 + q * (k2 + q * (k3 + q * k4)));
    slope = k1 + q * (2 * k2 + q * (3 * k3 + q * 4 * k4));
    if (d1 == 0 && d2 == 0 && d3 == 0) return;
    const double d = 1 + q * (d1 + q * (d2 + q * d3));
    value /= d;
    slope = (slope - value * (d1 + q * (2 * d2 + q * 3 * d3))) / d;
  }
  double value, slope;
};

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
  read_distortion();
  has_distortion_ = distortion_.is_general || distortion_.is_tangential || k1() != 0 || k2() != 0;
  max_length_ = first_fold(distortion_);
  folds_ = std::isfinite(max_length_);
  distortion_.limit = max_length_ * max_length_;
  if (!distortion_.fisheye) return;
  constexpr double kEndOfField = kFisheyeFieldDegrees * M_PI / 180;
  folds_ = max_length_ < kEndOfField;
  if (!folds_) max_length_ = kEndOfField;
  distortion_.limit = folds_ ? std::pow(std::tan(max_length_ / 2), 2) : kFisheyeLimit;
}

void Lens::read_distortion() {
  const double* const terms = &params_[static_cast<size_t>(info(model_).num_focal) + 2];
  Distortion<double>& to = distortion_;
  switch (model_) {
    case LensModel::kSimplePinhole:
    case LensModel::kPinhole: break;
    case LensModel::kSimpleRadialFisheye: to.fisheye = true; [[fallthrough]];
    case LensModel::kSimpleRadial: to.k[0] = terms[0]; break;
    case LensModel::kRadialFisheye: to.fisheye = true; [[fallthrough]];
    case LensModel::kRadial: std::copy_n(terms, 2, to.k.begin()); break;
    case LensModel::kOpenCvFisheye:
      to.fisheye = true;
      std::copy_n(terms, 4, to.k.begin());
      break;
    case LensModel::kOpenCv:
    case LensModel::kFullOpenCv:
    case LensModel::kThinPrismFisheye:
      to.k[0] = terms[0], to.k[1] = terms[1], to.p1 = terms[2], to.p2 = terms[3];
      if (model_ == LensModel::kOpenCv) break;
      to.k[2] = terms[4];
      if (model_ == LensModel::kFullOpenCv) {
        std::copy_n(terms + 5, 3, to.d.begin());
      } else {
        to.fisheye = true;
        to.k[3] = terms[5], to.s1 = terms[6], to.s2 = terms[7];
      }
  }
  const auto any = [](const auto&... values) { return (... || (values != 0)); };
  to.is_rational = any(to.d[0], to.d[1], to.d[2]);
  to.is_tangential = any(to.p1, to.p2);
  to.is_prism = any(to.s1, to.s2);
  to.is_general = to.fisheye || to.is_rational || to.is_prism || any(to.k[2], to.k[3]);
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

Vec2 Lens::bend(const Vec2& u) const {
  const double p1 = distortion_.p1, p2 = distortion_.p2;
  const double q = glm::dot(u, u), g = RadialFactor(distortion_, q).value;
  const Vec2 out(u.x * g + 2 * p1 * u.x * u.y + p2 * (q + 2 * u.x * u.x),
                 u.y * g + p1 * (q + 2 * u.y * u.y) + 2 * p2 * u.x * u.y);
  return distortion_.is_prism ? out + q * Vec2(distortion_.s1, distortion_.s2) : out;
}

std::optional<Vec2> Lens::distort(const Vec2& u) const {
  if (!has_distortion_) return u;
  const double r2 = glm::dot(u, u);
  if (!distortion_.fisheye) return r2 <= distortion_.limit ? std::optional(bend(u)) : std::nullopt;
  const double r = std::sqrt(r2), angle = std::atan(r);
  if (!(angle <= max_length_)) return std::nullopt;
  return bend(r > 0 ? u * (angle / r) : u);
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

double Lens::solve_radial(double target, int* steps) const {
  const auto radial = [&](double r) { return r * RadialFactor(distortion_, r * r).value; };
  // The radial part increases on [0, max_length_], so bracketed Newton always converges.
  double low = 0, high = max_length_;
  if (std::isinf(high))
    for (high = 1 + target; radial(high) < target && std::isfinite(high); high *= 2) {
    }
  if (!(radial(high) >= target)) return std::numeric_limits<double>::infinity();
  double r = std::min(target, high);
  CycleFinder<Bracket> brackets;
  for (int left = kMaxRadialSteps; left > 0;) {
    if (steps) ++*steps;
    const RadialFactor g(distortion_, r * r);
    const double value = r * g.value - target;
    (value > 0 ? high : low) = r;
    double next = r - value / (g.value + 2 * r * r * g.slope);
    if (!(next >= low && next <= high)) next = (low + high) / 2;
    if (std::abs(next - r) <= 1e-16 * (1 + r)) break;
    r = next;
    left = brackets.left_of(left - 1, {r, low, high});
  }
  return r;
}

std::optional<Vec2> Lens::undistort(const Vec2& distorted, int* steps) const {
  const std::optional<Vec2> ab = unbend(distorted, steps);
  if (!ab || !distortion_.fisheye) return ab;
  // tan() of the largest length must not exceed kMaxSlope after rounding.
  static const double kEndOfFront = std::atan(kMaxSlope) - 1e-9;
  const double length = glm::length(*ab);
  if (!(length <= kEndOfFront)) return std::nullopt;
  return length > 0 ? *ab * (std::tan(length) / length) : *ab;
}

std::optional<Vec2> Lens::unbend(const Vec2& distorted, int* steps) const {
  if (!has_distortion_) return distorted;
  const double p1 = distortion_.p1, p2 = distortion_.p2, s1 = distortion_.s1, s2 = distortion_.s2;
  const double target = glm::length(distorted);
  const bool is_radial = !distortion_.is_tangential && !distortion_.is_prism;
  if (std::isfinite(max_length_)) {
    // The other terms add at most (3 |p| + |s|) q. The slack is far above rounding and the tolerance of the result.
    const double q = max_length_ * max_length_;
    const double reach = max_length_ * RadialFactor(distortion_, q).value +
                         (is_radial ? 0 : (3 * std::hypot(p1, p2) + std::hypot(s1, s2)) * q);
    if (target > reach + 1e-9 * (1 + target + reach)) return std::nullopt;
  }

  const double solution = solve_radial(target, steps), length = std::min(solution, max_length_);
  if (is_radial && !std::isfinite(solution)) return std::nullopt;
  Vec2 u = target > 0 ? distorted * (length / target) : Vec2(0, 0);
  if (is_radial) return u;

  // Then solve the whole system by Newton's method with the analytic Jacobian of bend(). It converges within a few
  // steps wherever the lens has an inverse.
  CycleFinder<Vec2> cycle;
  for (int left = kMaxNewtonSteps; left > 0;) {
    if (steps) ++*steps;
    const double q = glm::dot(u, u);
    const RadialFactor radial(distortion_, q);
    const double g = radial.value, dg = 2 * radial.slope;
    const Vec2 f = bend(u) - distorted;
    const double xx = g + u.x * u.x * dg + 2 * p1 * u.y + 6 * p2 * u.x + 2 * s1 * u.x;
    const double both = u.x * u.y * dg + 2 * p1 * u.x + 2 * p2 * u.y;
    const double xy = both + 2 * s1 * u.y, yx = both + 2 * s2 * u.x;
    const double yy = g + u.y * u.y * dg + 6 * p1 * u.y + 2 * p2 * u.x + 2 * s2 * u.y;
    const double det = xx * yy - xy * yx;
    if (det == 0) return std::nullopt;
    const Vec2 step((yy * f.x - xy * f.y) / det, (xx * f.y - yx * f.x) / det);
    u -= step;
    if (glm::dot(step, step) <= 1e-32 * (1 + glm::dot(u, u))) break;
    left = cycle.left_of(left - 1, u);
  }
  if (!(glm::length(u) <= max_length_) || !(glm::length(bend(u) - distorted) <= 1e-12 * (1 + target)))
    return std::nullopt;
  return u;
}

Lens::Steepness Lens::steepness(double distorted_radius) const {
  constexpr int kSamples = 32;
  constexpr double kMargin = 1.1;
  Steepness out;
  const double reach = std::min(solve_radial(kMargin * distorted_radius, nullptr), max_length_);
  if (!std::isfinite(reach)) return {.least = 0};
  const auto& k = distortion_.k;
  const auto& d = distortion_.d;
  const double p1 = distortion_.p1, p2 = distortion_.p2, s1 = distortion_.s1, s2 = distortion_.s2;
  const double others = 6 * (std::abs(p1) + std::abs(p2)) + 2 * (std::abs(s1) + std::abs(s2));
  for (int i = 0; i <= kSamples; i++) {
    const double a = reach * i / kSamples, q = a * a;
    // The numerator, the denominator and then g, each with three derivatives by q.
    const double n[4] = {1 + q * (k[0] + q * (k[1] + q * (k[2] + q * k[3]))),
                         k[0] + q * (2 * k[1] + q * (3 * k[2] + q * 4 * k[3])),
                         2 * k[1] + q * (6 * k[2] + q * 12 * k[3]), 6 * k[2] + q * 24 * k[3]};
    const double m[4] = {1 + q * (d[0] + q * (d[1] + q * d[2])), d[0] + q * (2 * d[1] + q * 3 * d[2]),
                         2 * d[1] + q * 6 * d[2], 6 * d[2]};
    const double g0 = n[0] / m[0], g1 = (n[1] - g0 * m[1]) / m[0], g2 = (n[2] - 2 * g1 * m[1] - g0 * m[2]) / m[0],
                 g3 = (n[3] - 3 * g2 * m[1] - 3 * g1 * m[2] - g0 * m[3]) / m[0];
    const double along = g0 + 2 * q * g1;
    const auto magnitudes = [q](const auto& terms) {
      double sum = 1, power = 1;
      for (const double term : terms) sum += std::abs(term) * (power *= q);
      return sum;
    };
    out.least = std::min(out.least, std::min(g0, along) - others * a);
    out.first = std::max(out.first, kMargin * (std::max(std::abs(g0), std::abs(along)) + others * a));
    out.second = std::max(out.second, kMargin * (6 * a * std::abs(g1) + 4 * a * q * std::abs(g2) + others));
    out.third = std::max(out.third, kMargin * (6 * std::abs(g1) + 24 * q * std::abs(g2) + 8 * q * q * std::abs(g3)));
    out.rounding = std::max(out.rounding, magnitudes(k) / std::abs(n[0]) + magnitudes(d) / std::abs(m[0]) - 1);
  }
  out.least = std::max(out.least / kMargin, 0.0);
  return out;
}

double Lens::mean_iterations(int width, int height) const {
  if (!has_distortion_) return 0;
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
  std::optional<Vec2> d;
  if (distortion_.fisheye) {
    const double beside = std::hypot(x.x, x.y), angle = std::atan2(beside, x.z);
    if (!(beside + std::abs(x.z) > 0 && angle <= max_length_)) return std::nullopt;
    d = bend(beside > 0 ? Vec2(x.x, x.y) * (angle / beside) : Vec2(0, 0));
  } else if (x.z > 0) {
    d = distort(Vec2(x.x / x.z, x.y / x.z));
  }
  if (!d) return std::nullopt;
  return Vec2(fx_ * d->x + cx_, fy_ * d->y + cy_);
}

std::optional<Vec2> Lens::unproject(const Vec2& pixel) const {
  return undistort(Vec2((pixel.x - cx_) / fx_, (pixel.y - cy_) / fy_));
}

std::optional<Vec3> Lens::direction(const Vec2& pixel) const {
  const std::optional<Vec2> ab = unbend(Vec2((pixel.x - cx_) / fx_, (pixel.y - cy_) / fy_), nullptr);
  if (!ab) return std::nullopt;
  if (!distortion_.fisheye) return glm::normalize(Vec3(*ab, 1));
  const double angle = glm::length(*ab);
  return Vec3(angle > 0 ? *ab * (std::sin(angle) / angle) : *ab, std::cos(angle));
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
