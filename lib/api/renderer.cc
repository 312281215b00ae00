// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/renderer.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <lightfield/node.h>

#include "api/values.h"
#include "base/memory.h"
#include "base/text.h"
#include "base/worker_pool.h"
#include "composite/assembly.h"
#include "focus/focus_array.h"
#include "focus/view_depths.h"
#include "node/node.h"
#include "node/renderer_selector.h"
#include "node/request_renderer.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view_request.h"
#include "wire/answer_codec.h"
#include "wire/consistency_codec.h"
#include "wire/request_codec.h"

namespace lf::api {
namespace {

Resampling to_resampling(lightfield::Resampling resampling) {
  switch (resampling) {
    case lightfield::Resampling::kBilinear: return Resampling::kBilinear;
    case lightfield::Resampling::kSharpened: return Resampling::kSharpened;
  }
  throw Error("resampling: unknown value; use kBilinear or kSharpened");
}

void check(RendererChoice renderer) {
  switch (renderer) {
    case RendererChoice::kCpu:
    case RendererChoice::kGl:
    case RendererChoice::kAuto: return;
  }
  throw Error("renderer: unknown value; use kCpu, kGl or kAuto");
}

}  // namespace

// The cameras of one node. Not thread-safe.
class LocalNode {
 public:
  // `cameras` lists the indices in the order of the frames. Throws Error if the list is empty, or if an index is
  // unknown or a duplicate. `threads` 0 means the number of processors.
  LocalNode(std::shared_ptr<const Rig> rig, uint64_t rig_hash, std::vector<CameraIndex> cameras, unsigned threads);

  const std::vector<CameraIndex>& cameras() const { return cameras_; }
  // Throws Error if the request was made for another rig or does not fit this rig.
  RequestPlan plan(const ViewRequest& request);
  // Renders an answer. `frames` has one frame for each of cameras(), `in_process` is as in RenderOptions, and `memory`
  // is reused. Throws Error like plan(), or if a frame does not fit.
  RenderedAnswer answer(const ViewRequest& request, const std::vector<lightfield::ImageView>& frames,
                        lightfield::Resampling resampling, bool in_process, ByteBuffer memory = {},
                        RendererChoice renderer = RendererChoice::kCpu);
  std::string drawn_by() const { return gpu_.explain(choice_); }

