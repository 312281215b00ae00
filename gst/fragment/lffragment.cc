// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lffragment
 * @title: lffragment
 * @short_description: the random access camera: renders the contribution of its cameras to requested views
 *
 * lffragment turns ordinary cameras into random access cameras, which deliver only the pixels that a view needs. It
 * takes the video of one or more cameras of a rig on its `sink_%u` pads and view requests on `request`. For each
 * request it sends one answer on `src`. Use it with your own camera elements; `lfcameranode` combines it with the
 * cameras of a rig.
 *
 * An answer contains the part of the view that these cameras contribute to: for each pixel, the weighted sum of their
 * images. `lfcompositor` adds the answers of all nodes, and so completes the picture. A request can also contain depth
 * hypotheses, which are guesses of the depths in the scene. A message with photo-consistency sums then precedes the
 * answer. These numbers show how well the cameras agree on each guess. Each further client requests a pad `request_%u`,
 * and receives its answers from the pad `src_%u` with the same number.
 *
 * ## Example launch line
 *
 * Shows the views of views.json, rendered from three cameras of rig.json:
 *
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lffragment name=n rig=rig.json ! c.sink_0  lfcamsrc rig=rig.json camera=0 ! n.sink_0 \
 *   lfcamsrc rig=rig.json camera=1 ! n.sink_1  lfcamsrc rig=rig.json camera=8 ! n.sink_2 \
 *   r. ! queue ! c.request  lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]|
 *
 * ## Frames and time
 *
 * JPEG video stays compressed until a request needs it, and then only the needed regions are decoded. Damaged frames
 * are dropped and counted, and the previous frame replaces them.
 *
 * lffragment does not wait for live cameras. It uses the frame nearest to the requested capture time, if the difference
 * is at most `max-skew`. A warning names each camera that is off by more than a frame time. For files and other cameras
 * that are not live, the element waits for the requested frame, so that the output is the same on every machine. Files
 * are read no faster than the requests advance, and follow the seeks of the requests.
 *
 * If QoS events from lfcompositor show that the picture of a request would be too late, the element saves the time for
 * rendering and sends an empty answer.
 *
 * ## Cameras without a rig
 *
 * The property `access` is for simple cameras that do not know the whole rig (section 4.2 of the paper). These cameras
 * cannot answer view requests. Instead, they answer the commands that `lfviewrequest access=` sends after each request.
 * A warp command gives the camera the transformation of its image into the view, and a pixel command names the image
 * region to deliver. lffragment then uses only the lenses of its cameras, or only their image sizes, from `rig`.
 *
 * ## Element messages
 *
 * With `post-messages`, the element posts a message "lightfield-answer" per answer. Its fields are view-id, sequence
 * (uint), pts (uint64), fragments (uint), bytes, and the durations wait-ns (waiting for frames), decode-ns, render-ns
 * and encode-ns (uint64).
 */

#include "fragment/lffragment.h"

#include <cstring>
#include <map>
#include <string>

#include "base/schedule.h"
#include "base/text.h"
#include "common/common.h"
#include "common/custom_events.h"
#include "common/wall_clock.h"
#include "fragment/camera_input.h"
#include "fragment/fragment_state.h"
#include "wire/request_codec.h"

GST_DEBUG_CATEGORY(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

using lf::Client;
using lf::PadPtr;
using Job = lf::AnswerJob;
using JobPtr = std::shared_ptr<Job>;
using Settings = lf::FragmentSettings;

namespace {

GstStaticPadTemplate sink_template = GST_STATIC_PAD_TEMPLATE(
    "sink_%u", GST_PAD_SINK, GST_PAD_REQUEST,
    GST_STATIC_CAPS(GST_VIDEO_CAPS_MAKE("{ " LF_CAMERA_FORMATS
                                        " }") "; image/jpeg; " LF_CARD_VIDEO_CAPS("{ " LF_CAMERA_FORMATS " }")));
GstStaticPadTemplate request_template =
    GST_STATIC_PAD_TEMPLATE("request", GST_PAD_SINK, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_REQUEST_CAPS));
GstStaticPadTemplate more_request_template =
    GST_STATIC_PAD_TEMPLATE("request_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS(LF_REQUEST_CAPS));
GstStaticPadTemplate src_template =
    GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS(LF_ANSWER_CAPS));
GstStaticPadTemplate more_src_template =
    GST_STATIC_PAD_TEMPLATE("src_%u", GST_PAD_SRC, GST_PAD_SOMETIMES, GST_STATIC_CAPS(LF_ANSWER_CAPS));

}  // namespace

// Makes the properties of camera pads available to gst-launch, for example `sink_0::camera=5`.
static GObject* lf_fragment_child_by_index(GstChildProxy* proxy, guint index) {
  std::vector<PadPtr> pads = lf_fragment_camera_pads(LF_FRAGMENT(proxy));
  return index < pads.size() ? G_OBJECT(pads[index].release()) : nullptr;
}

static guint lf_fragment_children_count(GstChildProxy* proxy) {
  return static_cast<guint>(lf_fragment_camera_pads(LF_FRAGMENT(proxy)).size());
}

static void lf_fragment_child_proxy_init(gpointer iface, gpointer) {
  GstChildProxyInterface* proxy = static_cast<GstChildProxyInterface*>(iface);
  proxy->get_child_by_index = lf::callback<lf_fragment_child_by_index>;
  proxy->get_children_count = lf::callback<lf_fragment_children_count>;
}

G_DEFINE_FINAL_TYPE_WITH_CODE(LfFragment, lf_fragment, GST_TYPE_ELEMENT,
                              G_IMPLEMENT_INTERFACE(GST_TYPE_CHILD_PROXY, lf_fragment_child_proxy_init))
