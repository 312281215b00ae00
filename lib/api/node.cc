// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/node.h>

#include <mutex>

#include "api/convert.h"
#include "api/local_node.h"
#include "wire/request_codec.h"

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
  for (const lf::ByteBuffer* unit : {&units.brightness, &units.moments, &units.answer.bytes})
    if (!unit->empty()) parts.emplace_back(unit->begin(), unit->end());
  return parts;
}

std::vector<Bytes> Node::answer(const Bytes& request, const std::vector<Image>& frames) const {
  return answer(request, std::vector<ImageView>(frames.begin(), frames.end()));
}

}  // namespace lightfield
