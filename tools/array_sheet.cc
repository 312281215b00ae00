// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lf_rig.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "base/text.h"
#include "composite/still.h"
#include "contact_sheet.h"
#include "depth_progress.h"
#include "focus/still_focus.h"
#include "render/contribution_map.h"
#include "render/focus_range.h"
#include "rig/camera_source.h"
#include "rig/mesh.h"
#include "rig/rig_report.h"
#include "rig/still_image_cache.h"
#include "view/navigator.h"

namespace {

constexpr int kViewWidth = 960;                     // pixels
constexpr int kPlanWidth = 480, kPlanHeight = 360;  // pixels
constexpr int kPlanBorder = 44;                     // pixels
constexpr double kArrow = 26;                       // pixels
constexpr size_t kMostLabels = 100;
const cv::Scalar kGround(36, 39, 44), kEdge(84, 90, 98), kDirection(232, 170, 72), kCamera(120, 200, 255);

enum class Side { kBehind, kAbove };

// Returns the largest of 1, 2 and 5 times a power of 10 that is at most `length`.
double round_length(double length) {
  const double power = std::pow(10, std::floor(std::log10(length)));
  return (length >= 5 * power ? 5 : length >= 2 * power ? 2 : 1) * power;
}

// Maps vectors of the world to a plan. The plan lies in the axes of the home view.
class PlanFrame {
 public:
  PlanFrame(const lf::Rig& rig, const lf::Pose& home, Side side) : home_(home), side_(side) {
    lf::Vec2 low(HUGE_VAL), high(-HUGE_VAL);
    for (const lf::Camera& camera : rig.cameras) {
      const lf::Vec2 place = flat(home_.camera_from_world(camera.pose.position));
      low = glm::min(low, place);
      high = glm::max(high, place);
    }
    middle_ = (low + high) / 2.0;
    const lf::Vec2 extent = high - low, room(kPlanWidth - 2 * kPlanBorder, kPlanHeight - 2 * kPlanBorder);
    scale_ = std::min(extent.x > 0 ? room.x / extent.x : HUGE_VAL, extent.y > 0 ? room.y / extent.y : HUGE_VAL);
    if (!std::isfinite(scale_)) scale_ = 0;  // all cameras have the same position
  }
  double scale() const { return scale_; }  // pixels per metre; 0 if the cameras have no extent
  lf::Vec2 place(const lf::Vec3& world) const {
    return (flat(home_.camera_from_world(world)) - middle_) * scale_ + lf::Vec2(kPlanWidth, kPlanHeight) / 2.0;
  }
  lf::Vec2 direction(const lf::Vec3& world) const { return flat(glm::transpose(home_.rotation()) * world); }

 private:
  lf::Vec2 flat(const lf::Vec3& local) const {
    return side_ == Side::kBehind ? lf::Vec2(local.x, local.y) : lf::Vec2(local.x, -local.z);
  }