 private:
  const std::shared_ptr<const Rig> rig_;
  const uint64_t rig_hash_;
  const std::vector<CameraIndex> cameras_;
  std::vector<CameraIndex> own_;  // cameras_ in ascending order
  std::vector<size_t> frame_of_;  // index into cameras_ for each of own_
  const unsigned threads_;
  const std::shared_ptr<WorkerPool> workers_ = WorkerPool::shared();
  const RigColourCorrections colours_{*rig_};
  MeshCache mesh_;
  ClientStates views_{lf::Node::ClientState()};
  ImageMemory scratch_;
  RendererSelector gpu_;
  RendererChoice choice_ = RendererChoice::kCpu;
};

LocalNode::LocalNode(std::shared_ptr<const Rig> rig, uint64_t rig_hash, std::vector<CameraIndex> cameras,
                     unsigned threads)
    : rig_(std::move(rig)),
      rig_hash_(rig_hash),
      cameras_(std::move(cameras)),
      threads_(threads > 0 ? threads : std::max(std::thread::hardware_concurrency(), 1u)) {
  if (cameras_.empty()) throw Error("cameras: a node needs at least one camera");
  frame_of_.resize(cameras_.size());
  std::iota(frame_of_.begin(), frame_of_.end(), 0);
  std::ranges::sort(frame_of_, {}, [this](size_t i) { return cameras_[i]; });
  for (const size_t i : frame_of_) {
    const std::string name = "cameras: " + std::to_string(cameras_[i]);
    if (cameras_[i] >= rig_->cameras.size())
      throw Error(name + " is not one of the rig's " + std::to_string(rig_->cameras.size()) + " cameras");
    if (!own_.empty() && own_.back() == cameras_[i]) throw Error(name + " is listed twice");
    own_.push_back(cameras_[i]);
  }
}

RequestPlan LocalNode::plan(const ViewRequest& request) {
  if (request.rig_hash != 0 && request.rig_hash != rig_hash_)
    throw Error("the request was made for another rig; load the same rig file in all processes");
  return {*rig_, mesh_.get(*rig_, request.out_of_service), request, own_};
}

RenderedAnswer LocalNode::answer(const ViewRequest& request, const std::vector<lightfield::ImageView>& frames,
                                 lightfield::Resampling resampling, bool in_process, ByteBuffer memory,
                                 RendererChoice renderer) {
  check_count(frames.size(), cameras_.size());
  wire::AnswerHeader header = wire::answer_to(request, {request.view.width, request.view.height}, rig_hash_);
  header.actual_time = request.target_time;
  header.family = family_of(frames);
  std::vector<ImageView> images;
  CameraSet blind;
  for (size_t i = 0; i < own_.size(); i++) {
    images.push_back(to_image(frames[frame_of_[i]], rig_->cameras[own_[i]], own_[i]));
    if (images.back().family == PixelFamily::kNone) blind.push_back(own_[i]);
  }
  check(renderer);
  choice_ = renderer;
  RenderOptions options;
  options.resampling = to_resampling(resampling);
  options.in_process = in_process;
  options.colours = &colours_;
  // Raw answers must give the same picture, bit for bit, as one node with all cameras.
  if (request.quality == 0) options.codec = CodecChoice::kRaw16;
  options.parallel = [this](size_t count, const std::function<void(size_t)>& task) {
    workers_->run(threads_, count, task);
  };
  const RequestPlan plan = this->plan(request);

  header.cameras = CameraRanges(own_);
  header.blind = CameraRanges(blind);
  std::vector<Source> sources;
  if (header.family != PixelFamily::kNone)
    for (const CameraIndex camera : plan.cameras()) {
      const auto place = static_cast<size_t>(std::ranges::lower_bound(own_, camera) - own_.begin());
      sources.push_back({camera, &rig_->cameras[camera], images[place]});
    }
  std::string warning;
  options.gpu = gpu_.open(choice_, warning);
  options.depth_gpu = gpu_.open_for_depth(choice_);
  RenderedAnswer answer =
      views_.of(request.view_id)
          ->renderer.render({&plan, std::move(header)}, sources, options, scratch_, std::move(memory));
  gpu_.rendered(choice_, answer);
  gpu_.tried(choice_, answer.consistency);
  return answer;
}

}  // namespace lf::api

namespace lightfield {
namespace {

lf::ViewRequest decode(const Bytes& bytes) {
  std::string reason;
  std::optional<lf::ViewRequest> request = lf::wire::decode_request(bytes, &reason);
  if (!request) throw Error("not a request: " + reason);
  return std::move(*request);
}

}  // namespace

RequestInfo read_request(const Bytes& request) {
  const lf::ViewRequest decoded = decode(request);
  return {decoded.view_id, decoded.sequence, decoded.target_time};
}

struct [[gnu::visibility("hidden")]] Node::State {
  State(const Rig& rig, std::vector<uint32_t> cameras, const NodeOptions& options)
      : node(rig.data().rig, rig.data().hash, std::move(cameras), options.threads), resampling(options.resampling) {}
  std::mutex mutex;
  lf::api::LocalNode node;
  const Resampling resampling;
};

Node::Node(Rig rig, std::vector<uint32_t> cameras, const NodeOptions& options)
    : state_(std::make_unique<State>(rig, std::move(cameras), options)) {}
Node::~Node() = default;
Node::Node(Node&&) noexcept = default;
Node& Node::operator=(Node&&) noexcept = default;

const std::vector<uint32_t>& Node::cameras() const { return state_->node.cameras(); }

std::vector<uint32_t> Node::cameras_for(const Bytes& request) const {
  const lf::ViewRequest decoded = decode(request);
  const std::lock_guard lock(state_->mutex);
  return state_->node.plan(decoded).cameras();
}

std::vector<Bytes> Node::answer(const Bytes& request, const std::vector<ImageView>& frames) const {
  const lf::ViewRequest decoded = decode(request);
  const std::lock_guard lock(state_->mutex);
  const lf::RenderedAnswer answer = state_->node.answer(decoded, frames, state_->resampling, false);
  std::vector<Bytes> parts;
  for (const lf::ByteBuffer* unit : {&answer.brightness, &answer.consistency.unit, &answer.bytes})
    if (!unit->empty()) parts.emplace_back(unit->begin(), unit->end());
  return parts;
}

std::vector<Bytes> Node::answer(const Bytes& request, const std::vector<Image>& frames) const {
  return answer(request, std::vector<ImageView>(frames.begin(), frames.end()));
}

}  // namespace lightfield