GST_ELEMENT_REGISTER_DEFINE_WITH_CODE(lffragment, "lffragment", GST_RANK_NONE, LF_TYPE_FRAGMENT,
                                      GST_DEBUG_CATEGORY_INIT(lf_fragment_debug, "lffragment", 0,
                                                              "random access camera"))

// --- Properties ------------------------------------------------------------------------------------------------------

GType lf_fragment_codec_get_type(void) {
  static const GType type = lf::register_enum<lf::CodecChoice>(
      "LfFragmentCodec",
      {{lf::CodecChoice::kAuto,
        "Uncompressed if the compositor is in this process, otherwise JPEG with the quality in the request", "auto"},
       {lf::CodecChoice::kRaw,
        "Uncompressed, 8 bits per colour value. This needs the least computing time, but more "
        "bandwidth than JPEG",
        "raw"},
       {lf::CodecChoice::kRaw16,
        "Uncompressed, 16 bits per colour value. Values are rounded only once, when the picture is made, so this "
        "format is the most accurate, but also the largest",
        "raw16"},
       {lf::CodecChoice::kJpeg, "JPEG with the quality in the request, or uncompressed if this quality is 0", "jpeg"}});
  return type;
}

static GType resampling_type() {
  static const GType type = lf::register_enum<lf::Resampling>(
      "LfFragmentResampling", {{lf::Resampling::kBilinear, "Bilinear", "bilinear"},
                               {lf::Resampling::kSharpened,
                                "Bilinear interpolation of sharpened images, which keeps more detail but takes "
                                "more time",
                                "sharpened"}});
  return type;
}

GType lf_fragment_renderer_get_type(void) {
  static const GType type = lf::register_enum<lf::RendererChoice>(
      "LfFragmentRenderer",
      {{lf::RendererChoice::kCpu, "The CPU, with its widest vector instructions", "cpu"},
       {lf::RendererChoice::kGl,
        "A GPU, through OpenGL ES 3.1. No display is needed. Without a driver, the CPU renders the answers", "gl"},
       {lf::RendererChoice::kAuto,
        "The faster of the two, measured on the first answers. OpenGL drivers that compute on the CPU are never used",
        "auto"}});
  return type;
}

namespace lf {

PropertyTable<FragmentSettings>& FragmentSettings::properties() {
  using S = FragmentSettings;
  static PropertyTable<S> table = {
      property<&S::rig>(kWhilePlaying, "rig", "Rig",
                        "Path of the rig file (rig.json), which describes all cameras of the array. This property is "
                        "required. If it is set while the element runs, the new rig applies from the next request on. "
                        "Each pad keeps the camera with the same id"),
      property<&S::node>(kWhileReady, "node", "Node",
                         "Number that identifies this node (this element with its cameras) in its answers. It must be "
                         "unique in the array, because compositors use it to distinguish the nodes",
                         0, G_MAXUINT),
      property<&S::codec>(kWhilePlaying, "codec", "Codec",
                          "Pixel encoding of the answers. JPEG compression saves network bandwidth, but costs "
                          "computing time on both hosts and changes the picture slightly",
                          LF_TYPE_FRAGMENT_CODEC),
      property<&S::threads>(
          kWhilePlaying, "threads", "Threads",
          "Maximum number of threads that render one answer. Reduce it to leave processors for other programs. All "
          "lffragment elements of a process share the same threads (0: number of processors)",
          0, 256),
      property<&S::max_skew>(kWhilePlaying, "max-skew", "Largest skew",
                             "Maximum difference between the requested and the actual capture time of a live frame, in "
                             "nanoseconds (0: unlimited). A camera without a frame in this range does not contribute "
                             "to the view, and other cameras replace its contribution. Increase it if cameras deliver "
                             "frames slowly or irregularly",
                             0, G_MAXINT64),
      property<&S::strip_pixels>(
          kWhilePlaying, "strip-pixels", "Pixels of a strip",
          "Approximate number of pixels in a fragment. A fragment is a part of the view that is sent as a whole, so a "
          "lost packet costs one fragment. Smaller fragments make packet loss less visible, but need more bytes. A "
          "fragment has at least 16 rows. This property has no effect on answers with 16 bits per value (see `codec`)",
          1, 1 << 28),
      property<&S::post_messages>(
          kWhilePlaying, "post-messages", "Post messages",
          "If true, the element posts an element message \"lightfield-answer\" for every answer. The message contains "
          "sizes and durations, such as the rendering time. Use it to measure a pipeline"),
      property<&S::access>(
          kWhilePlaying, "access", "Access",
          "Selects how much of the rendering the cameras do. With self, the cameras know the whole rig and answer view "
          "requests. The two other values are for simple cameras, and lfviewrequest must have the same setting. With "
          "warp, cameras know only their own lens, and lfviewrequest sends them the transformation of each image into "
          "the view. With pixels, cameras only deliver the image regions that lfviewrequest names, and an lfcompositor "
          "with a rig transforms these pixels",
          LF_TYPE_ACCESS),
      property<&S::resampling>(
          kWhilePlaying, "resampling", "Resampling",
          "Interpolation of the camera images between pixel positions. Bilinear interpolation blurs the view slightly. "
          "The value sharpened restores most of the lost detail, but takes more time. If `access` is pixels, the "
          "compositor samples the images, and this property has no effect",
          resampling_type()),
      property<&S::max_delay>(kWhilePlaying, "max-delay", "Largest delay",
                              "Maximum time from the arrival of a live request to its answer, in nanoseconds (0: "
                              "unlimited). The element estimates the time from earlier answers, and skips the request "
                              "if the estimate exceeds the limit. Set this if viewers cannot use late pictures",
                              0, G_MAXINT64),
      property<&S::renderer>(kWhilePlaying, "renderer", "Renderer",
                             "Processor that renders the answers: CPU or GPU. The pictures are almost identical. In "
                             "the colour format of the cameras, values differ by at most 1 of 255. The `stats` "
                             "property shows the processor in use and the reason",
                             LF_TYPE_FRAGMENT_RENDERER),
  };
  return table;
}

}  // namespace lf

