// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/node.h"

#include <algorithm>
#include <iterator>

#include "base/error.h"
#include "base/schedule.h"
#include "node/camera_access.h"
#include "wire/answer_writer.h"

namespace lf {
namespace {

// Live cameras' frames have clock time, those of others running time, and a request may ask in either.
uint64_t convert_time(uint64_t time, bool from_clock, bool to_clock, uint64_t base_time) {
  if (time == kNoTime || from_clock == to_clock) return time;
  return to_clock ? time + base_time : time - std::min(time, base_time);
}

uint64_t wanted_of(const RequestHeader& request, const CameraFrames& frames, uint64_t base_time) {
  return convert_time(request.target_time, request.absolute_time, frames.is_live(), base_time);
}

uint64_t time_of(const RequestHeader& request, const CameraFrames& frames, uint64_t time, uint64_t base_time) {
  return convert_time(time, frames.is_live(), request.absolute_time, base_time);
}

// An answer without fragments.
Node::Reply empty_reply(const wire::AnswerHeader& header, std::string warning = "") {
  Node::Reply reply;
  reply.answer.bytes = wire::AnswerWriter(header, 0).finish();
  reply.warning = std::move(warning);
  return reply;
}

std::string milliseconds(uint64_t ns) { return std::to_string(ns / 1'000'000) + " ms"; }

}  // namespace

std::string Node::skew_warning(const Rig& rig, const std::optional<SkewWatch::Report>& report,
                               Requester& requester) const {
  if (!report) return "";
  const bool is_behind = report->is_late && report->behind > report->period;
  if (is_behind) {
    // Where there is too much to do, cameras come to be late and are on time again all the while.
    constexpr uint64_t kQuiet = 10'000'000'000;
    const uint64_t now = now_ns();
    if (requester.warned_behind != 0 && now - requester.warned_behind < kQuiet) return "";
    requester.warned_behind = now;
  }
  std::vector<uint32_t> ids;
  for (const CameraIndex camera : report->cameras) ids.push_back(rig.cameras[camera].id);
  return "node " + std::to_string(node_id_) + " is off the capture time asked for by " + milliseconds(report->skew) +
         ", more than a frame (" + milliseconds(report->period) + "): the frames of camera " + list_of_ids(ids) +
         " are too " +
         (is_behind ? "old: they come " + milliseconds(report->behind) +
                          " later than they can: this machine, or the network, can't keep up with them"
          : report->is_late
              ? "old: is the camera running, capture-delay long enough for frames to arrive, and the clock "
                "that of all machines?"
              : "new: is the clock that of all machines?");
}

void Node::cancel(Requester& requester, bool cancelled) {
  *requester.cancelled = cancelled;
  inputs_.wake();
}

wire::AnswerHeader Node::header_of(const wire::AnyRequest& request, const Array& array) const {
  wire::AnswerHeader header = wire::answer_to(wire::head_of(request), wire::view_size(request), array.rig_hash);
  header.node = node_id_;
  return header;
}

Node::Reply Node::skip(const wire::AnyRequest& request) {
  stats_.requests++;
  stats_.skipped++;
  return empty_reply(header_of(request, *inputs_.array()));
}

Node::Reply Node::answer(const wire::AnyRequest& any, Requester& requester, const Options& options, ByteBuffer memory) {
  stats_.requests++;
  const RequestHeader& request = wire::head_of(any);
  const uint64_t arrived = now_ns();
  const auto array = options.live ? inputs_.array() : inputs_.wait_for_all(*requester.cancelled);
  const uint64_t waited = now_ns() - arrived;
  const wire::AnswerHeader header = header_of(any, *array);
  if (requester.rig != array->rig) {
    requester.rig = array->rig;
    requester.mesh.clear();
    requester.watch = {};
    requester.maker.clear();
    requester.gone.clear();
    requester.warned_of = 0;
  }
  std::string warning;
  if (request.rig_hash != 0 && request.rig_hash != header.rig_hash) {
    stats_.rig_mismatches++;
    if (requester.warned_of != request.rig_hash)
      warning = "a request was made for another rig than the one of this node: not answered with a picture";
    requester.warned_of = request.rig_hash;
  } else {
    try {
      return render(any, *array, requester, options, header, std::move(memory), waited);
    } catch (const Error& error) {
      warning = error.what();
      stats_.bad_requests++;
    }
  }
  return empty_reply(header, std::move(warning));
}

// Whether each of `count` cameras is among the node's or out of service; both ascend.
static bool has_all(const std::vector<CameraIndex>& own, const CameraSet& out_of_service, size_t count) {
  for (CameraIndex camera = 0; camera < count; camera++)
    if (!std::ranges::binary_search(own, camera) && !std::ranges::binary_search(out_of_service, camera)) return false;
  return true;
}

Node::Plan Node::make_plan(const wire::AnyRequest& any, const Array& array, Requester& requester,
                           const std::vector<CameraIndex>& own, bool live, const FindFrame& find) {
  Plan plan;
  const auto make = [&](const wire::AnyRequest& request) {
    const uint64_t begun = now_ns();
    plan.task = make_task(*array.rig, requester.mesh, request, own);
    plan.ns += now_ns() - begun;
    plan.frames.clear();
    for (const CameraIndex camera : plan.task->cameras()) plan.frames.push_back(find(camera));
  };
  const auto* const view = std::get_if<ViewRequest>(&any);
  if (live || !view || !has_all(own, view->out_of_service, array.rig->cameras.size())) {
    make(any);
    return plan;
  }
  ViewRequest request = *view;
  const CameraRanges named(view->out_of_service);
  CameraRanges gone;
  // Those that had none for the request before are likely to have none again.
  CameraSet missing;
  std::ranges::copy_if(requester.gone, std::back_inserter(missing),
                       [&](CameraIndex camera) { return std::ranges::binary_search(own, camera) && !find(camera); });
  do {
    if (!missing.empty()) {
      gone.add(CameraRanges(missing));
      CameraRanges out(out_of_mesh(gone.cameras(), corner_cameras(*array.rig), array.rig->cameras.size()));
      out.add(named);
      request.out_of_service = out.cameras();
    }
    make(request);
    missing.clear();
    for (size_t i = 0; i < plan.frames.size(); i++)
      if (const CameraIndex camera = plan.task->cameras()[i]; !plan.frames[i] && !gone.contains(camera))
        missing.push_back(camera);
  } while (!missing.empty() && !*requester.cancelled);  // who is stopped gets no frames from anybody
  plan.gone = gone.cameras();
  requester.gone = plan.gone;
  return plan;
}

Node::Reply Node::render(const wire::AnyRequest& any, const Array& array, Requester& requester, const Options& options,
                         wire::AnswerHeader header, ByteBuffer memory, uint64_t waited) {
  const RequestHeader& request = wire::head_of(any);
  const uint64_t begun = now_ns();
  std::vector<CameraIndex> own;
  for (const auto& [camera, frames] : array.cameras) {
    own.push_back(camera);
    frames->advance(wanted_of(request, *frames, options.base_time));
  }
  std::vector<SkewWatch::Frame> skews;
  // Nothing if the camera has none, or none of about the time asked for, or of another size than the rig has it since
  // that was replaced.
  const auto find = [&](CameraIndex camera) {
    CameraFrames& frames = *array.cameras.at(camera);
    const uint64_t wanted = wanted_of(request, frames, options.base_time);
    std::optional<CameraFrame> frame = frames.find(wanted, !options.live, requester.cancelled.get());
    if (frame && !frame->fits(array.rig->cameras[camera])) frame.reset();
    if (!frame || wanted == kNoTime || !frames.is_live() || frames.has_ended()) return frame;
    skews.push_back({camera, frame->time, wanted, frames.mean_period(), frame->behind});
    if (options.max_skew > 0 && time_between(frame->time, wanted) > options.max_skew) {
      frame.reset();
      stats_.stale_frames++;
    }
    return frame;
  };
  const bool live =
      options.live || std::ranges::any_of(array.cameras, [](const auto& camera) { return camera.second->is_live(); });
  Plan plan = make_plan(any, array, requester, own, live, find);
  const std::unique_ptr<const AnswerTask>& task = plan.task;
  FrameSources sources(*array.rig, [&task](CameraIndex camera) { return task->region(camera); });
  for (size_t i = 0; i < plan.frames.size(); i++) sources.add(task->cameras()[i], std::move(plan.frames[i]));
  CameraSet blind = plan.gone;
  stats_.missing_frames += static_cast<uint64_t>(std::ranges::count_if(blind, [&](CameraIndex camera) {
    return !std::ranges::binary_search(task->cameras(), camera);  // the others are counted below
  }));
  // The others are looked at, too: what is out of service or out of sight must be known to be well before it is used.
  for (const CameraIndex camera : own)
    if ((options.live || array.cameras.at(camera)->is_live()) && !std::ranges::binary_search(task->cameras(), camera) &&
        !find(camera))
      blind.push_back(camera);
  const uint64_t found = now_ns();
  // Of whatever has a frame the family is known.
  const PixelFamily family = inputs_.choose_family();
  sources.decode(
      family,
      [&](CameraIndex camera, const CameraFrame& damaged) {
        bool first = false;
        auto before = array.cameras.at(camera)->replace_damaged(damaged.picture.get(), &first);
        if (first) stats_.damaged_frames++;
        if (before && !before->fits(array.rig->cameras[camera])) before.reset();
        return before;
      },
      options.parallel);
  const uint64_t decoded = now_ns();

  uint64_t worst_skew = 0;
  for (size_t i = 0; i < sources.sources().size(); i++) {
    if (sources.sources()[i].image.family == PixelFamily::kNone) {
      stats_.missing_frames++;
      blind.push_back(sources.sources()[i].camera);
      continue;
    }
    const CameraFrames& frames = *array.cameras.at(sources.sources()[i].camera);
    const uint64_t wanted = wanted_of(request, frames, options.base_time);
    const uint64_t skew = wanted == kNoTime ? 0 : time_between(sources.time(i), wanted);
    if (header.actual_time == kNoTime || skew > worst_skew) {
      worst_skew = skew;
      header.actual_time = time_of(request, frames, sources.time(i), options.base_time);
    }
  }
  std::ranges::sort(blind);
  blind.erase(std::ranges::unique(blind).begin(), blind.end());
  header.cameras = CameraRanges(own);
  header.blind = CameraRanges(blind);
  header.family = sources.family();
  // Without an image in the view the answer still says what the node's images are.
  const bool nothing = header.family == PixelFamily::kNone;
  if (nothing) header.family = family;

  std::span<const Source> images;
  if (!nothing) images = sources.sources();
  AnswerMaker::Options how = options;
  how.colours = array.colours.get();
  ImageMemory scratch = requester.images->take();
  Reply reply{requester.maker.make(*task, header, images, how, scratch, std::move(memory)), {}, {}};
  requester.images->give_back(std::move(scratch));
  if (reply.gains) stats_.set_gains(images, *reply.gains);
  reply.stages = {.wait = waited + (found - begun - plan.ns),
                  .decode = decoded - found,
                  .render = plan.ns + reply.before_ns + reply.answer.render_ns,
                  .encode = reply.answer.encode_ns};
  stats_.add(reply.stages);
  if (reply.answer.drawing.drawn) stats_.drawn++;
  if (worst_skew > stats_.max_skew_ns) stats_.max_skew_ns = worst_skew;
  reply.warning = skew_warning(*array.rig, requester.watch.see(skews), requester);
  return reply;
}

}  // namespace lf