namespace lf::api {
namespace {

constexpr const char* kNoRequest = "there is no picture yet: call request() first";

CameraSet to_camera_set(std::vector<uint32_t> cameras, size_t count) {
  std::ranges::sort(cameras);
  cameras.erase(std::unique(cameras.begin(), cameras.end()), cameras.end());
  if (!cameras.empty() && cameras.back() >= count)
    throw Error("out_of_service: " + std::to_string(cameras.back()) + " is not one of the rig's " +
                std::to_string(count) + " cameras");
  return cameras;
}

}  // namespace

// A viewer with one request at a time. Not thread-safe.
class ViewComposer {
 public:
  using AddResult = lightfield::Compositor::AddResult;

  ViewComposer(std::shared_ptr<const Rig> rig, uint64_t rig_hash, uint32_t view_id);

  const ViewRequest& begin(const lightfield::View& view, const lightfield::RequestOptions& options);
  // Adds a message of an answer. If `owner` is set, it keeps the bytes alive, and they are used without a copy until
  // finish().
  AddResult add(std::span<const uint8_t> unit, std::shared_ptr<const void> owner = nullptr);
  bool is_complete() const;
  lightfield::Image finish();
  void finish_into(const lightfield::MutableImageView& out);

  unsigned missing() const { return missing_; }
  void reset_focus();

 private:
  std::string add_consistency(std::span<const uint8_t> unit);
  std::string add_answer(std::span<const uint8_t> unit, std::shared_ptr<const void> owner);