// Loads a new rig file while the element runs. The rig is used from the next request on. Returns false if the file
// cannot be loaded.
static bool lf_fragment_reload_rig(LfFragment* self, const gchar* path) {
  const std::shared_ptr<const lf::Rig> rig = lf::reload_rig(GST_ELEMENT(self), path);
  if (!rig) return false;
  const std::string problem = self->state->node.inputs().set_rig(rig);
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s: %s, so the node ignores the video of these cameras.", path, problem.c_str()), (nullptr));
  return true;
}

static Settings& settings_of(LfFragment* self) { return self->state->settings; }

static GstStructure* stats_of(LfFragment* self) {
  const lf::NodeStats& node = self->state->node.stats();
  GstStructure* stats = gst_structure_new_empty("lightfield-fragment-stats");
  for (const auto& [name, value] : node.all()) gst_structure_set(stats, name.c_str(), G_TYPE_UINT64, value, nullptr);
  const std::map<uint32_t, float> gains = node.gains();
  g_autoptr(GstStructure) of_cameras = gst_structure_new_empty("lightfield-gains");
  for (const auto& [id, gain] : gains)
    gst_structure_set(of_cameras, ("camera-" + std::to_string(id)).c_str(), G_TYPE_DOUBLE, static_cast<double>(gain),
                      nullptr);
  if (!gains.empty()) gst_structure_set(stats, "gains", GST_TYPE_STRUCTURE, of_cameras, nullptr);
  const std::string renderer = self->state->gpu.explain(lf_fragment_settings(self).renderer);
  gst_structure_set(stats, "renderer", G_TYPE_STRING, renderer.c_str(), nullptr);
  self->state->guard.add_stats(stats);
  return stats;
}

static lf::RequestGuard& guard_of(LfFragment* self) { return self->state->guard; }

using Properties = lf::Properties<settings_of, stats_of, guard_of>;

Settings lf_fragment_settings(LfFragment* self) { return Properties::now(self); }

static void lf_fragment_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragment* self = LF_FRAGMENT(object);
  if (lf::is_named(pspec, "rig") && lf::is_running(GST_ELEMENT(self)) &&
      !lf_fragment_reload_rig(self, g_value_get_string(value)))
    return;
  Properties::set(object, id, value, pspec);
}

static void lf_fragment_install_properties(GObjectClass* object_class) {
  Properties::install(
      object_class,
      "Counters since the start, and durations in nanoseconds. The counters refused-pixels, -aperture, -hypotheses, "
      "-rate, -views and -lens count refused requests by the exceeded limit. Answers are counted as skipped (the "
      "picture would have been too late), drawn (rendered by OpenGL) and together (rendered together with other views "
      "of a set). fragments and bytes count the parts of the answers and their size. Camera frames are counted as "
      "gpu-frames (used in GPU memory, without a download), missing-frames, stale-frames (missing because of max-skew) "
      "and damaged-frames. max-skew-ns is the largest capture-time error. renderer names the processor in use and the "
      "reason. The durations cover waiting for frames, decoding, rendering, encoding and the whole answer (answer-ns). "
      "Each has the latest value, and p50, p95 and p99 over the latest 1024 answers");
  object_class->set_property = lf::callback<lf_fragment_set_property>;
  gst_type_mark_as_plugin_api(LF_TYPE_FRAGMENT_PAD, GstPluginAPIFlags(0));
}

// --- Requests in, answers out ----------------------------------------------------------------------------------------
//
// Live requests are answered in a thread of the answer pad, and views take turns (FairScheduler). Non-live requests are
// answered sequentially in their own streaming thread.

static lf::ParallelFor lf_fragment_workers(LfFragment* self) {
  return [self](size_t count, const std::function<void(size_t)>& task) {
    const guint threads = lf_fragment_settings(self).threads;
    self->state->workers->run(threads > 0 ? threads : g_get_num_processors(), count, task);
  };
}

// Returns the segment event of the pad (transfer full), or null.
static GstEvent* segment_event(GstPad* pad, const GstSegment** segment) {
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) gst_event_parse_segment(event, segment);
  return event;
}

static void lf_fragment_follow_requests(LfFragment* self, GstPad* pad, const lf::RequestHeader& head) {
  if (head.target_time == lf::kNoTime) return;
  const GstSegment* segment = nullptr;
  g_autoptr(GstEvent) event = segment_event(pad, &segment);
  if (event && Client::of(pad).place.moves(*segment, head.target_time))
    lf_fragment_seek_cameras(self, head.target_time, gst_event_get_seqnum(event));
}

// Reports upstream which capture delay the cameras need, that is, how old the requested frames must be. Viewers with
// capture-delay=-1 use this delay.
static void lf_fragment_send_delay(LfFragment* self, GstPad* pad) {
  Client& client = Client::of(pad);
  if (!client.place.is_live()) return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return;
  const uint64_t now = gst_clock_get_time(clock);
  if (!client.delay.is_due(now)) return;
  const uint64_t needed = lf_fragment_needed_delay(self, now);
  if (client.delay.see(needed, now)) gst_pad_push_event(pad, lf::capture_delay_event(needed));
}

