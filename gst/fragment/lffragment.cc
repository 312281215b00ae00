// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * SECTION:element-lffragment
 * @title: lffragment
 * @short_description: the random access camera: answers view requests with the sum of what its cameras see
 *
 * Takes the video of one or more cameras of a rig on its `sink_%u` pads and view requests on `request`. Each request is
 * answered on `src` with the sum of what these cameras contribute to the requested view, of as much of the view as they
 * have a weight in; where the request has trials, what they came to goes before it. `lfcompositor` adds the answers of
 * all nodes up. Further requesters use the pads `request_%u`, each paired with a `src_%u`.
 *
 * With `access` the cameras are those of the paper's section 4.2 that know less: they take their part from warp or
 * pixel commands, which `lfviewrequest access=` sends behind its requests, and leave the requests themselves alone. Of
 * `rig` only their lenses count then, or only the sizes of their images.
 *
 * JPEG video is kept as it comes and decoded only where a request looks. Damaged frames are dropped and counted; the
 * one before serves in their place.
 *
 * Live cameras are never waited for: the frame nearest to the requested capture time is used, if it is not farther
 * than `max-skew`. A warning tells when a camera comes to be off by more than a frame. Frames of other cameras
 * (files) are waited for, so that files in give the same files out on every machine, and are read no faster than
 * requests move on. Where requests are sought, they are too.
 *
 * Requests whose pictures would come too late to be shown, as QoS events say that lfcompositor passes on, are answered
 * without fragments.
 *
 * ## Example launch line
 * |[
 * gst-launch-1.0 lfviewrequest location=views.json ! tee name=r  r. ! queue ! n.request \
 *   lffragment name=n rig=rig.json ! c.sink_0  lfcamsrc rig=rig.json camera=0 ! n.sink_0 \
 *   lfcamsrc rig=rig.json camera=1 ! n.sink_1  lfcamsrc rig=rig.json camera=8 ! n.sink_2 \
 *   r. ! queue ! c.request  lfcompositor name=c rig=rig.json ! videoconvert ! autovideosink
 * ]|
 *
 * ## Element messages
 * With `post-messages` an element message "lightfield-answer" per answer: view-id, sequence (uint), pts (uint64),
 * fragments (uint), bytes, and what it took: wait-ns (for frames of the time asked for), decode-ns, render-ns,
 * encode-ns (uint64).
 */

#include "fragment/lffragment.h"

#include <cstring>
#include <map>
#include <string>

#include "base/schedule.h"
#include "base/text.h"
#include "common/common.h"
#include "common/custom_events.h"
#include "common/day_clock.h"
#include "fragment/camera_input.h"
#include "fragment/fragment_state.h"
#include "wire/request_codec.h"

GST_DEBUG_CATEGORY(lf_fragment_debug);
#define GST_CAT_DEFAULT lf_fragment_debug

using lf::PadPtr;
using lf::Requester;
using Job = lf::FragmentJob;
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

// The camera pads' properties, for gst-launch's `sink_0::camera=5`.
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
        "Uncompressed to a compositor in this process, else JPEG of the quality that the request asks for", "auto"},
       {lf::CodecChoice::kRaw, "8 bits a value", "raw"},
       {lf::CodecChoice::kRaw16, "16 bits a value: sums are rounded in the picture alone", "raw16"},
       {lf::CodecChoice::kJpeg, "JPEG of the quality that the request asks for, raw where that is 0", "jpeg"}});
  return type;
}

GType lf_fragment_resampling_get_type(void) {
  static const GType type = lf::register_enum<lf::Resampling>(
      "LfFragmentResampling", {{lf::Resampling::kBilinear, "Bilinear", "bilinear"},
                               {lf::Resampling::kSharpened, "Bilinear, of images sharpened before", "sharpened"}});
  return type;
}

GType lf_fragment_renderer_get_type(void) {
  static const GType type = lf::register_enum<lf::RendererChoice>(
      "LfFragmentRenderer",
      {{lf::RendererChoice::kCpu, "The CPU, with the widest vectors that it has", "cpu"},
       {lf::RendererChoice::kGl, "OpenGL ES 3.1 without a window, where there is a driver for it; else the CPU", "gl"},
       {lf::RendererChoice::kAuto, "The faster one, as the first answers tell; never a driver that computes on the CPU",
        "auto"}});
  return type;
}