  const std::shared_ptr<const Rig> rig_;
  const uint64_t rig_hash_;
  const uint32_t view_id_;
  uint32_t sequence_ = 0;
  std::optional<ViewRequest> current_;
  Background background_;
  Assembly assembly_;
  std::set<CameraRanges> answered_;
  std::set<size_t> tried_;
  ViewDepths::Answers answers_;
  ViewDepths focus_;
  std::optional<FocusArray> array_;
  unsigned missing_ = 0;
};

ViewComposer::ViewComposer(std::shared_ptr<const Rig> rig, uint64_t rig_hash, uint32_t view_id)
    : rig_(std::move(rig)), rig_hash_(rig_hash), view_id_(view_id) {
  assembly_.set_rig(rig_);
}

const ViewRequest& ViewComposer::begin(const lightfield::View& view, const lightfield::RequestOptions& options) {
  ViewRequest request;
  request.view = to_view(view);
  request.view_id = view_id_;
  request.sequence = sequence_ + 1;
  request.target_time = options.time;
  request.absolute_time = options.time != kNoTime;
  if (options.quality < 0 || options.quality > 100) throw Error("quality: must be 0 to 100");
  request.quality = static_cast<uint8_t>(options.quality);
  request.rig_hash = rig_hash_;
  request.out_of_service = to_camera_set(options.out_of_service, rig_->cameras.size());
  const DepthEstimator::Settings settings = to_settings(options.focus, options.nearest, options.farthest);
  const bool match = options.match_brightness.value_or(!rig_->has_colour());
  if (settings != focus_.settings() || match != focus_.matches_gains()) focus_ = ViewDepths(settings, match);
  if (settings.mode != FocusMode::kPlane) focus_.apply(request);

  current_.reset();
  assembly_.begin(request);
  background_ = {options.background.r, options.background.g, options.background.b};
  answered_.clear();
  tried_.clear();
  answers_ = {};
  sequence_ = request.sequence;
  return current_.emplace(std::move(request));
}

ViewComposer::AddResult ViewComposer::add(std::span<const uint8_t> unit, std::shared_ptr<const void> owner) {
  if (!current_) return {false, kNoRequest};
  const std::string problem = wire::is_consistency(unit) ? add_consistency(unit) : add_answer(unit, std::move(owner));
  return {problem.empty(), problem};
}

// Returns why the message was not added, or "".
std::string ViewComposer::add_consistency(std::span<const uint8_t> unit) {
  std::string reason;
  const std::optional<wire::ConsistencyHeader> header = wire::parse_consistency_header(unit, nullptr, &reason);
  if (!header) return "damaged: " + reason;
  if (header->view_id != view_id_ || header->sequence != current_->sequence)
    return "the part belongs to another request";
  // Identical bytes are a duplicate: no two nodes have the same sums.
  const size_t hash = std::hash<std::string_view>()({reinterpret_cast<const char*>(unit.data()), unit.size()});
  if (tried_.contains(hash)) return "duplicate";
  const std::string problem = lf::add_consistency(unit, *header, *current_, answers_);
  if (!problem.empty()) return "the part is damaged or was not requested: " + problem;
  tried_.insert(hash);
  return {};
}

std::string ViewComposer::add_answer(std::span<const uint8_t> unit, std::shared_ptr<const void> owner) {
  std::string reason;
  const std::optional<wire::AnswerView> answer = wire::parse_answer(unit, &reason);
  if (!answer) return "damaged: " + reason;
  const unsigned damaged = assembly_.damaged();
  switch (assembly_.add(*answer, std::move(owner))) {
    case Assembly::Verdict::kOtherRequest: return "the part belongs to another request";
    case Assembly::Verdict::kOtherRig: return "the part was made with another rig";
    case Assembly::Verdict::kBadFragment:
      return "the part was partly ignored: it is a duplicate, or does not match the view or earlier parts";
    default: break;
  }
  answered_.insert(answer->cameras);
  return assembly_.damaged() > damaged ? "damaged: partly ignored" : "";
}

bool ViewComposer::is_complete() const {
  if (!current_) return false;
  CameraSet all(rig_->cameras.size());
  std::iota(all.begin(), all.end(), 0);
  CameraRanges awaited(all);
  awaited.remove(CameraRanges(current_->out_of_service));
  const size_t units = static_cast<size_t>(!current_->hypotheses.empty()) + current_->gains.ask;
  return assembly_.cameras().contains(awaited) && tried_.size() >= units * answered_.size();
}

lightfield::Image ViewComposer::finish() {
  if (!current_) throw Error(kNoRequest);
  const PixelFamily family = assembly_.family() == PixelFamily::kNone ? PixelFamily::kRgb : assembly_.family();
  lightfield::Image picture =
      lightfield::make_image(static_cast<lightfield::PixelFormat>(family), current_->view.width, current_->view.height);
  finish_into(picture);
  return picture;
}

void ViewComposer::finish_into(const lightfield::MutableImageView& out) {
  if (!current_) throw Error(kNoRequest);
  const PixelFamily family = check_output(out, current_->view.width, current_->view.height);
  if (assembly_.family() != PixelFamily::kNone && assembly_.family() != family)
    throw Error(std::string("out: is ") +
                (family == PixelFamily::kRgb ? "RGB, but the cameras are I420" : "I420, but the cameras are RGB"));
  assembly_.finish(family, background_ != Background{});
  missing_ = assembly_.missing();
  assembly_.picture().resolve(background_, RgbLayout{}, out.plane, out.stride);
  if (focus_.settings().mode != FocusMode::kPlane) {
    if (!array_) array_.emplace(*rig_);
    answers_.complete = missing_ == 0 && assembly_.damaged() == 0;
    focus_.take(*current_, answers_, *array_);
  }
  assembly_.release();
  current_.reset();
}

void ViewComposer::reset_focus() { focus_ = ViewDepths(focus_.settings(), focus_.matches_gains()); }

}  // namespace lf::api