// Returns true if the picture would be too late to be shown after this much work.
static bool lf_fragment_is_too_late(GstPad* pad, const Job& job, lf::WorkEstimate& estimate, double work) {
  if (job.due > 0 && lf::now_ns() + estimate.nanoseconds(work) > job.due) {
    estimate.skipped();
    return true;
  }
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  if (head.probe) return false;
  const GstSegment* segment = nullptr;
  g_autoptr(GstEvent) event = segment_event(pad, &segment);
  if (!event) return false;
  const GstClockTime time = gst_segment_to_running_time(segment, GST_FORMAT_TIME, job.pts);
  return Client::of(pad).qos.late(head.view_id, time).has_value();
}

static void lf_fragment_post_answer(LfFragment* self, const Job& job, const lf::Node::Reply& reply, guint64 bytes) {
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  const lf::NodeStats::Stages& s = reply.stages;
  gst_element_post_message(
      GST_ELEMENT(self),
      gst_message_new_element(
          GST_OBJECT(self),
          gst_structure_new("lightfield-answer", "view-id", G_TYPE_UINT, head.view_id, "sequence", G_TYPE_UINT,
                            head.sequence, "pts", G_TYPE_UINT64, job.pts, "fragments", G_TYPE_UINT,
                            static_cast<guint>(reply.answer.fragments), "bytes", G_TYPE_UINT64, bytes, "wait-ns",
                            G_TYPE_UINT64, s.wait, "decode-ns", G_TYPE_UINT64, s.decode, "render-ns", G_TYPE_UINT64,
                            s.render, "encode-ns", G_TYPE_UINT64, s.encode, nullptr)));
}

static GstFlowReturn lf_fragment_push(LfFragment* self, GstPad* src, GstBuffer* unit, const Job& job) {
  GST_BUFFER_PTS(unit) = job.pts;
  GST_BUFFER_DURATION(unit) = job.duration;
  self->state->node.stats().bytes += gst_buffer_get_size(unit);
  return gst_pad_push(src, unit);
}

static lf::GlContextPtr frames_context(LfFragment* self) {
  const lf::ObjectLock lock(self);
  return self->state->frames_context.get();
}

// Moves the renderer to the share group of the context. Returns false if that is not possible, now or ever.
static bool move_to(LfFragment* self, lf::RendererChoice choice, lf::gl::ShareGroup group, bool early,
                    const lf::GlContextPtr& context) {
  std::string why;
  const auto open = [&](std::string& reason) -> std::unique_ptr<lf::gl::GlesRenderer> {
    if (!context) return nullptr;
    lf::gl::Context::External foreign = lf::share(context.get(), reason);
    if (!foreign.call) return nullptr;
    return lf::gl::GlesRenderer::create_in(std::move(foreign), lf::gl::Context::Drivers::kHardware, reason);
  };
  const bool is_there = self->state->gpu.move_to(choice, group, early, open, why);
  if (!why.empty()) GST_INFO_OBJECT(self, "frames or sums are downloaded from the GPU: %s", why.c_str());
  return is_there;
}

// Chooses the share group of the renderer. The group of GPU frames is best, because the frames need not be downloaded.
// The group of the compositor's pictures comes next and saves the download of sums. Usually both groups are the same.
static void move_gpu(LfFragment* self, lf::RendererChoice choice, const lf::LocalCompositor& compositor) {
  const lf::GlContextPtr frames = frames_context(self);
  if (frames && move_to(self, choice, lf::share_group(frames.get()), true, frames)) return;
  if (compositor.group != 0) move_to(self, choice, compositor.group, false, compositor.context.get());
}

static lf::Node::Options options_of(LfFragment* self, const Settings& settings, const lf::LocalCompositor& compositor) {
  lf::Node::Options options;
  options.max_skew = settings.max_skew;
  options.base_time = gst_element_get_base_time(GST_ELEMENT(self));
  options.wall_offset = lf::wall_offset(GST_ELEMENT(self));
  lf::RenderOptions& render = options.render;
  render.codec = settings.codec;
  render.strip_pixels = settings.strip_pixels;
  render.resampling = settings.resampling;
  render.in_process = compositor.is_there;
  render.group = compositor.group;
  if (settings.renderer != lf::RendererChoice::kCpu) move_gpu(self, settings.renderer, compositor);
  std::string warning;
  render.gpu = self->state->gpu.open(settings.renderer, warning);
  render.depth_gpu = self->state->gpu.open_for_depth(settings.renderer);
  // Another client may have moved the renderer in between. Images are prepared for a single renderer, so both must be
  // the same.
  if (render.gpu && render.depth_gpu != render.gpu) render.depth_gpu.reset();
  if (!warning.empty()) GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("%s.", warning.c_str()), (nullptr));
  return options;
}

// Pushes the photo-consistency and brightness units of an answer, and then the answer.
static GstFlowReturn lf_fragment_send(LfFragment* self, GstPad* pad, GstPad* src, const Job& job,
                                      lf::Node::Reply reply) {
  Client& client = Client::of(pad);
  lf::Node& node = self->state->node;
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  if (!reply.warning.empty())
    GST_ELEMENT_WARNING(self, STREAM, FAILED, ("View %u: %s.", head.view_id, reply.warning.c_str()), (nullptr));
  for (lf::ByteBuffer* before : {&reply.answer.brightness, &reply.answer.consistency.unit}) {
    if (before->empty()) continue;
    const GstFlowReturn flow = lf_fragment_push(self, src, lf::wrap_bytes(std::move(*before)), job);
    if (flow != GST_FLOW_OK) return flow;
  }
  GstBuffer* out = lf::wrap_answer(std::move(reply.answer.bytes), client.memory, std::move(reply.answer.payload));
  node.stats().answers++;
  node.stats().fragments += reply.answer.fragments;
  if (lf_fragment_settings(self).post_messages) lf_fragment_post_answer(self, job, reply, gst_buffer_get_size(out));
  GST_LOG_OBJECT(pad, "view %u, request %u: %zu fragments, %" G_GSIZE_FORMAT " bytes", head.view_id, head.sequence,
                 reply.answer.fragments, gst_buffer_get_size(out));
  return lf_fragment_push(self, src, out, job);
}