namespace lf {

PropertyTable<FragmentSettings>& FragmentSettings::properties() {
  using S = FragmentSettings;
  static PropertyTable<S> table = {
      property<&S::rig>(kWhilePlaying, "rig", "Rig",
                        "Rig file (rig.json) of the whole array; required. Set while running, it is read again and "
                        "serves from the next request on; cameras keep their pads by id"),
      property<&S::node>(kWhileReady, "node", "Node", "Number of this node, carried in its answers", 0, G_MAXUINT),
      property<&S::codec>(kWhilePlaying, "codec", "Codec", "How pixels travel in the answers", LF_TYPE_FRAGMENT_CODEC),
      property<&S::threads>(kWhilePlaying, "threads", "Threads",
                            "Threads that work on an answer at most, out of those that all lffragments of the process "
                            "share (0: as many as there are processors)",
                            0, 256),
      property<&S::max_skew>(kWhilePlaying, "max-skew", "Largest skew",
                             "Live: how far, in nanoseconds, a frame may be from the capture time asked for; a camera "
                             "with no frame as near counts as blind, and others make up for it (0: any)",
                             0, G_MAXINT64),
      property<&S::strip_pixels>(kWhilePlaying, "strip-pixels", "Pixels of a strip",
                                 "How many pixels the fragments have, about, that a sum in 8 bits or JPEG is cut into: "
                                 "with fewer, a lost packet loses less (16 rows are the least)",
                                 1, 1 << 28),
      property<&S::post_messages>(kWhilePlaying, "post-messages", "Post messages",
                                  "Post an element message \"lightfield-answer\" for every answer"),
      property<&S::access>(kWhilePlaying, "access", "Access",
                           "What the cameras know, and so what is answered: view requests, or the commands that "
                           "lfviewrequest sends with the same setting. Pixels need an lfcompositor with a rig",
                           LF_TYPE_ACCESS),
      property<&S::resampling>(kWhilePlaying, "resampling", "Resampling",
                               "How cameras' images are sampled: sharpening makes up for what bilinear samples lose, "
                               "which is what is left of the error where the focus is right. With access=pixels the "
                               "compositor samples",
                               LF_TYPE_FRAGMENT_RESAMPLING),
      property<&S::max_delay>(kWhilePlaying, "max-delay", "Largest delay",
                              "Live: how long, in nanoseconds, after a request has come its answer can be of use; one "
                              "that would come later, by what such answers have taken, is not begun (0: any time)",
                              0, G_MAXINT64),
      property<&S::renderer>(
          kWhilePlaying, "renderer", "Renderer",
          "What draws the sums, and trials: both give the same picture to 1 of 255, in the format that cameras have. "
          "auto: the faster one, as the first answers tell, and never a driver that computes on the CPU, as Mesa's "
          "llvmpipe does; stats say what renders, and why",
          LF_TYPE_FRAGMENT_RENDERER),
  };
  return table;
}

}  // namespace lf

// While the element runs the file is read at once, and serves from the next request on. False if it can't be.
static bool lf_fragment_reload_rig(LfFragment* self, const gchar* path) {
  const std::shared_ptr<const lf::Rig> rig = lf::reload_rig(GST_ELEMENT(self), path);
  if (!rig) return false;
  const std::string problem = self->state->node.inputs().set_rig(rig);
  if (!problem.empty())
    GST_ELEMENT_WARNING(self, RESOURCE, SETTINGS,
                        ("%s: %s, of which this node has the video: it is left out.", path, problem.c_str()),
                        (nullptr));
  return true;
}

static Settings& settings_of(LfFragment* self) { return self->state->settings; }

