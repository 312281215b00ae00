// SPDX-License-Identifier: LGPL-2.1-or-later
#include "fragment_node.h"

#include <chrono>

#include "base/error.h"
#include "camera_image.h"

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

wire::Answer FragmentNode::answer(const ViewRequest& request, Requester& requester, uint64_t base_time,
                                  bool live_request, std::string& warning) {
  stats_.requests++;
  wire::Answer answer;
  answer.view_id = request.view_id;
  answer.sequence = request.sequence;
  answer.view_width = request.view.width;
  answer.view_height = request.view.height;
  answer.target_time = request.target_time;
  answer.rig_hash = rig_hash_;
  answer.node = node_id_;
  if (request.rig_hash != 0 && request.rig_hash != answer.rig_hash) {
    stats_.rig_mismatches++;
    warning = "a request was made for another rig than the one of this node: not answered with a picture";
    return answer;
  }

  // Frame times are running times; the request's may be clock time.
  const bool newest = request.target_time == kNoTime;
  const uint64_t to_running = request.absolute_time ? base_time : 0;
  const uint64_t wanted = newest ? kNoTime : request.target_time - std::min(request.target_time, to_running);

  try {
    const uint64_t begin = now_ns();
    const Cameras inputs = cameras(!live_request);
    std::vector<CameraIndex> own;
    for (const auto& [camera, frames] : inputs) {
      own.push_back(camera);
      frames->advance(wanted);
    }
    const RenderJob job(*rig_, requester.mesh.get(*rig_, request.out_of_service), request.view, own);
    const uint64_t planned = now_ns();
    std::vector<std::pair<CameraIndex, CameraFrame>> frames;
    for (const CameraIndex camera : job.cameras()) {
      std::optional<CameraFrame> frame = inputs.at(camera)->find(wanted, !live_request);
      if (frame)
        frames.emplace_back(camera, std::move(*frame));
      else
        stats_.missing_frames++;
    }
    const uint64_t found = now_ns();
    uint64_t worst_skew = 0;
    for (const auto& [camera, frame] : frames) {
      const MappedFrame image(frame);
      if (!image.ok()) continue;
      answer.family = image.view().family;
      const uint64_t skew = newest ? 0 : time_between(frame.time, wanted);
      if (answer.actual_time == kNoTime || skew > worst_skew) {
        worst_skew = skew;
        answer.actual_time = frame.time + to_running;
      }
      std::optional<Fragment> fragment =
          renderer_->render(job.plan(), job.owners(), camera, rig_->cameras[camera], image.view());
      if (fragment) answer.fragments.push_back(std::move(*fragment));
    }
    if (answer.family == PixelFamily::kNone) answer.family = agree_on_family(PixelFamily::kNone);
    stats_.wait_ns = found - planned;
    stats_.render_ns = now_ns() - found + (planned - begin);
    if (worst_skew > stats_.max_skew_ns) stats_.max_skew_ns = worst_skew;
  } catch (const Error& error) {
    warning = error.what();
    stats_.bad_requests++;
  }
  return answer;
}

}  // namespace lf