static GstFlowReturn lf_fragment_answer(LfFragment* self, GstPad* pad, GstPad* src, std::span<const JobPtr> jobs,
                                        lf::Node::ClientState& kept, lf::ParallelFor parallel) {
  Client& client = Client::of(pad);
  lf::Node& node = self->state->node;
  const Settings settings = lf_fragment_settings(self);
  lf::Node::Options options = options_of(self, settings, jobs.front()->compositor);
  options.live = client.place.is_live();
  options.render.parallel = std::move(parallel);
  std::vector<const lf::wire::AnyRequest*> requests;
  std::vector<JobPtr> answered;
  double work = 0;
  for (const JobPtr& job : jobs) work += job->work;
  for (const JobPtr& job : jobs) {
    if (lf_fragment_is_too_late(pad, *job, kept.estimate, work)) {
      const GstFlowReturn flow = lf_fragment_send(self, pad, src, *job, node.skip(job->request));
      if (flow != GST_FLOW_OK) return flow;
      continue;
    }
    requests.push_back(&job->request);
    answered.push_back(job);
  }
  if (requests.empty()) return GST_FLOW_OK;
  std::vector<lf::Node::Reply> replies = node.answer(requests, kept, options, [&] { return client.memory->take(); });
  if (replies.size() > 1) node.stats().together += replies.size();
  // One pass makes all replies, so all of them are drawn, or none.
  const auto refused = std::ranges::find_if(replies, [](const auto& reply) { return reply.answer.drawing.refused; });
  const lf::Node::Reply& judged = refused == replies.end() ? replies.front() : *refused;
  self->state->gpu.rendered(settings.renderer, judged.answer, frames_context(self) ? judged.stages.decode : 0);
  self->state->gpu.tried(settings.renderer, replies.front().answer.consistency);
  GstFlowReturn flow = GST_FLOW_OK;
  for (size_t i = 0; i < replies.size() && flow == GST_FLOW_OK; i++) {
    const lf::NodeStats::Stages& stages = replies[i].stages;
    if (stages.render > 0) kept.estimate.done(answered[i]->work, stages.decode + stages.render + stages.encode);
    flow = lf_fragment_send(self, pad, src, *answered[i], std::move(replies[i]));
  }
  return flow;
}

// Answers a live request. If a GPU can draw several views per pass, the waiting requests of the same set are answered
// in one pass.
static std::optional<GstFlowReturn> lf_fragment_answer_with_set(LfFragment* self, GstPad* pad, GstPad* src,
                                                                const JobPtr& job, lf::Node::ClientState& kept,
                                                                lf::ParallelFor parallel) {
  const bool alone = !self->state->gpu.can_batch(lf_fragment_settings(self).renderer);
  const std::vector<JobPtr> jobs = Client::of(pad).waiting.take_with(job, alone);
  if (jobs.empty()) return std::nullopt;
  return lf_fragment_answer(self, pad, src, jobs, kept, std::move(parallel));
}

static void lf_fragment_answer_loop(gpointer data) {
  GstPad* src = GST_PAD(data);
  lf::guard_buffer(src, [=] { return Client::of(src).live_queue.work(src), GST_FLOW_OK; });
}

// Warns at the second request without a command, because viewers with the same `access` send a command after each
// request.
static void lf_fragment_note_wrong_access(LfFragment* self, Client& client, lf::Access access) {
  constexpr unsigned kEnough = 2;
  if (client.any_fits || ++client.wrong_access != kEnough) return;
  const char* nick = lf::access_nick(access);
  GST_ELEMENT_WARNING(
      self, STREAM, WRONG_TYPE,
      ("access=%s: the requests have no %s commands, so these cameras cannot answer. Set access=%s also at the "
       "viewer's lfviewrequest, or access=self here.",
       nick, nick, nick),
      (nullptr));
}

// Checks a request before decoding: its kind must match `access`, and it must be within the limits.
static bool lf_fragment_needs_answer(LfFragment* self, Client& client, std::span<const uint8_t> request) {
  const std::optional<lf::wire::RequestPeek> peek = lf::wire::peek_request(request);
  const lf::Access access = lf_fragment_settings(self).access;
  if (peek && lf::wire::access_of_type(peek->type).value_or(access) != access) {
    lf_fragment_note_wrong_access(self, client, access);
    return false;
  }
  if (peek) client.any_fits = true;
  return self->state->guard.admits(GST_ELEMENT(self), request, self->state->node.inputs().array()->extent,
                                   client.place.is_live(), client.number);
}

static GstFlowReturn lf_fragment_answer_later(LfFragment* self, GstPad* pad, GstPad* src, const JobPtr& job) {
  Client& client = Client::of(pad);
  const GstClockTime max_delay = lf_fragment_settings(self).max_delay;
  if (max_delay > 0) job->due = lf::now_ns() + max_delay;
  bool dropped = false;
  const auto* const view = std::get_if<lf::ViewRequest>(&job->request);
  client.waiting.add(job);
  const GstFlowReturn flow = client.live_queue.add(
      src, lf::wire::head_of(job->request).view_id, job->work,
      [self, pad, src, job](lf::Node::ClientState& kept, const lf::ParallelFor& parallel) {
        return lf_fragment_answer_with_set(self, pad, src, job, kept, parallel);
      },
      &dropped, view ? lf::queued_views_of_set(*view) : 1);
  // Jobs that were answered with their set are not lost.
  const size_t lost = client.waiting.forget_dropped();
  if (dropped) self->state->node.stats().superseded += lost;
  if (flow != GST_FLOW_FLUSHING && gst_pad_get_task_state(src) != GST_TASK_STARTED)
    gst_pad_start_task(src, lf_fragment_answer_loop, src, nullptr);
  return flow;
}

