// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bench/render/methods.h"

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/worker_pool.h"
#include "composite/accumulator.h"
#include "image/colour_correction.h"
#include "node/request_renderer.h"
#include "render/camera_projection.h"
#include "render/contribution_map.h"
#include "render/ownership.h"
#include "wire/answer_codec.h"
#include "wire/fragment_codec.h"

namespace lf::bench {
namespace {

// Waiting threads, as in a live system. The calling thread works too: a pool of one has no threads.
class Pool {
 public:
  explicit Pool(int threads);
  ~Pool();
  Pool(const Pool&) = delete;
  Pool& operator=(const Pool&) = delete;

  // As in ParallelFor. Not thread-safe.
  void run(size_t count, const std::function<void(size_t)>& task);
  ParallelFor parallel() {
    return [this](size_t count, const std::function<void(size_t)>& task) { run(count, task); };
  }

 private:
  void wait_for_work();
  void work();

  std::mutex mutex_;
  std::condition_variable start_, done_;
  uint64_t round_ = 0;  // number of run() calls
  size_t working_ = 0;
  bool stop_ = false;
  std::exception_ptr error_;
  // Task of the current round.
  const std::function<void(size_t)>* task_ = nullptr;
  size_t count_ = 0;
  std::atomic<size_t> next_ = 0;
  std::vector<std::thread> threads_;
};

Pool::Pool(int threads) {
  for (int i = 1; i < threads; i++) threads_.emplace_back([this] { wait_for_work(); });
}

Pool::~Pool() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  start_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Pool::run(size_t count, const std::function<void(size_t)>& task) {
  {
    const std::lock_guard lock(mutex_);
    task_ = &task;
    count_ = count;
    next_ = 0;
    working_ = threads_.size();
    round_++;
  }
  start_.notify_all();
  work();
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return working_ == 0; });
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
}

void Pool::wait_for_work() {
  uint64_t seen = 0;
  std::unique_lock lock(mutex_);
  while (true) {
    start_.wait(lock, [&] { return stop_ || round_ != seen; });
    if (stop_) return;
    seen = round_;
    lock.unlock();
    work();
    lock.lock();
    if (--working_ == 0) done_.notify_one();
  }
}

void Pool::work() {
  for (size_t i; (i = next_++) < count_;) {
    try {
      (*task_)(i);
    } catch (...) {
      const std::lock_guard lock(mutex_);
      error_ = std::current_exception();
    }
  }
}

// The default: a node adds up its cameras and encodes the answer like lffragment, in 16 bits within a process or as
// JPEG; a compositor decodes the answer. The compositor runs in one thread.
class NodeMethod : public Method {
 public:
  NodeMethod(const Scene& scene, const View& view, Pixels pixels, int jpeg_quality, int threads,
             const ColourModel& colour)
      : scene_(scene), pixels_(pixels), pool_(threads) {
    request_.view = view;
    request_.quality = static_cast<uint8_t>(jpeg_quality);
    options_.in_process = jpeg_quality == 0;
    options_.parallel = pool_.parallel();
    for (const Camera& camera : scene.rig().cameras)
      colours_.emplace_back(colour, family_of(pixels), camera.width, camera.height, camera.principal_point());
    corrected_.resize(colours_.size());
  }

  void render() override {
    const RequestPlan plan(scene_.rig(), scene_.mesh(), request_, scene_.cameras());
    sources_.clear();
    for (const CameraIndex camera : plan.cameras())
      sources_.push_back({camera, &scene_.rig().cameras[camera], scene_.image(camera, pixels_)});
    options_.parallel(sources_.size(), [&](size_t i) {
      Source& source = sources_[i];
      const ColourCorrection& colour = colours_[source.camera];
      if (colour.is_identity()) return;
      source.image = colour.apply(source.image, plan.answer_region(source.camera), corrected_[i]);
    });
    const View& view = request_.view;
    const wire::AnswerHeader header{.view_width = view.width, .view_height = view.height, .family = family_of(pixels_)};
    sum_.reset(header.family, view.width, view.height);  // references the answer
    answer_ = renderer_.render({&plan, header}, sources_, options_, scratch_, std::move(answer_)).bytes;

    const auto answer = wire::parse_answer(answer_);
    for (const wire::FragmentView& fragment : answer->fragments) {
      if (options_.in_process)
        sum_.add_borrowed(decoder_.sums(fragment));
      else
        sum_.add(decoder_.decode(fragment).value());
    }
    resolve_into(sum_, picture_);
  }
  Image picture() const override { return picture_; }
  size_t bytes() const override { return answer_.size(); }