static GstStructure* stats_of(LfFragment* self) {
  const lf::NodeStats& node = self->state->node.stats();
  GstStructure* stats = gst_structure_new_empty("lightfield-fragment-stats");
  for (const auto& [name, value] : node.all()) gst_structure_set(stats, name.c_str(), G_TYPE_UINT64, value, nullptr);
  const std::map<uint32_t, float> gains = node.gains();
  GstStructure* of_cameras = gst_structure_new_empty("lightfield-gains");
  for (const auto& [id, gain] : gains)
    gst_structure_set(of_cameras, ("camera-" + std::to_string(id)).c_str(), G_TYPE_DOUBLE, static_cast<double>(gain),
                      nullptr);
  if (!gains.empty()) gst_structure_set(stats, "gains", GST_TYPE_STRUCTURE, of_cameras, nullptr);
  gst_structure_free(of_cameras);
  const std::string renderer = self->state->card.explain(lf_fragment_settings(self).renderer);
  gst_structure_set(stats, "renderer", G_TYPE_STRING, renderer.c_str(), nullptr);
  self->state->guard.add_stats(stats);
  return stats;
}

using Properties = lf::Properties<settings_of, stats_of>;

Settings lf_fragment_settings(LfFragment* self) { return Properties::now(self); }

static void lf_fragment_set_property(GObject* object, guint id, const GValue* value, GParamSpec* pspec) {
  LfFragment* self = LF_FRAGMENT(object);
  if (self->state->guard.set(GST_ELEMENT(self), id, value)) return;
  if (lf::is_named(pspec, "rig") && lf::is_running(GST_ELEMENT(self)) &&
      !lf_fragment_reload_rig(self, g_value_get_string(value)))
    return;
  Properties::set(object, id, value, pspec);
}

static void lf_fragment_get_property(GObject* object, guint id, GValue* value, GParamSpec* pspec) {
  if (!LF_FRAGMENT(object)->state->guard.get(id, value)) Properties::get(object, id, value, pspec);
}

static void lf_fragment_install_properties(GObjectClass* object_class) {
  Properties::install(
      object_class,
      "Counts of requests, answers, of these skipped (too late to be shown), drawn by OpenGL and made together with "
      "others of their set of views (together), cameras' frames that were drawn from a card's memory without leaving "
      "it (card-frames), what renders and why (renderer), requests refused for one of the "
      "limits (refused, and of these refused-pixels, -aperture, -trials, -rate, -views, -lens), fragments, bytes, "
      "frames that were missing (of these stale: farther than max-skew) and frames that were damaged; the largest skew "
      "of a frame; what waiting for frames, decoding, rendering and encoding took: the latest answer's time and p50, "
      "p95, p99 over the latest 1024, and of all of them together (answer-ns; nanoseconds)");
  lf::RequestGuard::install(object_class);
  object_class->set_property = lf::callback<lf_fragment_set_property>;
  object_class->get_property = lf::callback<lf_fragment_get_property>;
  for (const GType type : {LF_TYPE_FRAGMENT_PAD, LF_TYPE_FRAGMENT_RENDERER, LF_TYPE_FRAGMENT_RESAMPLING,
                           LF_TYPE_FRAGMENT_CODEC, LF_TYPE_ACCESS})
    gst_type_mark_as_plugin_api(type, GstPluginAPIFlags(0));
}

// --- Requests in, answers out ----------------------------------------------------------------------------------------
//
// Where requests come in real time the answer pad has a thread that answers them, one view
// beside the other (FairAnswers); else the requests' own thread does, one after the other.

// Does tasks in the threads that the properties allow.
static lf::ParallelFor lf_fragment_workers(LfFragment* self) {
  return [self](size_t count, const std::function<void(size_t)>& task) {
    const guint threads = lf_fragment_settings(self).threads;
    self->state->workers->run(threads > 0 ? threads : g_get_num_processors(), count, task);
  };
}

// Owned by the caller; null where there is none.
static GstEvent* segment_event(GstPad* pad, const GstSegment** segment) {
  GstEvent* event = gst_pad_get_sticky_event(pad, GST_EVENT_SEGMENT, 0);
  if (event) gst_event_parse_segment(event, segment);
  return event;
}