static double lf_fragment_work(LfFragment* self, std::span<const uint8_t> bytes, const lf::wire::AnyRequest& request) {
  const auto array = self->state->node.inputs().array();
  const size_t cameras = array->rig ? array->rig->cameras.size() : 0;
  double work = lf::estimated_work(lf::wire::peek_request_cost(bytes), cameras);
  if (const auto* const warp = std::get_if<lf::wire::WarpCommand>(&request))
    for (const lf::FacePlan& face : warp->warp.faces)
      work += static_cast<double>(face.rect.width()) * face.rect.height();
  // Building another mesh takes about as long as rendering this many pixels per camera.
  constexpr double kMeshCamera = 512;
  const auto* const view = std::get_if<lf::ViewRequest>(&request);
  if (view && !view->out_of_service.empty()) work += kMeshCamera * static_cast<double>(cameras);
  return work;
}

static GstFlowReturn lf_fragment_take_request(LfFragment* self, GstPad* pad, GstPad* src, GstBuffer* buffer) {
  Client& client = Client::of(pad);
  const lf::MappedBuffer mapped(buffer);
  if (!lf_fragment_needs_answer(self, client, mapped.bytes())) return GST_FLOW_OK;
  std::string reason;
  std::optional<lf::wire::AnyRequest> request = lf::wire::decode_any_request(mapped.bytes(), &reason);
  if (!request) {
    self->state->node.stats().bad_requests++;
    GST_WARNING_OBJECT(pad, "dropped a view request: %s", reason.c_str());
    return GST_FLOW_OK;
  }
  lf_fragment_follow_requests(self, pad, lf::wire::head_of(*request));
  lf_fragment_send_delay(self, pad);
  const double work = lf::WorkEstimate::kAnyAnswer + lf_fragment_work(self, mapped.bytes(), *request);
  const auto job = std::make_shared<Job>(
      Job{std::move(*request), GST_BUFFER_PTS(buffer), GST_BUFFER_DURATION(buffer), client.compositor.look(src), work});
  if (client.place.is_live()) return lf_fragment_answer_later(self, pad, src, job);
  return lf_fragment_answer(self, pad, src, {&job, 1}, client.kept, lf_fragment_workers(self));
}

static GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  const PadPtr src = Client::of(pad).src.get();
  const GstFlowReturn flow = !src ? GST_FLOW_FLUSHING : lf::guard_buffer(parent, [&] {
    return lf_fragment_take_request(LF_FRAGMENT(parent), pad, src.get(), buffer);
  });
  gst_buffer_unref(buffer);
  return flow;
}

// --- Pairs of pads, one for each client ---------------------------------------------------------------------------

static PadPtr lf_fragment_other_pad(GstPad* pad) {
  return (GST_PAD_IS_SRC(pad) ? Client::of(pad).request : Client::of(pad).src).get();
}

static gboolean lf_fragment_pair_event(GstPad* pad, GstEvent* event) {
  const PadPtr other = lf_fragment_other_pad(pad);
  if (other) return gst_pad_push_event(other.get(), event);
  gst_event_unref(event);
  return FALSE;
}

static gboolean lf_fragment_pair_query(GstPad* pad, GstQuery* query) {
  const PadPtr other = lf_fragment_other_pad(pad);
  return other && gst_pad_peer_query(other.get(), query);
}

static void lf_fragment_finish_if_all_ended(LfFragment* self) {
  lf::ObjectLock lock(self);
  bool any = false, all = true;
  for (Client* client : self->state->clients) {
    any = any || client->ended;
    all = all && (client->ended || !gst_pad_is_linked(client->request.get().get()));
  }
  lock.unlock();
  using Mode = lf::CameraFrames::Mode;
  if (any && all) lf_fragment_set_mode(self, Mode::kFinished, Mode::kRunning);
}

static void lf_fragment_set_ended(LfFragment* self, Client& client, bool ended) {
  const lf::ObjectLock lock(self);
  client.ended = ended;
}

static gboolean lf_fragment_request_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  Client& client = Client::of(pad);
  if (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED) client.live_queue.drain();
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      g_autoptr(GstCaps) caps = lf::unit_caps(LF_ANSWER_MEDIA_TYPE);
      gst_event_take(&event, gst_event_new_caps(caps));
      client.compositor.note_change();
      break;
    }
    case GST_EVENT_SEGMENT:
      client.place.begin(lf::live_latency(pad).has_value());
      client.compositor.note_change();
      break;
    case GST_EVENT_EOS:
      lf_fragment_set_ended(self, client, true);
      lf_fragment_finish_if_all_ended(self);
      break;
    // Flushes downstream first, so that no incomplete answer gets through.
    case GST_EVENT_FLUSH_START: {
      const gboolean ok = lf_fragment_pair_event(pad, event);
      client.live_queue.begin_flush();
      client.waiting.forget_dropped();
      self->state->node.cancel(client.kept, true);
      return ok;
    }
    case GST_EVENT_FLUSH_STOP:
      lf_fragment_set_ended(self, client, false);
      client.place.flush();
      client.qos.clear();
      client.kept.renderer.clear();
      client.live_queue.end_flush();
      self->state->node.cancel(client.kept, false);
      break;
    default: break;
  }
  return lf_fragment_pair_event(pad, event);
}

