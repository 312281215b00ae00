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
#include "focus/view_focus.h"
#include "node/card.h"
#include "node/request_renderer.h"
#include "rig/mesh.h"
#include "rig/rig.h"
#include "view/view_request.h"
#include "wire/answer_codec.h"
#include "wire/moments_codec.h"
#include "wire/request_codec.h"

namespace lf::api {
namespace {

Resampling to_resampling(lightfield::Resampling resampling) {
  switch (resampling) {
    case lightfield::Resampling::kBilinear: return Resampling::kBilinear;
    case lightfield::Resampling::kSharpened: return Resampling::kSharpened;
  }
  throw Error("resampling: is none of the values that there are");
}

void check(RendererChoice renderer) {
  switch (renderer) {
    case RendererChoice::kCpu:
    case RendererChoice::kGl:
    case RendererChoice::kAuto: return;
  }
  throw Error("renderer: is none of the values that there are");
}

}  // namespace

// The cameras of one node whose frames come with each request. Not thread-safe.
class LocalNode {
 public:
  // `cameras`: indices in the order of frames. Throws Error for one that the rig does not have, one twice, and none.
  // `threads` 0: as many as there are processors.
  LocalNode(std::shared_ptr<const Rig> rig, uint64_t rig_hash, std::vector<CameraIndex> cameras, unsigned threads);

  const std::vector<CameraIndex>& cameras() const { return cameras_; }
  // Plans the request. Throws Error for a request that was made for another rig or does not fit this rig.
  RequestPlan plan(const ViewRequest& request);
  // The answer. `frames`: one for each of cameras(). `in_process`: as RenderOptions has it. `memory` is recycled.
  // Throws Error as plan() does, and for frames that do not fit.
  RenderedAnswer answer(const ViewRequest& request, const std::vector<lightfield::ImageView>& frames,
                        lightfield::Resampling resampling, bool in_process, ByteBuffer memory = {},
                        RendererChoice renderer = RendererChoice::kCpu);
  // See Card::explain(); of the latest answer.
  std::string drawn_by() const { return card_.explain(choice_); }

 private:
  const std::shared_ptr<const Rig> rig_;
  const uint64_t rig_hash_;
  const std::vector<CameraIndex> cameras_;
  std::vector<CameraIndex> own_;  // cameras_ in ascending order
  std::vector<size_t> frame_of_;  // for each of own_ its place in cameras_
  const unsigned threads_;
  const std::shared_ptr<WorkerPool> workers_ = WorkerPool::shared();
  const CameraColours colours_{*rig_};
  MeshCache mesh_;
  RequestRenderer renderer_;
  ImageMemory scratch_;
  Card card_;
  RendererChoice choice_ = RendererChoice::kCpu;  // of the latest answer
};

LocalNode::LocalNode(std::shared_ptr<const Rig> rig, uint64_t rig_hash, std::vector<CameraIndex> cameras,
                     unsigned threads)
    : rig_(std::move(rig)),
      rig_hash_(rig_hash),
      cameras_(std::move(cameras)),
      threads_(threads > 0 ? threads : std::max(std::thread::hardware_concurrency(), 1u)) {
  if (cameras_.empty()) throw Error("cameras: a node needs at least one");
  frame_of_.resize(cameras_.size());
  std::iota(frame_of_.begin(), frame_of_.end(), 0);
  std::ranges::sort(frame_of_, {}, [this](size_t i) { return cameras_[i]; });
  for (const size_t i : frame_of_) {
    const std::string name = "cameras: " + std::to_string(cameras_[i]);
    if (cameras_[i] >= rig_->cameras.size())
      throw Error(name + " is not one of the rig's " + std::to_string(rig_->cameras.size()) + " cameras");
    if (!own_.empty() && own_.back() == cameras_[i]) throw Error(name + " is named twice");
    own_.push_back(cameras_[i]);
  }
}

RequestPlan LocalNode::plan(const ViewRequest& request) {
  if (request.rig_hash != 0 && request.rig_hash != rig_hash_) throw Error("the request was made for another rig");
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
  // Where no JPEG is asked for the picture is as if all cameras were on one node.
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
  std::string news;  // is in drawn_by(), too
  options.card = card_.open(choice_, news);
  options.trial_card = card_.open_for_trials(choice_);
  RenderedAnswer answer = renderer_.render({&plan, std::move(header)}, sources, options, scratch_, std::move(memory));
  card_.rendered(choice_, answer);
  card_.tried(choice_, answer.trials);
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
  for (const lf::ByteBuffer* unit : {&answer.brightness, &answer.trials.unit, &answer.bytes})
    if (!unit->empty()) parts.emplace_back(unit->begin(), unit->end());
  return parts;
}

std::vector<Bytes> Node::answer(const Bytes& request, const std::vector<Image>& frames) const {
  return answer(request, std::vector<ImageView>(frames.begin(), frames.end()));
}

}  // namespace lightfield