static void lf_fragment_follow_requests(LfFragment* self, GstPad* pad, const lf::RequestHeader& head) {
  if (head.target_time == lf::kNoTime) return;
  const GstSegment* segment = nullptr;
  g_autoptr(GstEvent) event = segment_event(pad, &segment);
  if (event && Requester::of(pad).place.moves(*segment, head.target_time))
    lf_fragment_seek_cameras(self, head.target_time, gst_event_get_seqnum(event));
}

// Viewers may leave the capture delay to the nodes.
static void lf_fragment_tell_delay(LfFragment* self, GstPad* pad) {
  Requester& requester = Requester::of(pad);
  if (!requester.place.is_live()) return;
  g_autoptr(GstClock) clock = gst_element_get_clock(GST_ELEMENT(self));
  if (!clock) return;
  const uint64_t now = gst_clock_get_time(clock);
  if (!requester.delay.is_due(now)) return;
  const uint64_t needed = lf_fragment_needed_delay(self, now);
  if (requester.delay.see(needed, now)) gst_pad_push_event(pad, lf::capture_delay_event(needed));
}

// Whether the picture would come too late to be shown, as it comes after so much work.
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
  return Requester::of(pad).qos.late(head.view_id, time).has_value();
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

// Of frames in a card's memory; null where there are none.
static lf::GlContextPtr frames_context(LfFragment* self) {
  const lf::ObjectLock lock(self);
  return self->state->frames_context.get();
}

// What draws shares with the context. False if it does not, for now or ever.
static bool move_to(LfFragment* self, lf::RendererChoice choice, lf::gl::ShareGroup group, bool early,
                    const lf::GlContextPtr& context) {
  std::string why;
  const auto open = [&](std::string& reason) -> std::unique_ptr<lf::gl::SumDrawer> {
    if (!context) return nullptr;
    lf::gl::Context::Foreign foreign = lf::share(context.get(), reason);
    if (!foreign.call) return nullptr;
    return lf::gl::SumDrawer::create_in(std::move(foreign), lf::gl::Context::Drivers::kHardware, reason);
  };
  const bool is_there = self->state->card.move_to(choice, group, early, open, why);
  if (!why.empty()) GST_INFO_OBJECT(self, "frames or sums have to leave the card: %s", why.c_str());
  return is_there;
}

// Where the cameras' frames are on a card they need not leave it, else sums need not where the compositor's pictures
// are; mostly both are in the same contexts.
static void move_card(LfFragment* self, lf::RendererChoice choice, const lf::NearCompositor& compositor) {
  const lf::GlContextPtr frames = frames_context(self);
  if (frames && move_to(self, choice, lf::share_group(frames.get()), true, frames)) return;
  if (compositor.group != 0) move_to(self, choice, compositor.group, false, compositor.context.get());
}

static lf::Node::Options options_of(LfFragment* self, const Settings& settings,
                                    const lf::NearCompositor& compositor) {
  lf::Node::Options options;
  options.max_skew = settings.max_skew;
  options.base_time = gst_element_get_base_time(GST_ELEMENT(self));
  options.day_offset = lf::day_offset(GST_ELEMENT(self));
  lf::RenderOptions& render = options.render;
  render.codec = settings.codec;
  render.strip_pixels = settings.strip_pixels;
  render.resampling = settings.resampling;
  render.in_process = compositor.is_there;
  render.group = compositor.group;
  if (settings.renderer != lf::RendererChoice::kCpu) move_card(self, settings.renderer, compositor);
  std::string news;
  render.card = self->state->card.open(settings.renderer, news);
  render.trial_card = self->state->card.open_for_trials(settings.renderer);
  // Another requester may have moved it meanwhile, and images are made ready for one.
  if (render.card && render.trial_card != render.card) render.trial_card.reset();
  if (!news.empty()) GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND, ("%s.", news.c_str()), (nullptr));
  return options;
}