// Sends events from downstream (QoS, navigation, latency) to the client and never to the cameras, because capture is
// independent of requests.
static gboolean lf_fragment_src_event(GstPad* pad, GstObject*, GstEvent* event) {
  Client& client = Client::of(pad);
  if (GST_EVENT_TYPE(event) == GST_EVENT_RECONFIGURE) client.compositor.note_change();
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) client.qos.see(event, client.place.is_live());
  return lf_fragment_pair_event(pad, event);
}

static gboolean lf_fragment_src_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  if (GST_QUERY_TYPE(query) == GST_QUERY_CAPS) return gst_pad_query_default(pad, parent, query);
  return lf_fragment_pair_query(pad, query);
}

static gboolean lf_fragment_request_query(GstPad* pad, GstObject* parent, GstQuery* query) {
  switch (GST_QUERY_TYPE(query)) {
    case GST_QUERY_CAPS:
    case GST_QUERY_ACCEPT_CAPS: return gst_pad_query_default(pad, parent, query);
    case GST_QUERY_ALLOCATION: return FALSE;
    default: return lf_fragment_pair_query(pad, query);
  }
}

static gboolean lf_fragment_src_activate(GstPad* pad, GstObject*, GstPadMode mode, gboolean active) {
  if (mode != GST_PAD_MODE_PUSH) return FALSE;
  lf::LiveAnswerQueue& answers = Client::of(pad).live_queue;
  if (!active) return answers.stop(pad);
  answers.start();
  return TRUE;
}

static GstIterator* lf_fragment_internal_links(GstPad* pad, GstObject*) {
  const PadPtr other = lf_fragment_other_pad(pad);
  if (!other) return nullptr;
  GValue value = G_VALUE_INIT;
  g_value_init(&value, GST_TYPE_PAD);
  g_value_set_object(&value, other.get());
  GstIterator* iterator = gst_iterator_new_single(GST_TYPE_PAD, &value);
  g_value_unset(&value);
  return iterator;
}

// Adds a pair of pads for a further client: a request pad and its answer pad. Returns the request pad.
static GstPad* lf_fragment_pair_new(LfFragment* self, GstPadTemplate* request_template, const gchar* request_name,
                                    GstPadTemplate* src_template, const gchar* src_name) {
  static const GQuark quark = g_quark_from_static_string("lf-fragment-pair");
  GstPad* request = gst_pad_new_from_template(request_template, request_name);
  GstPad* src = gst_pad_new_from_template(src_template, src_name);
  lf::ObjectLock lock(self);
  const auto client = std::make_shared<Client>(request, src, self->state->next_requester++, lf_fragment_workers(self));
  self->state->clients.insert(client.get());
  lock.unlock();
  lf::accept_unit_caps(request);
  gst_pad_set_chain_function(request, lf::callback<lf_fragment_request_chain>);
  gst_pad_set_event_function(request, lf::callback<lf_fragment_request_event>);
  gst_pad_set_query_function(request, lf::callback<lf_fragment_request_query>);
  gst_pad_set_event_function(src, lf::callback<lf_fragment_src_event>);
  gst_pad_set_activatemode_function(src, lf::callback<lf_fragment_src_activate>);
  gst_pad_set_query_function(src, lf::callback<lf_fragment_src_query>);
  for (GstPad* pad : {src, request}) {
    gst_pad_set_iterate_internal_links_function(pad, lf::callback<lf_fragment_internal_links>);
    gst_pad_set_element_private(pad, client.get());
    g_object_set_qdata_full(G_OBJECT(pad), quark, new std::shared_ptr<Client>(client),
                            [](gpointer data) { delete static_cast<std::shared_ptr<Client>*>(data); });
  }
  for (GstPad* pad : {src, request}) {
    if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
    gst_element_add_pad(GST_ELEMENT(self), pad);
  }
  return request;
}

static void lf_fragment_pair_release(LfFragment* self, GstPad* request) {
  Client& client = Client::of(request);
  const PadPtr src = client.src.get();
  lf::ObjectLock lock(self);
  self->state->clients.erase(&client);
  lock.unlock();
  gst_pad_set_active(src.get(), FALSE);  // drops the answer of the cancelled wait
  self->state->node.cancel(client.kept, true);
  gst_pad_set_active(request, FALSE);
  self->state->guard.forget(client.number);
  gst_element_remove_pad(GST_ELEMENT(self), src.get());
  gst_element_remove_pad(GST_ELEMENT(self), request);
  lf_fragment_finish_if_all_ended(self);
}

void lf_fragment_trim_memory(LfFragment* self) {
  constexpr gint64 kInterval = 10 * G_USEC_PER_SEC;
  const gint64 now = g_get_monotonic_time();
  const lf::ObjectLock lock(self);
  if (now < self->state->trimmed_at + kInterval) return;
  self->state->trimmed_at = now;
  for (Client* client : self->state->clients) {
    client->memory->trim();
    client->kept.images->trim();
  }
}

// --- Camera pads, states and class -----------------------------------------------------------------------------------

static guint number_of(const gchar* name, const gchar* prefix, guint* next) {
  guint number = *next;
  if (name && g_str_has_prefix(name, prefix))
    number = static_cast<guint>(g_ascii_strtoull(name + strlen(prefix), nullptr, 10));
  *next = MAX(*next, number + 1);
  return number;
}