  lf::Pose home_;
  Side side_;
  lf::Vec2 middle_{0, 0};
  double scale_ = 0;
};

void draw_line(cv::Mat& on, const lf::Vec2& from, const lf::Vec2& to, const cv::Scalar& colour) {
  cv::line(on, cv::Point2d(from.x, from.y), cv::Point2d(to.x, to.y), colour, 1, cv::LINE_AA);
}

lf::Image camera_plan(const lf::Rig& rig, const lf::Mesh& mesh, const lf::Pose& home, Side side) {
  const PlanFrame frame(rig, home, side);
  lf::Image plan(lf::PixelFamily::kRgb, kPlanWidth, kPlanHeight);
  cv::Mat out(kPlanHeight, kPlanWidth, CV_8UC3, plan.pixel(0, 0));
  out.setTo(kGround);
  std::vector<lf::Vec2> places;
  for (const lf::Camera& camera : rig.cameras) places.push_back(frame.place(camera.pose.position));
  std::set<std::pair<lf::CameraIndex, lf::CameraIndex>> edges;
  for (const lf::MeshFace& face : mesh.faces)
    for (int i = 0; i < face.corners() && face.corners() > 1; i++)
      edges.insert(std::minmax(face.camera[i], face.camera[(i + 1) % face.corners()]));
  for (const auto& [a, b] : edges) draw_line(out, places[a], places[b], kEdge);
  for (size_t i = 0; i < places.size(); i++)
    draw_line(out, places[i], places[i] + kArrow * frame.direction(rig.cameras[i].pose.forward()), kDirection);
  for (size_t i = 0; i < places.size(); i++) {
    cv::circle(out, cv::Point2d(places[i].x, places[i].y), 3, kCamera, cv::FILLED, cv::LINE_AA);
    if (places.size() <= kMostLabels || i == 0 || i + 1 == places.size())
      write_text(plan, std::to_string(rig.cameras[i].id), places[i] + lf::Vec2(5, -4), 7);
  }
  if (frame.scale() > 0) {
    const double length = round_length(kPlanWidth / 3.0 / frame.scale());
    const lf::Vec2 end(kPlanWidth - 12, kPlanHeight - 12), begin = end - lf::Vec2(length * frame.scale(), 0);
    draw_line(out, begin, end, cv::Scalar::all(235));
    write_text(plan, lf::format_text("%g m", length), begin + lf::Vec2(0, -6), 8);
  }
  return plan;
}

// Returns the rig with the first pictures of sequences as stills.
lf::Rig still_rig(lf::Rig rig) {
  for (lf::Camera& camera : rig.cameras) {
    if (!camera.image.empty() || camera.source.empty()) continue;
    const lf::CameraSource source = lf::find_camera_source(rig, camera);
    if (source.kind == lf::CameraSource::Kind::kSequence) camera.image = lf::sequence_file(source, 0);
    if (source.kind == lf::CameraSource::Kind::kStill) camera.image = source.location;
  }
  lf::rebase_paths(rig, rig.directory);
  return rig;
}

lf::Image home_view(const lf::Rig& rig, const lf::Mesh& mesh, const lf::CameraImages& images, const lf::Viewpoint& home,
                    double aspect) {
  constexpr lf::DepthEstimator::Settings kSurface{.mode = lf::FocusMode::kSurface};
  const lf::View view = lf::make_view(home, kViewWidth, std::max(1, static_cast<int>(kViewWidth / aspect)));
  lf::CameraSet cameras(rig.cameras.size());
  std::iota(cameras.begin(), cameras.end(), 0);
  const std::optional<lf::ArrayDepth> depths = estimate_depths_with_progress(rig, cameras, {{view}}, images, kSurface);
  const lf::ArrayDepth* const known = depths ? &*depths : nullptr;
  const lf::View focused = lf::focus_still(rig, mesh, view, images, kSurface, lf::kSettledRounds, nullptr, known);
  return lf::render_still(rig, mesh, focused, images, lf::Resampling::kSharpened, {}, nullptr, known).picture;
}

}  // namespace

lf::Image array_sheet(const lf::Rig& source, const std::string& heading) {
  const lf::Rig rig = still_rig(source);
  const lf::Mesh mesh = lf::build_mesh(rig);
  const lf::Camera& middle = rig.cameras[lf::middle_camera(rig)];
  const double aspect = static_cast<double>(middle.width) / middle.height;
  lf::StillImageCache stills(rig);
  const lf::CameraImages images = [&](lf::CameraIndex i) -> const lf::Image& { return stills.get(i); };
  const bool has_pictures = lf::has_images(rig);
  const std::optional<lf::FocusRange> range =
      has_pictures ? lf::estimate_focus_range(rig, images) : std::optional<lf::FocusRange>();
  const lf::Viewpoint home = lf::VisibleFraction(rig).home(aspect, range ? std::sqrt(range->near * range->far) : 0);
  std::vector<Panel> panels;
  if (has_pictures) {
    panels.push_back({std::to_string(rig.cameras.size()) + " camera images", camera_mosaic(rig, images, 960, true)});
    panels.push_back({lf::format_text("home view, in focus around %.3g m", home.focus_distance),
                      home_view(rig, mesh, images, home, aspect)});
  }
  panels.push_back({"cameras from behind, by id", camera_plan(rig, mesh, home.pose, Side::kBehind)});
  panels.push_back({"cameras from above", camera_plan(rig, mesh, home.pose, Side::kAbove)});
  return make_contact_sheet(heading, panels, 2,
                            lf::arrangement_text(rig) + (has_pictures ? "" : "; no still pictures to show"));
}