// What has been answered goes downstream.
static GstFlowReturn lf_fragment_send(LfFragment* self, GstPad* pad, GstPad* src, const Job& job,
                                      lf::Node::Reply reply) {
  Requester& requester = Requester::of(pad);
  lf::Node& node = self->state->node;
  const lf::RequestHeader& head = lf::wire::head_of(job.request);
  if (!reply.warning.empty())
    GST_ELEMENT_WARNING(self, STREAM, FAILED, ("View %u: %s.", head.view_id, reply.warning.c_str()), (nullptr));
  for (lf::ByteBuffer* before : {&reply.answer.brightness, &reply.answer.trials.unit}) {
    if (before->empty()) continue;
    const GstFlowReturn flow = lf_fragment_push(self, src, lf::wrap_bytes(std::move(*before)), job);
    if (flow != GST_FLOW_OK) return flow;
  }
  GstBuffer* out = lf::wrap_answer(std::move(reply.answer.bytes), requester.memory, std::move(reply.answer.payload));
  node.stats().answers++;
  node.stats().fragments += reply.answer.fragments;
  if (lf_fragment_settings(self).post_messages) lf_fragment_post_answer(self, job, reply, gst_buffer_get_size(out));
  GST_LOG_OBJECT(pad, "view %u, request %u: %zu fragments, %" G_GSIZE_FORMAT " bytes", head.view_id, head.sequence,
                 reply.answer.fragments, gst_buffer_get_size(out));
  return lf_fragment_push(self, src, out, job);
}

// Of several that may go together.
static GstFlowReturn lf_fragment_answer(LfFragment* self, GstPad* pad, GstPad* src, std::span<const JobPtr> jobs,
                                        lf::Node::Requester& kept, lf::ParallelFor parallel) {
  Requester& requester = Requester::of(pad);
  lf::Node& node = self->state->node;
  const Settings settings = lf_fragment_settings(self);
  lf::Node::Options options = options_of(self, settings, jobs.front()->compositor);
  options.live = requester.place.is_live();
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
  std::vector<lf::Node::Reply> replies = node.answer(requests, kept, options, [&] { return requester.memory->take(); });
  if (replies.size() > 1) node.stats().together += replies.size();
  // It was one pass, or one that was refused.
  const auto refused = std::ranges::find_if(replies, [](const auto& reply) { return reply.answer.drawing.refused; });
  const lf::Node::Reply& judged = refused == replies.end() ? replies.front() : *refused;
  self->state->card.rendered(settings.renderer, judged.answer, frames_context(self) ? judged.stages.decode : 0);
  self->state->card.tried(settings.renderer, replies.front().answer.trials);
  GstFlowReturn flow = GST_FLOW_OK;
  for (size_t i = 0; i < replies.size() && flow == GST_FLOW_OK; i++) {
    const lf::NodeStats::Stages& stages = replies[i].stages;
    if (stages.render > 0) kept.estimate.done(answered[i]->work, stages.decode + stages.render + stages.encode);
    flow = lf_fragment_send(self, pad, src, *answered[i], std::move(replies[i]));
  }
  return flow;
}

// A live one whose turn it is. Where a card draws several at once those of its set that wait go with it.
static std::optional<GstFlowReturn> lf_fragment_answer_with_set(LfFragment* self, GstPad* pad, GstPad* src,
                                                                const JobPtr& job, lf::Node::Requester& kept,
                                                                lf::ParallelFor parallel) {
  const bool alone = !self->state->card.draws_several(lf_fragment_settings(self).renderer);
  const std::vector<JobPtr> jobs = Requester::of(pad).waiting.take_with(job, alone);
  if (jobs.empty()) return std::nullopt;
  return lf_fragment_answer(self, pad, src, jobs, kept, std::move(parallel));
}

static void lf_fragment_answer_loop(gpointer data) {
  GstPad* src = GST_PAD(data);
  lf::guarded_buffer(src, [=] { return Requester::of(src).live_answers.work(src), GST_FLOW_OK; });
}

// Behind each request its command comes: two requests without one have a viewer that sends none.
static void lf_fragment_note_unfit(LfFragment* self, Requester& requester, lf::Access access) {
  constexpr unsigned kEnough = 2;
  if (requester.any_fits || ++requester.unfit != kEnough) return;
  const char* nick = lf::access_nick(access);
  GST_ELEMENT_WARNING(
      self, STREAM, WRONG_TYPE,
      ("access=%s: no %s commands come with the requests, so that these cameras answer none of them: set "
       "access=%s at the viewer's lfviewrequest, too, or access=self here.",
       nick, nick, nick),
      (nullptr));
}