 private:
  const Scene& scene_;
  ViewRequest request_;
  const Pixels pixels_;
  Pool pool_;
  RenderOptions options_;
  RequestRenderer renderer_;
  ImageMemory scratch_;
  wire::FragmentDecoder decoder_;
  std::vector<Source> sources_;
  std::vector<ColourCorrection> colours_;
  std::vector<ByteBuffer> corrected_;
  ByteBuffer answer_;
  Accumulator sum_;
  Image picture_;
};

void add_nodes(const MethodOptions& options, std::vector<MethodKind>& kinds) {
  const auto add = [&](Pixels pixels, int quality, int threads, const std::string& name = "simd",
                       const ColourModel& colour = {}) {
    Setting setting{name, pixels, quality > 0 ? "jpeg" : "raw", quality};
    setting.threads = threads;
    setting.is_default = name == "simd" && pixels == Pixels::kI420 && (quality == 0 || quality == 90);
    kinds.push_back({setting, [=](const Scene& scene, const View& view) {
                       return std::make_unique<NodeMethod>(scene, view, pixels, quality, threads, colour);
                     }});
  };
  for (const int threads : options.threads) {
    add(Pixels::kI420, 0, threads);
    for (const int quality : options.qualities)
      if (threads == 1 || quality == 90 || options.qualities.size() == 1) add(Pixels::kI420, quality, threads);
  }
  if (!options.all) return;
  add(Pixels::kRgbx, 0, 1);
  add(Pixels::kRgb, 0, 1);
  // Colour corrections: a model with all terms, and a model that is nearly a gain.
  const ColourModel all{.black = {3, 4, 5},
                        .gamma = 2.1,
                        .matrix = {1.05, -0.02, 0.01, 0.01, 0.97, 0, 0, 0.03, 1.02},
                        .vignetting = {-0.25, -0.05}};
  const ColourModel balance{.matrix = {1.05, 0, 0, 0, 0.97, 0, 0, 0, 1.02}, .vignetting = {-0.25, -0.05}};
  for (const Pixels pixels : {Pixels::kI420, Pixels::kRgb}) {
    add(pixels, 0, 1, "simd colour", all);
    add(pixels, 0, 1, "simd balance", balance);
  }
}

// The baseline: the same view, rendered with efficient OpenCV calls. For every camera, over the tight rectangle of its
// part: warpPerspective, multiply by weights, add; 8-bit BGR, bilinear, one thread. Everything that depends on the view
// alone (rectangles, homographies, weights, maps) is computed in advance at no cost, and missing weight is not
// compensated.
enum class Formulation {
  kMultiply,  // 8-bit weights, 8-bit products, 8-bit sum
  kProduct,   // 8-bit weights, products added to a float sum
  kRemap,     // kMultiply with precomputed fixed-point maps: for static views, with any lens
};

// Returns the homography from a pixel of the rectangle to a position in the camera's image, ignoring distortion.
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
    part.weights = three_channel_weights(valid_weights(plan, FaceIdMap(job.runs()), camera, rig_camera, rect), rect);
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
  const int jpeg_quality_;  // 0: no JPEG
  std::vector<Part> parts_;
  cv::Mat picture_, sum_, warped_, weighted_, decoded_;
  std::vector<uint8_t> jpeg_;
  size_t bytes_ = 0;
};

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

}  // namespace

std::vector<MethodKind> methods(const MethodOptions& options) {
  std::vector<MethodKind> kinds;
  add_opencv(options, kinds);
  add_nodes(options, kinds);
  return kinds;
}

}  // namespace lf::bench