namespace lf::api {
namespace {

CameraSet to_camera_set(std::vector<uint32_t> cameras, size_t count) {
  std::ranges::sort(cameras);
  cameras.erase(std::unique(cameras.begin(), cameras.end()), cameras.end());
  if (!cameras.empty() && cameras.back() >= count)
    throw Error("out_of_service: " + std::to_string(cameras.back()) + " is not one of the rig's " +
                std::to_string(count) + " cameras");
  return cameras;
}

}  // namespace

// One viewer: its requests, one at a time, and the pictures that come of the answers. Not thread-safe.
class ViewComposer {
 public:
  using Added = lightfield::Compositor::Added;

  ViewComposer(std::shared_ptr<const Rig> rig, uint64_t rig_hash, uint32_t view_id);

  // Begins the next picture and returns the request that nodes are to answer. Throws Error for a view or an option that
  // is none.
  const ViewRequest& begin(const lightfield::View& view, const lightfield::RequestOptions& options);
  // Adds a unit of an answer. `owner`: what keeps the bytes where they are; with it they may be used there until
  // finish().
  Added add(std::span<const uint8_t> unit, std::shared_ptr<const void> owner = nullptr);
  bool is_complete() const;
  // Throws Error without a picture that was begun.
  lightfield::Image finish();

  unsigned missing() const { return missing_; }
  void reset_focus();

 private:
  std::string add_moments(std::span<const uint8_t> unit);
  std::string add_answer(std::span<const uint8_t> unit, std::shared_ptr<const void> owner);