// What is not for cameras of this kind, or asks for too much, is not even decoded.
static bool lf_fragment_is_to_be_answered(LfFragment* self, Requester& requester, std::span<const uint8_t> request) {
  const std::optional<lf::wire::RequestPeek> peek = lf::wire::peek_request(request);
  const lf::Access access = lf_fragment_settings(self).access;
  if (peek && lf::wire::access_of_type(peek->type).value_or(access) != access) {
    lf_fragment_note_unfit(self, requester, access);
    return false;
  }
  if (peek) requester.any_fits = true;
  return self->state->guard.admits(GST_ELEMENT(self), request, self->state->node.inputs().array()->extent,
                                   requester.place.is_live(), requester.number);
}

// Hands the request over to the answer pad's thread.
static GstFlowReturn lf_fragment_answer_later(LfFragment* self, GstPad* pad, GstPad* src, const JobPtr& job) {
  Requester& requester = Requester::of(pad);
  const GstClockTime max_delay = lf_fragment_settings(self).max_delay;
  if (max_delay > 0) job->due = lf::now_ns() + max_delay;
  bool dropped = false;
  const auto* const view = std::get_if<lf::ViewRequest>(&job->request);
  requester.waiting.add(job);
  const GstFlowReturn flow = requester.live_answers.add(
      src, lf::wire::head_of(job->request).view_id, job->work,
      [self, pad, src, job](lf::Node::Requester& kept, const lf::ParallelFor& parallel) {
        return lf_fragment_answer_with_set(self, pad, src, job, kept, parallel);
      },
      &dropped, view ? lf::views_that_wait_together(*view) : 1);
  // What has gone with its set is dropped without loss.
  const size_t lost = requester.waiting.forget_dropped();
  if (dropped) self->state->node.stats().superseded += lost;
  if (flow != GST_FLOW_FLUSHING && gst_pad_get_task_state(src) != GST_TASK_STARTED)
    gst_pad_start_task(src, lf_fragment_answer_loop, src, nullptr);
  return flow;
}

// Of the answer to a request, see lf::planned_work().
static double lf_fragment_work(LfFragment* self, std::span<const uint8_t> bytes, const lf::wire::AnyRequest& request) {
  const auto array = self->state->node.inputs().array();
  const size_t cameras = array->rig ? array->rig->cameras.size() : 0;
  double work = lf::planned_work(lf::wire::peek_request_cost(bytes), cameras);
  if (const auto* const warp = std::get_if<lf::wire::WarpCommand>(&request))
    for (const lf::FacePlan& face : warp->warp.faces)
      work += static_cast<double>(face.rect.width()) * face.rect.height();
  // Another mesh takes about as long as so many pixels for each camera.
  constexpr double kMeshCamera = 512;
  const auto* const view = std::get_if<lf::ViewRequest>(&request);
  if (view && !view->out_of_service.empty()) work += kMeshCamera * static_cast<double>(cameras);
  return work;
}

static GstFlowReturn lf_fragment_take_request(LfFragment* self, GstPad* pad, GstPad* src, GstBuffer* buffer) {
  Requester& requester = Requester::of(pad);
  const lf::MappedBuffer mapped(buffer);
  if (!lf_fragment_is_to_be_answered(self, requester, mapped.bytes())) return GST_FLOW_OK;
  std::string reason;
  std::optional<lf::wire::AnyRequest> request = lf::wire::decode_any_request(mapped.bytes(), &reason);
  if (!request) {
    self->state->node.stats().bad_requests++;
    GST_WARNING_OBJECT(pad, "dropped a view request: %s", reason.c_str());
    return GST_FLOW_OK;
  }
  lf_fragment_follow_requests(self, pad, lf::wire::head_of(*request));
  lf_fragment_tell_delay(self, pad);
  const double work = lf::WorkEstimate::kAnyAnswer + lf_fragment_work(self, mapped.bytes(), *request);
  const auto job = std::make_shared<Job>(Job{std::move(*request), GST_BUFFER_PTS(buffer), GST_BUFFER_DURATION(buffer),
                                             requester.compositor.look(src), work});
  if (requester.place.is_live()) return lf_fragment_answer_later(self, pad, src, job);
  return lf_fragment_answer(self, pad, src, {&job, 1}, requester.kept, lf_fragment_workers(self));
}

