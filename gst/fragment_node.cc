// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment_node.h"

#include <chrono>

#include "base/error.h"
#include "node/answer_renderer.h"
#include "wire/answer_writer.h"

namespace lf {
namespace {

uint64_t now_ns() {
  return static_cast<uint64_t>(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
          .count());
}

}  // namespace

void FragmentNode::set_rig(std::shared_ptr<const Rig> rig) {
  rig_ = std::move(rig);
  rig_hash_ = rig_ ? rig_->hash() : 0;
}

void FragmentNode::expect_input(std::shared_ptr<CameraFrames> frames) {
  std::lock_guard lock(mutex_);
  expected_.insert(std::move(frames));
}

bool FragmentNode::add_camera(CameraIndex camera, std::shared_ptr<CameraFrames> frames) {
  std::lock_guard lock(mutex_);
  expected_.erase(frames);
  inputs_changed_.notify_all();
  return cameras_.try_emplace(camera, frames).first->second == frames;
}

void FragmentNode::give_up(const std::shared_ptr<CameraFrames>& frames) {
  std::lock_guard lock(mutex_);
  expected_.erase(frames);
  std::erase_if(cameras_, [&frames](const auto& entry) { return entry.second == frames; });
  inputs_changed_.notify_all();
}

void FragmentNode::set_running(bool running) {
  std::lock_guard lock(mutex_);
  running_ = running;
  inputs_changed_.notify_all();
}

PixelFamily FragmentNode::agree_on_family(PixelFamily offered) {
  std::lock_guard lock(mutex_);
  if (family_ == PixelFamily::kNone) family_ = offered;
  return family_;
}

void FragmentNode::forget_family() {
  std::lock_guard lock(mutex_);
  family_ = PixelFamily::kNone;
}

FragmentNode::Cameras FragmentNode::cameras(bool wait_for_all) {
  std::unique_lock lock(mutex_);
  if (wait_for_all) inputs_changed_.wait(lock, [this] { return !running_ || expected_.empty(); });
  return cameras_;
}

FragmentNode::Reply FragmentNode::answer(const ViewRequest& request, Requester& requester, const Manner& manner,
                                         ByteBuffer memory) {
  stats_.requests++;
  wire::AnswerHeader header;
  header.view_id = request.view_id;
  header.sequence = request.sequence;
  header.view_width = request.view.width;
  header.view_height = request.view.height;
  header.target_time = request.target_time;
  header.rig_hash = rig_hash_;
  header.node = node_id_;
  std::string warning;
  if (request.rig_hash != 0 && request.rig_hash != header.rig_hash) {
    stats_.rig_mismatches++;
    warning = "a request was made for another rig than the one of this node: not answered with a picture";
  } else {
    try {
      return render(request, requester, manner, header, std::move(memory));
    } catch (const Error& error) {
      warning = error.what();
      stats_.bad_requests++;
    }
  }
  return {.bytes = wire::AnswerWriter(header, 0).finish(), .warning = std::move(warning)};
}

FragmentNode::Reply FragmentNode::render(const ViewRequest& request, Requester& requester, const Manner& manner,
                                         wire::AnswerHeader header, ByteBuffer memory) {
  // Frame times are running times; the request's may be clock time.
  const bool newest = request.target_time == kNoTime;
  const uint64_t to_running = request.absolute_time ? manner.base_time : 0;
  const uint64_t wanted = newest ? kNoTime : request.target_time - std::min(request.target_time, to_running);

  const uint64_t arrived = now_ns();
  const Cameras inputs = cameras(!manner.live);
  const uint64_t begun = now_ns();
  std::vector<CameraIndex> own;
  for (const auto& [camera, frames] : inputs) {
    own.push_back(camera);
    frames->advance(wanted);
  }
  const RenderJob job(*rig_, requester.mesh.get(*rig_, request.out_of_service), request.view, own);
  const uint64_t planned = now_ns();
  FrameSources sources(*rig_, job);
  for (const CameraIndex camera : job.cameras()) sources.add(camera, inputs.at(camera)->find(wanted, !manner.live));
  const uint64_t found = now_ns();
  sources.decode(
      agree_on_family(PixelFamily::kNone),
      [&](CameraIndex camera, const CameraFrame& damaged) {
        bool first = false;
        auto before = inputs.at(camera)->replace_damaged(damaged.jpeg, &first);
        if (first) stats_.damaged_frames++;
        return before;
      },
      manner.parallel);
  const uint64_t decoded = now_ns();

  uint64_t worst_skew = 0;
  CameraSet blind;
  for (size_t i = 0; i < sources.sources().size(); i++) {
    if (sources.sources()[i].image.family == PixelFamily::kNone) {
      stats_.missing_frames++;
      blind.push_back(sources.sources()[i].camera);
      continue;
    }
    const uint64_t skew = newest ? 0 : time_between(sources.time(i), wanted);
    if (header.actual_time == kNoTime || skew > worst_skew) {
      worst_skew = skew;
      header.actual_time = sources.time(i) + to_running;
    }
  }
  header.cameras = CameraRanges(own);
  header.blind = CameraRanges(blind);
  header.family = sources.family();
  // Without an image in the view the answer still says what the node's images are.
  const bool nothing = header.family == PixelFamily::kNone;
  if (nothing) header.family = agree_on_family(PixelFamily::kNone);

  const AnswerForm form = choose_form(job, manner.sum, manner.codec, manner.in_process, request.quality);
  RenderedAnswer rendered = render_answer(header, job, nothing ? std::span<const Source>() : sources.sources(), form,
                                          std::move(memory), manner.parallel);
  stats_.add({.wait = begun - arrived + (found - planned),
              .decode = decoded - found,
              .render = planned - begun + rendered.render_ns,
              .encode = rendered.encode_ns});
  if (worst_skew > stats_.max_skew_ns) stats_.max_skew_ns = worst_skew;
  return {.bytes = std::move(rendered.bytes), .fragments = rendered.fragments};
}

}  // namespace lf
