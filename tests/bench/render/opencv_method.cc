// SPDX-License-Identifier: LGPL-2.1-or-later
// The baseline: the same view by OpenCV as somebody who knows it well would write it. For every camera, over the tight
// rectangle of its part: warpPerspective, multiply by weights, add; 8-bit BGR, bilinear, one thread. All that depends
// on the view alone (rectangles, homographies, weights, maps) is made before and costs it nothing, and weight that is
// lost is not divided away.
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "bench/render/method.h"
#include "render/camera_projection.h"
#include "render/contribution_map.h"
#include "render/ownership.h"

namespace lf::bench {
namespace {

enum class Formulation {
  kMultiply,  // 8-bit weights, 8-bit products, 8-bit sum
  kProduct,   // 8-bit weights, products added to a sum in float
  kRemap,     // as kMultiply, warped by fixed-point maps made before: for views that don't move, with any lens
};

// From a pixel of the rectangle to a position in the camera's image, its distortion left away.
cv::Mat homography(const ViewPlan& plan, const Camera& camera, const Rect& rect) {
  const View& view = plan.view();
  const Mat3 camera_from_world = glm::transpose(camera.pose.rotation());
  const Vec3 eye = camera_from_world * (view.pose.position - camera.pose.position);
  const auto camera_matrix = [](const Lens& lens, double x, double y) {
    return Mat3(lens.fx(), 0, 0, 0, lens.fy(), 0, lens.cx() - x, lens.cy() - y, 1);
  };
  const Mat3 camera_from_ray =
      plan.focal_offset() * (camera_from_world * view.pose.rotation()) + glm::outerProduct(eye, plan.focal_normal());
  const Mat3 m =
      camera_matrix(camera.lens, 0, 0) * camera_from_ray * glm::inverse(camera_matrix(view.lens, rect.x0, rect.y0));
  cv::Mat out(3, 3, CV_64F);
  for (int row = 0; row < 3; row++)
    for (int column = 0; column < 3; column++) out.at<double>(row, column) = m[column][row];
  return out;
}

cv::Mat three_channel_weights(const std::vector<float>& weights, const Rect& rect) {
  const cv::Mat grey(rect.height(), rect.width(), CV_32F, const_cast<float*>(weights.data()));
  cv::Mat bytes, out;
  grey.convertTo(bytes, CV_8U, 255);
  cv::merge(std::vector<cv::Mat>(3, bytes), out);
  return out;
}

class OpenCvMethod : public Method {
 public:
  OpenCvMethod(const Scene& scene, const View& view, Formulation formulation, int jpeg_quality)
      : formulation_(formulation), jpeg_quality_(jpeg_quality), picture_(view.height, view.width, CV_8UC3) {
    const RenderJob job(scene.rig(), scene.mesh(), view, scene.cameras());
    for (const CameraIndex camera : job.cameras()) add(scene, job, camera);
  }

  void render() override {
    cv::setNumThreads(1);
    bytes_ = 0;
    const bool in_float = formulation_ == Formulation::kProduct;
    if (in_float) sum_.create(picture_.size(), CV_32FC3);
    cv::Mat& sum = in_float ? sum_ : picture_;
    sum.setTo(cv::Scalar());
    for (const Part& part : parts_) {
      warp(part);
      cv::Mat place = sum(part.rect);
      if (in_float) {
        cv::accumulateProduct(warped_, part.weights, place);
        bytes_ += part.weights.total() * part.weights.elemSize();
        continue;
      }
      cv::multiply(warped_, part.weights, weighted_, 1 / 255.0);
      if (jpeg_quality_ > 0) {
        cv::imencode(".jpg", weighted_, jpeg_, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality_});
        cv::imdecode(jpeg_, cv::IMREAD_COLOR, &decoded_);
        cv::add(place, decoded_, place);
        bytes_ += jpeg_.size();
      } else {
        cv::add(place, weighted_, place);
        bytes_ += weighted_.total() * weighted_.elemSize();
      }
    }
    if (in_float) sum_.convertTo(picture_, CV_8U, 1 / 255.0);
  }

  Image picture() const override {
    Image image(PixelFamily::kRgb, picture_.cols, picture_.rows);
    cv::Mat out(picture_.size(), CV_8UC3, image.data().data());
    cv::cvtColor(picture_, out, cv::COLOR_BGR2RGB);
    return image;
  }
  size_t bytes() const override { return bytes_; }

 private:
  struct Part {
    cv::Rect rect;
    cv::Mat image, weights, homography, map, map_fraction;
  };

  void add(const Scene& scene, const RenderJob& job, CameraIndex camera) {
    const ViewPlan& plan = job.plan();
    const Rect rect = CameraCorners(plan, camera).owned(job.runs(), plan.camera_rect(camera));
    if (rect.empty()) return;
    const Camera& rig_camera = scene.rig().cameras[camera];
    const ImageView image = scene.image(camera, Pixels::kBgr);
    Part part;
    part.rect = cv::Rect(rect.x0, rect.y0, rect.width(), rect.height());
    part.image = cv::Mat(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.plane[0]),
                         static_cast<size_t>(image.stride[0]));
    part.weights = three_channel_weights(valid_weights(plan, job.owners(), camera, rig_camera, rect), rect);
    part.homography = homography(plan, rig_camera, rect);
    if (formulation_ == Formulation::kRemap) make_maps(plan, camera, rig_camera, rect, part);
    parts_.push_back(part);
  }

  static void make_maps(const ViewPlan& plan, CameraIndex camera, const Camera& rig_camera, const Rect& rect,
                        Part& part) {
    const CameraProjection projection(plan, camera, rig_camera);
    cv::Mat map(rect.height(), rect.width(), CV_32FC2, cv::Scalar(-9, -9));
    for (int y = rect.y0; y < rect.y1; y++)
      for (int x = rect.x0; x < rect.x1; x++)
        if (Vec2 p; projection.project(plan.rays().at(x, y), 0, p))
          map.at<cv::Vec2f>(y - rect.y0, x - rect.x0) = {static_cast<float>(p.x), static_cast<float>(p.y)};
    cv::convertMaps(map, cv::Mat(), part.map, part.map_fraction, CV_16SC2);
  }

  void warp(const Part& part) {
    if (formulation_ == Formulation::kRemap)
      cv::remap(part.image, warped_, part.map, part.map_fraction, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
    else
      cv::warpPerspective(part.image, warped_, part.homography, part.rect.size(),
                          cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT);
  }

  const Formulation formulation_;
  const int jpeg_quality_;  // 0: none
  std::vector<Part> parts_;
  cv::Mat picture_, sum_, warped_, weighted_, decoded_;
  std::vector<uint8_t> jpeg_;
  size_t bytes_ = 0;
};

}  // namespace

void add_opencv(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  const auto add = [&](const char* name, Formulation formulation, int quality) {
    Setting setting{name, Pixels::kBgr, quality > 0 ? "jpeg" : "raw", quality};
    setting.any_lens = formulation == Formulation::kRemap;
    setting.is_baseline = !setting.any_lens;
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       return std::make_unique<OpenCvMethod>(scene, view, formulation, quality);
                     }});
  };
  add("opencv", Formulation::kMultiply, 0);
  add("opencv-product", Formulation::kProduct, 0);
  if (options.all) add("opencv-remap", Formulation::kRemap, 0);
  for (const int quality : options.qualities) add("opencv", Formulation::kMultiply, quality);
}

}  // namespace lf::bench