static GstFlowReturn lf_fragment_request_chain(GstPad* pad, GstObject* parent, GstBuffer* buffer) {
  const PadPtr src = Requester::of(pad).pads.src();
  const GstFlowReturn flow = !src ? GST_FLOW_FLUSHING : lf::guarded_buffer(parent, [&] {
    return lf_fragment_take_request(LF_FRAGMENT(parent), pad, src.get(), buffer);
  });
  gst_buffer_unref(buffer);
  return flow;
}

// --- Pairs of pads, one for each requester ---------------------------------------------------------------------------

static PadPtr lf_fragment_other_pad(GstPad* pad) { return Requester::of(pad).pads.other(pad); }

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

// Cameras that are not live end with the last requester.
static void lf_fragment_finish_if_all_ended(LfFragment* self) {
  lf::ObjectLock lock(self);
  bool any = false, all = true;
  for (Requester* requester : self->state->requesters) {
    any = any || requester->ended;
    all = all && (requester->ended || !gst_pad_is_linked(requester->pads.request().get()));
  }
  lock.unlock();
  using Mode = lf::CameraFrames::Mode;
  if (any && all) lf_fragment_set_mode(self, Mode::kFinished, Mode::kRunning);
}

static void lf_fragment_set_ended(LfFragment* self, Requester& requester, bool ended) {
  const lf::ObjectLock lock(self);
  requester.ended = ended;
}

static gboolean lf_fragment_request_event(GstPad* pad, GstObject* parent, GstEvent* event) {
  LfFragment* self = LF_FRAGMENT(parent);
  Requester& requester = Requester::of(pad);
  if (gst_event_type_get_flags(GST_EVENT_TYPE(event)) & GST_EVENT_TYPE_SERIALIZED) requester.live_answers.drain();
  switch (GST_EVENT_TYPE(event)) {
    case GST_EVENT_CAPS: {
      GstCaps* caps = lf::unit_caps(LF_ANSWER_MEDIA_TYPE);
      gst_event_unref(event);
      event = gst_event_new_caps(caps);
      gst_caps_unref(caps);
      requester.compositor.note_change();
      break;
    }
    case GST_EVENT_SEGMENT:
      requester.place.begin(lf::live_latency(pad).has_value());
      requester.compositor.note_change();
      break;
    case GST_EVENT_EOS:
      lf_fragment_set_ended(self, requester, true);
      lf_fragment_finish_if_all_ended(self);
      break;
    // First downstream, so that nobody gets an answer for which nothing was waited.
    case GST_EVENT_FLUSH_START: {
      const gboolean ok = lf_fragment_pair_event(pad, event);
      requester.live_answers.begin_flush();
      requester.waiting.forget_dropped();
      self->state->node.cancel(requester.kept, true);
      return ok;
    }
    case GST_EVENT_FLUSH_STOP:
      lf_fragment_set_ended(self, requester, false);
      requester.place.flush();
      requester.qos.clear();
      requester.kept.renderer.clear();
      requester.live_answers.end_flush();
      self->state->node.cancel(requester.kept, false);
      break;
    default: break;
  }
  return lf_fragment_pair_event(pad, event);
}