  const std::shared_ptr<const Rig> rig_;
  const uint64_t rig_hash_;
  const uint32_t view_id_;
  uint32_t sequence_ = 0;
  std::optional<ViewRequest> current_;
  Background background_;
  Assembly assembly_;
  // Nodes whose answers are there, by their cameras; and units of moments that are, by a hash of their bytes.
  std::set<CameraRanges> answered_;
  std::set<size_t> tried_;
  ViewFocus::Answers answers_;
  ViewFocus focus_;
  std::optional<FocusArray> array_;  // made when a surface is first looked for
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
  const FocusControl::Settings settings = to_settings(options.focus, options.nearest, options.farthest);
  const bool match = options.match_brightness.value_or(!rig_->has_colour());
  if (settings != focus_.settings() || match != focus_.matches_gains()) focus_ = ViewFocus(settings, match);
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

ViewComposer::Added ViewComposer::add(std::span<const uint8_t> unit, std::shared_ptr<const void> owner) {
  if (!current_) return {false, "no picture was begun"};
  const std::string why_not = wire::is_moments(unit) ? add_moments(unit) : add_answer(unit, std::move(owner));
  return {why_not.empty(), why_not};
}

// Why not; empty: they were added.
std::string ViewComposer::add_moments(std::span<const uint8_t> unit) {
  std::string reason;
  const std::optional<wire::MomentsHeader> header = wire::parse_moments_header(unit, nullptr, &reason);
  if (!header) return "damaged: " + reason;
  if (header->view_id != view_id_ || header->sequence != current_->sequence) return "of another request";
  // What is the same to the last byte has come twice: no two nodes see the same.
  const size_t hash = std::hash<std::string_view>()({reinterpret_cast<const char*>(unit.data()), unit.size()});
  if (tried_.contains(hash)) return "is there already";
  const std::string why_not = lf::add_moments(unit, *header, *current_, answers_);
  if (!why_not.empty()) return "damaged, or not asked for: " + why_not;
  tried_.insert(hash);
  return {};
}

std::string ViewComposer::add_answer(std::span<const uint8_t> unit, std::shared_ptr<const void> owner) {
  std::string reason;
  const std::optional<wire::AnswerView> answer = wire::parse_answer(unit, &reason);
  if (!answer) return "damaged: " + reason;
  const unsigned damaged = assembly_.damaged();
  switch (assembly_.add(*answer, std::move(owner))) {
    case Assembly::Verdict::kOtherRequest: return "of another request";
    case Assembly::Verdict::kOtherRig: return "of another rig";
    case Assembly::Verdict::kBadFragment:
      return "is there already, or does not fit the view or the parts before: some of it was left out";
    default: break;
  }
  answered_.insert(answer->cameras);
  return assembly_.damaged() > damaged ? "damaged: some of it was left out" : "";
}

bool ViewComposer::is_complete() const {
  if (!current_) return false;
  CameraSet all(rig_->cameras.size());
  std::iota(all.begin(), all.end(), 0);
  CameraRanges awaited(all);
  awaited.remove(CameraRanges(current_->out_of_service));
  const size_t units = static_cast<size_t>(!current_->trials.empty()) + current_->gains.ask;  // of each node's moments
  return assembly_.cameras().contains(awaited) && tried_.size() >= units * answered_.size();
}

lightfield::Image ViewComposer::finish() {
  if (!current_) throw Error("no picture was begun");
  assembly_.finish(PixelFamily::kRgb, background_ != Background{});
  missing_ = assembly_.missing();
  lightfield::Image picture = from_image(assembly_.picture().resolve(background_));
  if (focus_.settings().mode != FocusMode::kPlane) {
    if (!array_) array_.emplace(*rig_);
    answers_.complete = missing_ == 0 && assembly_.damaged() == 0;
    focus_.take(*current_, answers_, *array_);
  }
  assembly_.release();
  current_.reset();
  return picture;
}

void ViewComposer::reset_focus() { focus_ = ViewFocus(focus_.settings(), focus_.matches_gains()); }

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

Compositor::Added Compositor::add(const Bytes& part) { return state_->composer.add(part); }

bool Compositor::is_complete() const { return state_->composer.is_complete(); }

Image Compositor::finish() { return state_->composer.finish(); }

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
  lf::ByteBuffer memory;  // of the latest answer

  std::vector<uint32_t> cameras(const View& view) {
    lf::ViewRequest request;
    request.view = lf::api::to_view(view);
    return node.plan(request).cameras();
  }
  // Those without an image, if the view needs one of them: for the others nobody has to have one.
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
  const auto answer = std::make_shared<lf::RenderedAnswer>(
      state_->node.answer(request, images, options.resampling, true, std::move(state_->memory), options.renderer));
  for (const lf::ByteBuffer* unit : {&answer->brightness, &answer->trials.unit, &answer->bytes})
    if (!unit->empty()) composer.add(*unit, answer);
  Image picture = composer.finish();
  state_->memory = std::move(answer->bytes);
  return picture;
}

Image Renderer::render(const View& view, const std::vector<Image>& images, const RenderOptions& options) {
  return render(view, std::vector<ImageView>(images.begin(), images.end()), options);
}

std::string Renderer::drawn_by() const { return state_->node.drawn_by(); }

void Renderer::reset_focus() { state_->composer.reset_focus(); }

}  // namespace lightfield
