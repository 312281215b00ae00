// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/node.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <optional>

#include "base/schedule.h"
#include "base/text.h"
#include "focus/warp_depth_map.h"
#include "node/frame_sources.h"
#include "render/gl/gles_renderer.h"
#include "wire/answer_codec.h"

namespace lf {

void NodeStats::add(const Stages& stages) {
  std::lock_guard lock(mutex_);
  latest_ = stages;
  wait_.add(stages.wait);
  decode_.add(stages.decode);
  render_.add(stages.render);
  encode_.add(stages.encode);
  total_.add(stages.wait + stages.decode + stages.render + stages.encode);
}

void NodeStats::set_gains(std::span<const Source> cameras, const ExposureCompensation& gains) {
  std::lock_guard lock(mutex_);
  for (const Source& source : cameras) gains_[source.rig_camera->id] = gains.of(source.camera);
}

std::vector<std::pair<std::string, uint64_t>> NodeStats::all() const {
  std::lock_guard lock(mutex_);
  std::vector<std::pair<std::string, uint64_t>> all = {
      {"requests", requests},
      {"bad-requests", bad_requests},
      {"rig-mismatches", rig_mismatches},
      {"answers", answers},
      {"drawn", drawn},
      {"together", together},
      {"gpu-frames", gpu_frames},
      {"skipped", skipped},
      {"superseded", superseded},
      {"fragments", fragments},
      {"bytes", bytes},
      {"missing-frames", missing_frames},
      {"stale-frames", stale_frames},
      {"damaged-frames", damaged_frames},
      {"max-skew-ns", max_skew_ns},
      {"wait-ns", latest_.wait},
      {"decode-ns", latest_.decode},
      {"render-ns", latest_.render},
      {"encode-ns", latest_.encode},
  };
  const std::pair<const char*, const Percentiles*> stages[] = {
      {"wait", &wait_}, {"decode", &decode_}, {"render", &render_}, {"encode", &encode_}, {"answer", &total_}};
  for (const auto& [name, times] : stages)
    for (const int p : {50, 95, 99}) all.emplace_back(std::string(name) + "-ns-p" + std::to_string(p), times->at(p));
  return all;
}

std::map<uint32_t, float> NodeStats::gains() const {
  std::lock_guard lock(mutex_);
  return gains_;
}

namespace {

Node::Reply empty_reply(const wire::AnswerHeader& header, std::string warning = "") {
  Node::Reply reply;
  reply.answer.bytes = wire::AnswerWriter(header, 0).finish();
  reply.warning = std::move(warning);
  return reply;
}

std::string milliseconds(uint64_t ns) { return std::to_string(ns / 1'000'000) + " ms"; }

}  // namespace

std::string Node::skew_warning(const Rig& rig, const std::optional<SkewMonitor::Report>& report,
                               ClientState& client) const {
  if (!report) return "";
  const bool is_behind = report->is_late && report->behind > report->period;
  if (is_behind) {
    // Minimum time between two warnings about late frames. On an overloaded machine, cameras alternate between late and
    // on time, and would cause many warnings.
    constexpr uint64_t kQuiet = 10'000'000'000;
    const uint64_t now = now_ns();
    if (client.warned_behind != 0 && now - client.warned_behind < kQuiet) return "";
    client.warned_behind = now;
  }
  std::vector<uint32_t> ids;
  for (const CameraIndex camera : report->cameras) ids.push_back(rig.cameras[camera].id);
  return "node " + std::to_string(node_id_) + " is off the requested capture time by " + milliseconds(report->skew) +
         ", more than a frame (" + milliseconds(report->period) + "): the frames of camera " + list_of_ids(ids) +
         " are too " +
         (is_behind ? "old: frames arrive " + milliseconds(report->behind) +
                          " later than usual, because this machine or the network is too slow"
          : report->is_late
              ? "old: check that the camera is running, that capture-delay is long enough, and that the clocks of all "
                "machines are synchronized"
              : "new: check that the clocks of all machines are synchronized, and that capture-delay is not longer "
                "than the history of a camera (10 s or 400 MB)");
}

void Node::cancel(ClientState& client, bool cancelled) {
  *client.cancelled = cancelled;
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

std::vector<Node::Reply> Node::answer(std::span<const wire::AnyRequest* const> requests, ClientState& client,
                                      const Options& options, const AllocateMemory& memory) {
  stats_.requests += requests.size();
  const RequestHeader& first = wire::head_of(*requests.front());
  const uint64_t arrived = now_ns();
  const auto array = options.live ? inputs_.array() : inputs_.wait_for_all(*client.cancelled);
  const uint64_t waited = now_ns() - arrived;
  std::vector<wire::AnswerHeader> headers;
  for (const wire::AnyRequest* request : requests) headers.push_back(header_of(*request, *array));
  if (client.rig != array->rig) {
    client.rig = array->rig;
    client.mesh.clear();
    client.watch = {};
    client.renderer.clear();
    client.tracked.reset();
    client.gone.clear();
    client.warned_of = 0;
  }
  std::string warning;
  if (first.rig_hash != 0 && first.rig_hash != array->rig_hash) {
    stats_.rig_mismatches += requests.size();
    if (client.warned_of != first.rig_hash)
      warning =
          "a request was made for another rig than this node has, so the answer has no picture; load the same rig on "
          "both sides";
    client.warned_of = first.rig_hash;
  } else {
    try {
      return render(requests, *array, client, options, headers, memory, waited);
    } catch (const Error& error) {
      warning = error.what();
      stats_.bad_requests += requests.size();
    }
  }
  std::vector<Reply> replies;
  for (const wire::AnswerHeader& header : headers) replies.push_back(empty_reply(header, std::exchange(warning, "")));
  return replies;
}

bool Node::can_batch_requests(const wire::AnyRequest& a, const wire::AnyRequest& b) {
  const auto *one = std::get_if<ViewRequest>(&a), *other = std::get_if<ViewRequest>(&b);
  const auto has_same_renderer = [](const ViewRequest* request) {
    return request && request->place.count() > 1 && !request->gains.ask && request->gains.mean.empty();
  };
  return has_same_renderer(one) && has_same_renderer(other) && one->view_id == other->view_id &&
         one->target_time == other->target_time && one->target_time != kNoTime &&
         one->absolute_time == other->absolute_time && one->rig_hash == other->rig_hash &&
         one->out_of_service == other->out_of_service && one->gains.use == other->gains.use;
}

// Returns true if each of `count` cameras is in one of the sets, which are ascending.
static bool has_all(const std::vector<CameraIndex>& own, const CameraSet& out_of_service, size_t count) {
  for (CameraIndex camera = 0; camera < count; camera++)
    if (!std::ranges::binary_search(own, camera) && !std::ranges::binary_search(out_of_service, camera)) return false;
  return true;
}

// Plans one view. If a live camera delivers no frames, the compositor takes it out of service after a few pictures. For
// files, this would make the pictures depend on timing. Therefore a node that has all cameras of the array leaves
// cameras without a frame out of the mesh at once, so that their neighbours close the gap (see mesh_exclusions()).
Node::Planned Node::make_plan(const ViewRequest& view, const Array& array, ClientState& client,
                              const std::vector<CameraIndex>& own, const ParallelFor& parallel, FrameLookup& frames) {
  ViewRequest request = view;
  const CameraRanges named(view.out_of_service);
  CameraRanges gone;
  // A camera without a frame for the previous request probably has none now.
  CameraSet missing;
  std::ranges::copy_if(client.gone, std::back_inserter(missing), [&](CameraIndex camera) {
    return std::ranges::binary_search(own, camera) && !frames.find(camera);
  });
  Planned planned;
  do {
    if (!missing.empty()) {
      gone.add(CameraRanges(missing));
      CameraRanges out(mesh_exclusions(gone.cameras(), hull_cameras(*array.rig), array.rig->cameras.size()));
      out.add(named);
      request.out_of_service = out.cameras();
    }
    const uint64_t begun = now_ns();
    const Mesh& mesh = client.mesh.get(*array.rig, request.out_of_service);
    planned.plan = std::make_unique<const RequestPlan>(*array.rig, mesh, request, own, parallel);
    planned.ns += now_ns() - begun;
    missing.clear();
    for (const CameraIndex camera : planned.plan->cameras())
      if (!frames.find(camera) && !gone.contains(camera)) missing.push_back(camera);
  } while (!missing.empty() && !*client.cancelled);  // a cancelled client gets no frames
  planned.gone = gone.cameras();
  client.gone = planned.gone;
  return planned;
}

std::vector<Node::Planned> Node::make_plans(std::span<const wire::AnyRequest* const> requests, const Array& array,
                                            ClientState& client, const std::vector<CameraIndex>& own, bool live,
                                            const ParallelFor& parallel, FrameLookup& frames) {
  std::vector<Planned> plans(requests.size());
  const auto* const first = std::get_if<ViewRequest>(requests.front());
  if (!live && first && has_all(own, first->out_of_service, array.rig->cameras.size())) {
    for (size_t i = 0; i < plans.size(); i++)
      plans[i] = make_plan(std::get<ViewRequest>(*requests[i]), array, client, own, parallel, frames);
    return plans;
  }
  const uint64_t begun = now_ns();
  // Views with distortion or with other blending than by mesh are planned in parallel tasks, so that other views need
  // not wait for the whole plan. Other plans are short, so each is one task.
  const bool takes_long = std::ranges::any_of(requests, [](const wire::AnyRequest* request) {
    const auto* const view = std::get_if<ViewRequest>(request);
    return !view || view->view.lens.has_distortion() || !view->view.blending.is_mesh();
  });
  if (plans.size() == 1 || takes_long) {
    for (size_t i = 0; i < plans.size(); i++)
      plans[i].plan = plan_request(*array.rig, client.mesh, *requests[i], own, parallel);
  } else {
    const Mesh& mesh = client.mesh.get(*array.rig, first->out_of_service);
    parallel(plans.size(), [&](size_t i) {
      plans[i].plan = std::make_unique<const RequestPlan>(*array.rig, mesh, std::get<ViewRequest>(*requests[i]), own);
    });
  }
  for (Planned& planned : plans) planned.ns = (now_ns() - begun) / plans.size();
  return plans;
}

std::vector<CameraIndex> Node::cameras_of(const std::vector<Planned>& plans) {
  std::vector<CameraIndex> cameras;
  for (const Planned& planned : plans)
    cameras.insert(cameras.end(), planned.plan->cameras().begin(), planned.plan->cameras().end());
  std::ranges::sort(cameras);
  cameras.erase(std::unique(cameras.begin(), cameras.end()), cameras.end());
  return cameras;
}

FrameSources Node::sources_of(const std::vector<Planned>& plans, const Array& array, const RenderOptions& options,
                              FrameLookup& frames) {
  const auto region_of = [&plans](CameraIndex camera) {
    Rect region;
    for (const auto& [plan, gone, ns] : plans)
      if (plan->has(camera)) region = unite(region, plan->region(camera));
    return region;
  };
  // Pixels that are sent unwarped must be in CPU memory.
  const bool may_be_on_gpu =
      options.gpu && std::ranges::all_of(plans, [](const Planned& planned) { return planned.plan->sum() != nullptr; });
  FrameSources sources(*array.rig, region_of, may_be_on_gpu ? options.gpu->group() : 0);
  for (const CameraIndex camera : cameras_of(plans)) sources.add(camera, frames.find(camera));
  return sources;
}

void Node::decode(FrameSources& sources, const Array& array, PixelFamily family, const ParallelFor& parallel) {
  sources.decode(
      family,
      [&](CameraIndex camera, const CameraFrame& damaged) {
        bool first = false;
        auto before = array.cameras.at(camera)->replace_damaged(damaged.picture.get(), &first);
        if (first) stats_.damaged_frames++;
        if (before && !before->fits(array.rig->cameras[camera])) before.reset();
        return before;
      },
      parallel);
}

// Fills in the answer header for one request. `absent` are live cameras without a frame. Returns the largest
// capture-time error in nanoseconds.
uint64_t Node::describe(const Planned& planned, const FrameSources& sources, const FrameLookup& frames,
                        const std::vector<CameraIndex>& own, const CameraSet& absent, wire::AnswerHeader& header) {
  const RequestPlan& plan = *planned.plan;
  CameraSet blind = planned.gone;
  std::ranges::copy_if(absent, std::back_inserter(blind), [&](CameraIndex camera) { return !plan.has(camera); });
  for (const CameraIndex camera : planned.gone)
    if (!plan.has(camera)) stats_.missing_frames++;  // cameras of the plan are counted below
  uint64_t worst_skew = 0;
  for (size_t i = 0; i < sources.sources().size(); i++) {
    const Source& source = sources.sources()[i];
    if (!plan.has(source.camera)) continue;
    if (source.image.family == PixelFamily::kNone) {
      stats_.missing_frames++;
      blind.push_back(source.camera);
      continue;
    }
    const uint64_t skew = frames.skew_of(source.camera, sources.time(i));
    header.family = source.image.family;
    if (header.actual_time == kNoTime || skew > worst_skew) {
      worst_skew = skew;
      header.actual_time = frames.time_of(source.camera, sources.time(i));
    }
  }
  std::ranges::sort(blind);
  blind.erase(std::unique(blind.begin(), blind.end()), blind.end());
  header.cameras = CameraRanges(own);
  header.blind = CameraRanges(blind);
  return worst_skew;
}

// Adds the surface that the cameras have measured to the work for a request, if the request asks for it. Adds the
// depths of the cameras if the request shows or tests such a surface.
void Node::add_measured(const Array& array, bool live, FrameLookup& frames, ClientState& client,
                        const ParallelFor& parallel, RequestRenderer::Work& work) {
  std::optional<View> measured;
  if (const View* const view = work.plan->measured_view(); view && live) {
    measured = depths_.surface(client.tracked, *view, work.plan->by_part());
  } else if (view) {
    std::optional<DepthTracker::Measured> result = depths_.measure(
        array, *view, work.plan->by_part(), [&frames](CameraIndex camera) { return frames.find(camera); },
        *client.cancelled, parallel);
    if (result) measured = std::move(result->view);
    if (result) work.depths = std::move(result->depths);
  }
  const auto is_measured = [](const RenderJob* job) {
    return job && job->plan().view().focus.map && job->plan().view().focus.map->measured;
  };
  if (!work.depths && (is_measured(work.plan->sum()) || is_measured(work.plan->hypothesis_job())))
    work.depths = depths_.depths();
  if (!measured) return;
  const View& view = *work.plan->measured_view();
  work.measured = warp_depth_map(*measured, view);
  double distance = std::numeric_limits<double>::infinity();
  for (const auto& [camera, frames] : array.cameras)
    distance = std::min(distance, glm::distance(array.rig->cameras[camera].pose.position, view.pose.position));
  if (array.extent > 0) work.measured_weight = static_cast<float>(array.extent / (array.extent + distance));
}

std::vector<Node::Reply> Node::render(std::span<const wire::AnyRequest* const> requests, const Array& array,
                                      ClientState& client, const Options& options,
                                      std::span<const wire::AnswerHeader> headers, const AllocateMemory& memory,
                                      uint64_t waited) {
  const uint64_t begun = now_ns();
  FrameLookup frames(array, wire::head_of(*requests.front()),
                     {options.live, options.base_time, options.wall_offset, options.max_skew, client.cancelled.get()});
  std::vector<CameraIndex> own;
  for (const auto& [camera, of_camera] : array.cameras) own.push_back(camera);
  const bool live =
      options.live || std::ranges::any_of(array.cameras, [](const auto& camera) { return camera.second->is_live(); });
  const ParallelFor& parallel = options.render.parallel;
  const std::vector<Planned> plans = make_plans(requests, array, client, own, live, parallel, frames);
  FrameSources sources = sources_of(plans, array, options.render, frames);
  // The compositor must know the state of all cameras before it uses them, so cameras outside this view are checked as
  // well.
  CameraSet absent;
  for (const CameraIndex camera : own)
    if ((options.live || array.cameras.at(camera)->is_live()) && !frames.find(camera)) absent.push_back(camera);
  stats_.stale_frames += frames.stale() * requests.size();
  const uint64_t found = now_ns();
  const PixelFamily family = inputs_.choose_family();  // includes cameras outside the view
  decode(sources, array, family, parallel);
  const uint64_t decoded = now_ns();

  std::vector<RequestRenderer::Work> works;
  uint64_t worst_skew = 0, plan_ns = 0;
  for (size_t i = 0; i < plans.size(); i++) {
    RequestRenderer::Work& work = works.emplace_back(RequestRenderer::Work{plans[i].plan.get(), headers[i]});
    // The answer states the family of the node's images even if the view shows no image.
    work.header.family = family;
    work.has_images = std::ranges::any_of(sources.sources(), [&](const Source& source) {
      return source.image.family != PixelFamily::kNone && work.plan->has(source.camera);
    });
    add_measured(array, live, frames, client, parallel, work);
    worst_skew = std::max(worst_skew, describe(plans[i], sources, frames, own, absent, work.header));
    plan_ns += plans[i].ns;
  }
  RenderOptions how = options.render;
  how.colours = array.colours.get();
  ImageMemory scratch = client.images->take();
  std::vector<RenderedAnswer> answers = client.renderer.render(works, sources.sources(), how, scratch, memory);
  client.images->give_back(std::move(scratch));
  if (std::ranges::any_of(answers, [](const RenderedAnswer& answer) { return answer.drawing.drawn; }))
    stats_.gpu_frames += sources.on_gpu();
  if (answers.front().gains) stats_.set_gains(sources.sources(), *answers.front().gains);
  std::vector<Reply> replies;
  const uint64_t count = answers.size();
  for (size_t i = 0; i < answers.size(); i++) {
    RenderedAnswer& answer = answers[i];
    const NodeStats::Stages stages{.wait = (waited + (found - begun - plan_ns)) / count,
                                   .decode = (decoded - found) / count,
                                   .render = plans[i].ns + answer.prepare_ns + answer.render_ns,
                                   .encode = answer.encode_ns};
    stats_.add(stages);
    if (answer.drawing.drawn) stats_.drawn++;
    replies.push_back({std::move(answer), stages, ""});
  }
  if (worst_skew > stats_.max_skew_ns) stats_.max_skew_ns = worst_skew;
  replies.front().warning = skew_warning(*array.rig, client.watch.see(frames.skews()), client);
  return replies;
}

std::shared_ptr<Node::ClientState> ClientStates::of(uint32_t view_id) {
  const std::lock_guard lock(mutex_);
  auto found = views_.find(view_id);
  if (found == views_.end()) {
    const auto used = [](const auto& view) { return view.second.used; };
    if (views_.size() >= 2 * kMaxViews) views_.erase(std::ranges::min_element(views_, {}, used));
    const auto client = std::make_shared<Node::ClientState>();
    client->cancelled = cancelled_;
    client->images = images_;
    const auto latest = std::ranges::max_element(views_, {}, used);
    if (latest != views_.end()) client->renderer.copy_gains_from(latest->second.client->renderer);
    found = views_.emplace(view_id, View{client}).first;
  }
  found->second.used = ++uses_;
  return found->second.client;
}

uint64_t ClientStates::nanoseconds(uint32_t view_id, double work) const {
  const std::lock_guard lock(mutex_);
  const auto found = views_.find(view_id);
  return found == views_.end() ? 0 : found->second.client->estimate.nanoseconds(work);
}

void ClientStates::clear() {
  const std::lock_guard lock(mutex_);
  views_.clear();
}

}  // namespace lf