// Everything from downstream (QoS, navigation, latency) concerns the requester, never the cameras: what they take
// belongs to the capture, not to the request path.
static gboolean lf_fragment_src_event(GstPad* pad, GstObject*, GstEvent* event) {
  Requester& requester = Requester::of(pad);
  if (GST_EVENT_TYPE(event) == GST_EVENT_RECONFIGURE) requester.compositor.note_change();
  if (GST_EVENT_TYPE(event) == GST_EVENT_QOS) requester.qos.see(event, requester.place.is_live());
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
  lf::LiveAnswers& answers = Requester::of(pad).live_answers;
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

// The request pad of a new pair, both of whose pads have been added to the element.
static GstPad* lf_fragment_pair_new(LfFragment* self, GstPadTemplate* request_template, const gchar* request_name,
                             GstPadTemplate* src_template, const gchar* src_name) {
  static const GQuark quark = g_quark_from_static_string("lf-fragment-pair");
  GstPad* request = gst_pad_new_from_template(request_template, request_name);
  GstPad* src = gst_pad_new_from_template(src_template, src_name);
  lf::ObjectLock lock(self);
  const auto requester =
      std::make_shared<Requester>(request, src, self->state->next_requester++, lf_fragment_workers(self));
  self->state->requesters.insert(requester.get());
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
    gst_pad_set_element_private(pad, requester.get());
    g_object_set_qdata_full(G_OBJECT(pad), quark, new std::shared_ptr<Requester>(requester),
                            [](gpointer data) { delete static_cast<std::shared_ptr<Requester>*>(data); });
  }
  for (GstPad* pad : {src, request}) {
    if (lf::is_running(GST_ELEMENT(self))) gst_pad_set_active(pad, TRUE);
    gst_element_add_pad(GST_ELEMENT(self), pad);
  }
  return request;
}

// Takes both pads away; an answer that is being made ends at once.
static void lf_fragment_pair_release(LfFragment* self, GstPad* request) {
  Requester& requester = Requester::of(request);
  const PadPtr src = requester.pads.src();
  GST_OBJECT_LOCK(self);
  self->state->requesters.erase(&requester);
  GST_OBJECT_UNLOCK(self);
  gst_pad_set_active(src.get(), FALSE);  // an answer made without waiting goes nowhere
  self->state->node.cancel(requester.kept, true);
  gst_pad_set_active(request, FALSE);
  self->state->guard.forget(requester.number);
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
  for (Requester* requester : self->state->requesters) {
    requester->memory->trim();
    requester->kept.images->trim();
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
    // Only when its streaming thread is out nothing of it comes back.
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
    GST_ELEMENT_ERROR(self, RESOURCE, SETTINGS, ("No rig file given: set the property \"rig\"."), (nullptr));
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
  state.guard.start(GST_ELEMENT(self));
  lf::ObjectLock lock(self);
  for (Requester* requester : state.requesters) {
    requester->ended = false;
    requester->place.clear();
    requester->delay.clear();
    requester->qos.clear();
    requester->kept.rig.reset();
    *requester->kept.cancelled = false;
  }
  lock.unlock();
  lf_fragment_set_mode(self, lf::CameraFrames::Mode::kRunning);
  // A camera that the application names counts from the start on: its weight is lost in a sum until it has a frame.
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
  // Pads are deactivated by the parent class, which waits for their streaming threads: wake these first.
  if (transition == GST_STATE_CHANGE_PAUSED_TO_READY) lf_fragment_set_mode(self, lf::CameraFrames::Mode::kStopped);
  const GstStateChangeReturn result = GST_ELEMENT_CLASS(lf_fragment_parent_class)->change_state(element, transition);
  if (transition != GST_STATE_CHANGE_PAUSED_TO_READY) return result;
  for (const PadPtr& pad : lf_fragment_camera_pads(self)) LF_FRAGMENT_PAD(pad.get())->input->reset();
  // Downstream's context is not to outlive what it is for. Without the lock, as that takes its time.
  std::vector<lf::NearCompositor> forgotten;
  self->state->card.leave();
  lf_fragment_note_context(self, nullptr);
  const lf::ObjectLock lock(self);
  for (Requester* requester : self->state->requesters) forgotten.push_back(requester->compositor.forget());
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
  gst_element_class_set_static_metadata(
      element_class, "Light field random access camera", "Filter/Video",
      "Answers view requests with the sum of what its cameras contribute to the requested view",
      "gst-lightfield developers");
}

static void lf_fragment_init(LfFragment* self) {
  self->state = new _LfFragment::State;
  GstElementClass* klass = GST_ELEMENT_GET_CLASS(self);
  lf_fragment_pair_new(self, gst_element_class_get_pad_template(klass, "request"), "request",
                       gst_element_class_get_pad_template(klass, "src"), "src");
}