namespace lightfield {

struct [[gnu::visibility("hidden")]] Compositor::State {
  State(const Rig& rig, uint32_t view_id) : composer(rig.data().rig, rig.data().hash, view_id) {}
  lf::api::ViewComposer composer;
};

Compositor::Compositor(Rig rig, uint32_t view_id) : state_(std::make_unique<State>(rig, view_id)) {}
Compositor::~Compositor() = default;
Compositor::Compositor(Compositor&&) noexcept = default;
Compositor& Compositor::operator=(Compositor&&) noexcept = default;

Bytes Compositor::request(const View& view, const RequestOptions& options) {
  return lf::wire::encode_request(state_->composer.begin(view, options));
}

Compositor::AddResult Compositor::add(const Bytes& part) { return state_->composer.add(part); }

bool Compositor::is_complete() const { return state_->composer.is_complete(); }

Image Compositor::finish() { return state_->composer.finish(); }
void Compositor::finish_into(const MutableImageView& out) { state_->composer.finish_into(out); }

unsigned Compositor::missing() const { return state_->composer.missing(); }
void Compositor::reset_focus() { state_->composer.reset_focus(); }

namespace {

std::vector<uint32_t> all_cameras(const Rig& rig) {
  std::vector<uint32_t> cameras(rig.size());
  std::iota(cameras.begin(), cameras.end(), 0);
  return cameras;
}

}  // namespace

struct [[gnu::visibility("hidden")]] Renderer::State {
  State(Rig of, unsigned threads)
      : rig(std::move(of)),
        node(rig.data().rig, rig.data().hash, all_cameras(rig), threads),
        composer(rig.data().rig, rig.data().hash, 0) {}
  const Rig rig;
  lf::api::LocalNode node;
  lf::api::ViewComposer composer;
  lf::ByteBuffer memory;

  std::vector<uint32_t> cameras(const View& view) {
    lf::ViewRequest request;
    request.view = lf::api::to_view(view);
    return node.plan(request).cameras();
  }
  // Returns all cameras without an image if the view needs any of them; otherwise none, because cameras that the view
  // does not need may lack an image.
  std::vector<uint32_t> missing(const View& view, const std::vector<ImageView>& images) {
    std::vector<uint32_t> missing;
    for (uint32_t i = 0; i < images.size(); i++)
      if (images[i].format == PixelFormat::kNone) missing.push_back(i);
    if (missing.empty()) return missing;
    const std::vector<uint32_t> needed = cameras(view);
    const bool any = std::ranges::any_of(needed, [&](uint32_t i) { return images[i].format == PixelFormat::kNone; });
    return any ? missing : std::vector<uint32_t>();
  }
};

Renderer::Renderer(Rig rig, unsigned threads) : state_(std::make_unique<State>(std::move(rig), threads)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

const Rig& Renderer::rig() const { return state_->rig; }

std::vector<uint32_t> Renderer::cameras(const View& view) const { return state_->cameras(view); }

Image Renderer::render(const View& view, const std::vector<ImageView>& images, const RenderOptions& options) {
  Image picture =
      make_image(lf::api::family_of(images) == lf::PixelFamily::kI420 ? PixelFormat::kI420 : PixelFormat::kRgb,
                 view.width, view.height);
  render_into(view, images, picture, options);
  return picture;
}

void Renderer::render_into(const View& view, const std::vector<ImageView>& images, const MutableImageView& out,
                           const RenderOptions& options) {
  lf::api::check_count(images.size(), state_->rig.size());
  RequestOptions asked;
  asked.focus = options.focus;
  asked.nearest = options.nearest;
  asked.farthest = options.farthest;
  asked.match_brightness = options.match_brightness;
  asked.background = options.background;
  asked.quality = 0;
  asked.out_of_service = state_->missing(view, images);
  lf::api::ViewComposer& composer = state_->composer;
  const lf::ViewRequest& request = composer.begin(view, asked);
  lf::api::check_output(out, view.width, view.height);
  const auto answer = std::make_shared<lf::RenderedAnswer>(
      state_->node.answer(request, images, options.resampling, true, std::move(state_->memory), options.renderer));
  for (const lf::ByteBuffer* unit : {&answer->brightness, &answer->consistency.unit, &answer->bytes})
    if (!unit->empty()) composer.add(*unit, answer);
  composer.finish_into(out);
  state_->memory = std::move(answer->bytes);
}

Image Renderer::render(const View& view, const std::vector<Image>& images, const RenderOptions& options) {
  return render(view, std::vector<ImageView>(images.begin(), images.end()), options);
}

std::string Renderer::drawn_by() const { return state_->node.drawn_by(); }

void Renderer::reset_focus() { state_->composer.reset_focus(); }

}  // namespace lightfield
