// SPDX-License-Identifier: LGPL-2.1-or-later
#include "api/local_node.h"

#include <algorithm>
#include <mutex>
#include <numeric>
#include <string>
#include <thread>

#include <lightfield/node.h>

#include "api/convert.h"
#include "base/error.h"
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

RendererChoice to_renderer(lightfield::DrawnBy drawn_by) {
  switch (drawn_by) {
    case lightfield::DrawnBy::kCpu: return RendererChoice::kCpu;
    case lightfield::DrawnBy::kGl: return RendererChoice::kGl;
    case lightfield::DrawnBy::kAuto: return RendererChoice::kAuto;
  }
  throw Error("drawn_by: is none of the values that there are");
}

}  // namespace

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

std::unique_ptr<const AnswerTask> LocalNode::plan(const ViewRequest& request) {
  if (request.rig_hash != 0 && request.rig_hash != rig_hash_) throw Error("the request was made for another rig");
  return make_task(*rig_, mesh_.get(*rig_, request.out_of_service), request, own_);
}

AnswerMaker::Units LocalNode::answer(const ViewRequest& request, const std::vector<lightfield::ImageView>& frames,
                                     lightfield::Resampling resampling, bool in_process, ByteBuffer memory,
                                     lightfield::DrawnBy drawn_by) {
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
  renderer_ = to_renderer(drawn_by);
  AnswerMaker::Options options;
  options.resampling = to_resampling(resampling);
  options.in_process = in_process;
  options.colours = &colours_;
  // Where no JPEG is asked for the picture is as if all cameras were on one node.
  if (request.quality == 0) options.codec = CodecChoice::kRaw16;
  options.parallel = [this](size_t count, const std::function<void(size_t)>& task) {
    workers_->run(threads_, count, task);
  };
  const std::unique_ptr<const AnswerTask> task = plan(request);

  header.cameras = CameraRanges(own_);
  header.blind = CameraRanges(blind);
  std::vector<Source> sources;
  if (header.family != PixelFamily::kNone)
    for (const CameraIndex camera : task->cameras()) {
      const auto place = static_cast<size_t>(std::ranges::lower_bound(own_, camera) - own_.begin());
      sources.push_back({camera, &rig_->cameras[camera], images[place]});
    }
  std::string news;  // is in drawn_by(), too
  options.card = card_.open(renderer_, news);
  options.trial_card = card_.open_for_trials(renderer_);
  const AnswerMaker::Work work{task.get(), std::move(header)};
  AnswerMaker::Units units =
      std::move(maker_.make({&work, 1}, sources, options, scratch_, [&] { return std::move(memory); }).front());
  card_.rendered(renderer_, units.answer);
  card_.tried(renderer_, units.tried);
  return units;
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
  return state_->node.plan(decoded)->cameras();
}

std::vector<Bytes> Node::answer(const Bytes& request, const std::vector<ImageView>& frames) const {
  const lf::ViewRequest decoded = decode(request);
  const std::lock_guard lock(state_->mutex);
  const lf::AnswerMaker::Units units = state_->node.answer(decoded, frames, state_->resampling, false);
  std::vector<Bytes> parts;
  for (const lf::ByteBuffer* unit : {&units.brightness, &units.tried.unit, &units.answer.bytes})
    if (!unit->empty()) parts.emplace_back(unit->begin(), unit->end());
  return parts;
}

std::vector<Bytes> Node::answer(const Bytes& request, const std::vector<Image>& frames) const {
  return answer(request, std::vector<ImageView>(frames.begin(), frames.end()));
}

}  // namespace lightfield