static GstPad* lf_fragment_request_new_pad(GstElement* element, GstPadTemplate* templ, const gchar* name,
                                           const GstCaps*) {
  LfFragment* self = LF_FRAGMENT(element);
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(element);
  if (templ == gst_element_class_get_pad_template(klass, "request_%u")) {
    const guint number = number_of(name, "request_", &self->state->next_pair);
    g_autofree gchar* request_name = g_strdup_printf("request_%u", number);
    g_autofree gchar* src_name = g_strdup_printf("src_%u", number);
    return lf_fragment_pair_new(self, templ, request_name, gst_element_class_get_pad_template(klass, "src_%u"),
                                src_name);
  }
  g_autofree gchar* pad_name = g_strdup_printf("sink_%u", number_of(name, "sink_", &self->state->next_camera_pad));
  GstPad* pad = lf_fragment_camera_pad_new(self, templ, pad_name);
  const auto& frames = LF_FRAGMENT_PAD(pad)->input->frames();
  lf::ObjectLock lock(self);
  const lf::CameraFrames::Mode mode = self->state->mode;
  lock.unlock();
  frames->set_mode(mode);
  if (mode == lf::CameraFrames::Mode::kRunning) self->state->node.inputs().add(frames);
  if (lf::is_running(element)) gst_pad_set_active(pad, TRUE);
  gst_element_add_pad(element, pad);
  gst_child_proxy_child_added(GST_CHILD_PROXY(element), G_OBJECT(pad), pad_name);
  return pad;
}

static void lf_fragment_release_pad(GstElement* element, GstPad* pad) {
  LfFragment* self = LF_FRAGMENT(element);
  if (LF_IS_FRAGMENT_PAD(pad)) {
    // Waits for the streaming thread, because frames may arrive until it has stopped.
    const auto& frames = LF_FRAGMENT_PAD(pad)->input->frames();
    frames->set_mode(lf::CameraFrames::Mode::kStopped);
    gst_pad_set_active(pad, FALSE);
    self->state->node.inputs().remove(frames);
    gst_child_proxy_child_removed(GST_CHILD_PROXY(element), G_OBJECT(pad), GST_PAD_NAME(pad));
    gst_element_remove_pad(element, pad);
    return;
  }
  lf_fragment_pair_release(self, pad);
}

static bool lf_fragment_start(LfFragment* self) {
  const Settings settings = lf_fragment_settings(self);
  if (settings.rig.empty()) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS,
                      ("No rig file given: set the property \"rig\" to the path of the "
                       "array's rig file (rig.json)."),
                      (nullptr));
    return false;
  }
  auto& state = *self->state;
  try {
    state.node.inputs().set_rig(lf::shared_rig(settings.rig));
  } catch (const lf::Error& error) {
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("%s", error.what()), (nullptr));
    return false;
  }
  state.node.set_node_id(settings.node);
  state.node.inputs().forget_family();
  state.node.forget_depths();
  state.guard.start(GST_ELEMENT(self));
  lf::ObjectLock lock(self);
  for (Client* client : state.clients) {
    client->ended = false;
    client->place.clear();
    client->delay.clear();
    client->qos.clear();
    client->kept.rig.reset();
    *client->kept.cancelled = false;
  }
  lock.unlock();
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kRunning);
  // Cameras that the application has set count from the start, so their contribution is missing until they have a
  // frame.
  for (const PadPtr& pad : lf_fragment_camera_pads(self)) {
    LfFragmentPad* camera_pad = LF_FRAGMENT_PAD(pad.get());
    if (camera_pad->settings.camera < 0 || camera_pad->input->assign()) continue;
    lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
    return false;
  }
  return true;
}

static GstStateChangeReturn lf_fragment_change_state(GstElement* element, GstStateChange transition) {
  LfFragment* self = LF_FRAGMENT(element);
  if (transition == GST_STATE_CHANGE_READY_TO_PAUSED && !lf_fragment_start(self)) return GST_STATE_CHANGE_FAILURE;
  // Wakes the streaming threads first, because the parent class waits for them while it deactivates the pads.
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_fragment_parent_class)->change_state(element, transition);
  if (transition != GST_STATE_CHANGE_PAUSED_TO_READY) return result;
  for (const PadPtr& pad : lf_fragment_camera_pads(self)) LF_FRAGMENT_PAD(pad.get())->input->reset();
  // Releases downstream's OpenGL context without the lock, because destroying the context takes time.
  std::vector<lf::LocalCompositor> forgotten;
  self->state->gpu.leave();
  lf_fragment_note_context(self, nullptr);
  const lf::ObjectLock lock(self);
  for (Client* client : self->state->clients) forgotten.push_back(client->compositor.forget());
  return result;
}

static void lf_fragment_finalize(GObject* object) {
  delete LF_FRAGMENT(object)->state;
  G_OBJECT_CLASS(lf_fragment_parent_class)->finalize(object);
}

static void lf_fragment_class_init(LfFragmentClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  GstElementClass* element_class = GST_ELEMENT_CLASS(klass);
  object_class->finalize = lf_fragment_finalize;
  element_class->change_state = lf::callback<lf_fragment_change_state>;
  element_class->request_new_pad = lf::callback<lf_fragment_request_new_pad>;
  element_class->release_pad = lf::callback<lf_fragment_release_pad>;

  lf_fragment_install_properties(object_class);

  gst_element_class_add_static_pad_template_with_gtype(element_class, &sink_template, LF_TYPE_FRAGMENT_PAD);
  gst_element_class_add_static_pad_template(element_class, &request_template);
  gst_element_class_add_static_pad_template(element_class, &more_request_template);
  gst_element_class_add_static_pad_template(element_class, &src_template);
  gst_element_class_add_static_pad_template(element_class, &more_src_template);
  gst_element_class_set_static_metadata(element_class, "Light field random access camera", "Filter/Video",
                                        "Renders the contribution of its cameras to requested views",
                                        "gst-lightfield developers");
}

static void lf_fragment_init(LfFragment* self) {
  self->state = new _LfFragment::State;
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(self);
  lf_fragment_pair_new(self, gst_element_class_get_pad_template(klass, "request"), "request",
                       gst_element_class_get_pad_template(klass, "src"), "src");
}
