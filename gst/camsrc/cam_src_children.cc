// SPDX-License-Identifier: LGPL-2.1-or-later
#include "camsrc/cam_src_children.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "base/schedule.h"
#include "camsrc/camera_chain.h"
#include "common/common.h"
#include "common/gst_pointers.h"
#include "common/guard.h"
#include "rig/camera_source.h"
#include "rig/source_security.h"

namespace lf {
namespace {

bool is_decoder(GstElement* child) { return gst_element_is_locked_state(child); }

// Time limit for stopping a child, because rtspsrc may wait for an unresponsive server. Cameras stop one after another,
// so the limit is shorter for a while after a timeout.
constexpr std::chrono::milliseconds kStopTimeout{2000}, kShortTimeout{200};
constexpr std::chrono::seconds kMoment{20};

std::chrono::milliseconds patience(bool was_late) {
  static std::mutex mutex;
  static std::chrono::steady_clock::time_point late_until;
  const std::lock_guard lock(mutex);
  const auto now = std::chrono::steady_clock::now();
  const auto result = now < late_until ? kShortTimeout : kStopTimeout;
  if (was_late) late_until = now + kMoment;
  return result;
}

// Stops a child. After a timeout the child is removed from the bin, and a background thread finishes the stop.
GstStateChangeReturn stop_child(GstBin* bin, GstElement* child, GstState state) {
  struct Stop {
    std::mutex mutex;
    std::condition_variable done;
    std::optional<GstStateChangeReturn> result;
    bool is_late = false;
  };
  const auto stop = std::make_shared<Stop>();
  std::thread([stop, state, camera = gst_object_ref(bin), element = GST_ELEMENT(gst_object_ref(child))] {
    const GstStateChangeReturn result = gst_element_set_state(element, state);
    std::unique_lock lock(stop->mutex);
    if (!stop->is_late) {
      gst_object_unref(element);
      gst_object_unref(camera);
      stop->result = result;
      stop->done.notify_all();
      return;
    }
    lock.unlock();
    gst_element_set_state(element, GST_STATE_NULL);
    gst_object_unref(element);
    gst_object_unref(camera);
  }).detach();
  std::unique_lock lock(stop->mutex);
  if (stop->done.wait_for(lock, patience(false), [&] { return stop->result.has_value(); })) return *stop->result;
  stop->is_late = true;
  lock.unlock();
  patience(true);
  g_signal_handlers_destroy(child);  // new pads must not be linked
  gst_bin_remove(bin, child);
  return GST_STATE_CHANGE_SUCCESS;
}

void continue_decoder(GstElement* camera, gpointer decoder) {
  GST_STATE_LOCK(camera);
  if (GST_STATE_TARGET(camera) == GST_STATE_PLAYING && GST_STATE(camera) >= GST_STATE_PAUSED &&
      gst_object_has_as_parent(GST_OBJECT(decoder), GST_OBJECT(camera)))
    gst_element_set_state(GST_ELEMENT(decoder), GST_STATE_PLAYING);
  GST_STATE_UNLOCK(camera);
}

void remove_child(GstBin* bin, GstElement* child) {
  if (is_decoder(child))
    stop_child(bin, child, GST_STATE_NULL);
  else
    gst_element_set_state(child, GST_STATE_NULL);
  if (gst_object_has_as_parent(GST_OBJECT(child), GST_OBJECT(bin))) gst_bin_remove(bin, child);
}

}  // namespace

void lock_decoder(GstBin* /*bin*/, GstElement* child) {
  if (GST_IS_BIN(child)) gst_element_set_locked_state(child, TRUE);
}

GstStateChangeReturn set_child_states(GstBin* bin, GstState state, bool only_decoders) {
  GstStateChangeReturn result = GST_STATE_CHANGE_SUCCESS;
  for (const ElementPtr& owned : take_elements(gst_bin_iterate_elements(bin))) {
    GstElement* const child = owned.get();
    if (only_decoders && !is_decoder(child)) continue;
    gst_element_set_base_time(child, gst_element_get_base_time(GST_ELEMENT(bin)));
    gst_element_set_start_time(child, gst_element_get_start_time(GST_ELEMENT(bin)));
    const bool stops = is_decoder(child) && state < GST_STATE(child) && state <= GST_STATE_READY;
    const GstStateChangeReturn one = stops ? stop_child(bin, child, state) : gst_element_set_state(child, state);
    if (result != GST_STATE_CHANGE_FAILURE && one != GST_STATE_CHANGE_ASYNC && one != GST_STATE_CHANGE_SUCCESS)
      result = one;
  }
  return result;
}

GstStateChangeReturn change_camera_state(GstBin* bin, GstStateChange transition,
                                         GstStateChangeReturn (*chain_up)(GstElement*, GstStateChange)) {
  const GstState next = GST_STATE_TRANSITION_NEXT(transition);
  // Downstream elements must start first, but GstBin handles its children in any order. Therefore decoders are started
  // last and stopped first.
  const bool decoders_last = next <= GST_STATE_PAUSED && GST_STATE_TRANSITION_CURRENT(transition) < next;
  if (!decoders_last) set_child_states(bin, next, true);
  GstStateChangeReturn result = chain_up(GST_ELEMENT(bin), transition);
  // GstBin reports the last result of locked children. Only locked children change state asynchronously.
  if (result == GST_STATE_CHANGE_ASYNC) result = GST_STATE_CHANGE_SUCCESS;
  if (!decoders_last || result == GST_STATE_CHANGE_FAILURE) return result;
  const GstStateChangeReturn decoders = set_child_states(bin, next, true);
  return decoders == GST_STATE_CHANGE_SUCCESS ? result : decoders;
}

bool take_decoder_message(GstBin* bin, GstMessage* message) {
  const GstMessageType type = GST_MESSAGE_TYPE(message);
  if (type != GST_MESSAGE_ASYNC_START && type != GST_MESSAGE_ASYNC_DONE) return false;
  if (type == GST_MESSAGE_ASYNC_DONE && GST_IS_ELEMENT(GST_MESSAGE_SRC(message)))
    gst_element_call_async(GST_ELEMENT(bin), callback<continue_decoder>, gst_object_ref(GST_MESSAGE_SRC(message)),
                           gst_object_unref);
  gst_message_unref(message);
  return true;
}

}  // namespace lf

namespace {

using Kind = lf::CameraSource::Kind;

std::shared_ptr<const lf::Rig> open_rig(const std::string& path) {
  if (path.empty()) throw lf::Error("rig: not set (rig=RIG.json names the array's rig file)");
  if (!g_file_test(path.c_str(), G_FILE_TEST_EXISTS)) throw lf::MissingFile(path + ": no such file");
  return lf::shared_rig(path);
}

lf::CameraSource find_source(const lf::Rig& rig, const lf::CamSrcSettings& settings, const lf::Camera& camera,
                             const std::string& place) {
  try {
    if (!lf::find_camera_source(rig, camera).is_file()) lf::require_trust(camera, settings.rig, settings.trusted);
    return lf::find_playable_source(rig, camera);
  } catch (const lf::MissingFile& error) {
    throw lf::MissingFile(place + ": " + error.what());
  } catch (const lf::Error& error) {
    throw lf::Error(place + ": " + error.what());
  }
}

std::string place_of(const lf::CamSrcSettings& settings, const lf::Camera& camera) {
  std::string place = settings.rig + ": camera " + std::to_string(camera.id);
  if (!camera.name.empty()) place += " (" + camera.name + ")";
  return place;
}

lf::Controls controls_of(const lf::CamSrcSettings& settings, const lf::Camera& camera) {
  const auto all = lf::load_controls(settings.rig);
  const auto own = all.find(camera.id);
  return own == all.end() ? lf::Controls{} : own->second;
}

lf::CameraChain build_chain(LfCamSrc* self, const lf::CameraSource& source, const lf::Camera& camera,
                            const lf::CamSrcSettings& settings, const lf::Controls& controls,
                            const std::string& place) {
  try {
    return lf::build_camera_chain(GST_BIN(self), source, camera, settings, controls);
  } catch (const lf::MissingElement&) {
    throw;
  } catch (const lf::Error& error) {
    throw lf::Error(place + ": " + error.what());
  }
}

// The built-in scene between real pictures would be a ghost in every view, so a warning is required. The first camera
// without pictures warns for all cameras; if no camera has pictures, lfcameranode warns.
void warn_of_scene(LfCamSrc* self, const lf::Rig& rig, lf::CameraIndex index, const std::string& place) {
  const auto is_blind = [](const lf::Camera& camera) { return camera.source.empty() && camera.image.empty(); };
  if (lf::has_no_pictures(rig)) return;
  if (std::ranges::find_if(rig.cameras, is_blind) != rig.cameras.begin() + index) return;
  const auto count = std::ranges::count_if(rig.cameras, is_blind);
  const std::string who = place + (count > 1 ? " and " + std::to_string(count - 1) + " more name" : " names");
  GST_ELEMENT_WARNING(self, RESOURCE, NOT_FOUND,
                      ("%s neither an image nor a source: the built-in scene is shown. Add a source or an image to "
                       "each camera in the rig file",
                       who.c_str()),
                      (nullptr));
}

void add_children(LfCamSrc* self, const lf::CamSrcSettings& settings, const std::shared_ptr<const lf::Rig>& rig,
                  lf::CameraIndex index) {
  const lf::Camera& camera = rig->cameras[index];
  std::string place = place_of(settings, camera);
  const lf::CameraSource source = find_source(*rig, settings, camera, place);
  if (source.kind == Kind::kScene) warn_of_scene(self, *rig, index, place);
  if (!source.location.empty()) place += ": " + lf::redacted_location(source.location);
  const bool file = source.is_file() && source.kind != Kind::kStill;
  const bool device = source.kind == Kind::kDevice || source.kind == Kind::kBin;
  const bool network = device || source.kind == Kind::kUri;
  // Data of an HTTP stream must arrive before the element can determine whether the stream is live.
  self->live = self->live || (network && !g_str_has_prefix(source.location.c_str(), "http"));

  const lf::Controls controls = controls_of(settings, camera);
  const lf::CameraChain chain = build_chain(self, source, camera, settings, controls, place);
  const bool may_be_lost = lf_cam_src_may_be_lost(self);
  const bool skips_late = self->service->report().retries > 0 && file && settings.is_live;
  const bool paced = settings.is_live && !network && !skips_late;
  (*self->shedder)->restart(paced);
  const gint64 num_buffers =
      settings.num_buffers < 0 ? settings.num_buffers : std::max<gint64>(0, settings.num_buffers - self->frames);
  auto stream = std::make_shared<lf::CameraStream>(
      self, chain,
      lf::StreamOptions{.serial = static_cast<guint>(g_atomic_int_get(&self->serial)),
                        .camera = index,
                        .rig_hash = rig->hash(),
                        .width = camera.width,
                        .height = camera.height,
                        .time_offset = camera.time_offset,
                        .num_buffers = num_buffers,
                        .seek_to_loop = settings.loop && (source.kind == Kind::kMatroska ||
                                                          source.kind == Kind::kFile || source.kind == Kind::kUri),
                        .has_end = !may_be_lost || (file && !settings.loop) || (!file && !network),
                        .may_be_lost = may_be_lost,
                        .skips_late = skips_late,
                        .round = self->round,
                        .paced = paced,
                        .begin = self->live ? 0 : self->end,
                        .shedder = *self->shedder,
                        .tap = *self->tap,
                        .place = place});
  stream->watch();
  if (settings.is_live) stream->set_live();
  gst_ghost_pad_set_target(GST_GHOST_PAD(self->src), chain.out);
  std::string wanted;
  if (device) {
    wanted = std::to_string(camera.width) + "x" + std::to_string(camera.height);
    if (settings.fps_n > 0)
      wanted += " at " + std::to_string(settings.fps_n) + "/" + std::to_string(settings.fps_d) + " frames/s";
  }
  auto* run = new CamSrcSession{settings, rig, controls, chain, stream, wanted};
  const lf::ObjectLock lock(self);
  self->run = run;
}

GstElement* first_child(GstBin* bin) {
  const lf::ObjectLock lock(bin);
  return bin->children ? GST_ELEMENT(gst_object_ref(bin->children->data)) : nullptr;
}

template <typename F>
std::unique_ptr<CamSrcFailure> failure_of(F&& what) {
  const auto failure = [](GQuark domain, gint code, const std::string& text) {
    return std::make_unique<CamSrcFailure>(CamSrcFailure{domain, code, text, ""});
  };
  try {
    what();
    return nullptr;
  } catch (const lf::MissingFile& error) {
    return failure(GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_NOT_FOUND, error.what());
  } catch (const lf::MissingElement& error) {
    return failure(GST_CORE_ERROR, GST_CORE_ERROR_MISSING_PLUGIN,
                   std::string("element ") + error.what() + " is not installed");
  } catch (const lf::Error& error) {
    return failure(GST_RESOURCE_ERROR, GST_RESOURCE_ERROR_SETTINGS, error.what());
  } catch (const std::exception& error) {
    return failure(GST_LIBRARY_ERROR, GST_LIBRARY_ERROR_FAILED, error.what());
  }
}

// Stops the thread of imagefreeze first, because imagefreeze resets its frame rate before it stops the thread, which
// may then divide by zero.
void stop_tail(const lf::CameraChain& chain) {
  for (auto element = chain.tail.rbegin(); element != chain.tail.rend(); ++element) {
    g_autoptr(GstPad) src = gst_element_get_static_pad(*element, "src");
    gst_pad_set_active(src, FALSE);
    gst_element_set_state(*element, GST_STATE_READY);
  }
}

}  // namespace

void lf_cam_src_stop_flow(LfCamSrc* self) {
  if (!self->run) return;
  self->run->stream->stop();
  if (self->run->used) stop_tail(self->run->chain);
}

void lf_cam_src_close(LfCamSrc* self) {
  lf_cam_src_stop_flow(self);
  gst_ghost_pad_set_target(GST_GHOST_PAD(self->src), nullptr);
  while (const lf::ElementPtr child{first_child(GST_BIN(self))}) lf::remove_child(GST_BIN(self), child.get());
  lf::ObjectLock lock(self);
  CamSrcSession* run = std::exchange(self->run, nullptr);
  lock.unlock();
  if (run) {
    self->end = run->stream->ends_at();
    self->round = run->stream->round();
    self->frames += static_cast<gint64>(run->stream->frames_out());
  }
  delete run;
}

// Refuses rigs that contain themselves. A camera may be a view of another light field, so such a rig would recurse
// without end. The function counts the enclosing cameras.
static void require_shallow(LfCamSrc* self) {
  constexpr int kMaxInside = 1;
  int inside = 0;
  lf::ObjectPtr<GstObject> object(gst_object_get_parent(GST_OBJECT(self)));
  for (; object; object.reset(gst_object_get_parent(object.get()))) inside += LF_IS_CAM_SRC(object.get());
  if (inside > kMaxInside)
    throw lf::Error(
        "cameras are nested views of light fields: does a rig contain itself? Use "
        "a device or a file as the source of the camera, instead of lf:///...");
}

bool lf_cam_src_open(LfCamSrc* self, std::unique_ptr<CamSrcFailure>* failure) {
  lf_cam_src_close(self);
  g_atomic_int_inc(&self->serial);
  lf::ObjectLock lock(self);
  const lf::CamSrcSettings settings = *self->settings;
  lock.unlock();
  std::shared_ptr<const lf::Rig> rig;
  lf::CameraIndex index = 0;
  *failure = failure_of([&] {
    require_shallow(self);
    rig = open_rig(settings.rig);
    const auto found = rig->index_of_id(settings.camera);
    if (!found) throw lf::Error(settings.rig + ": has no camera " + std::to_string(settings.camera));
    index = *found;
  });
  if (*failure) return false;
  lf::ObjectLock again(self);
  self->camera = rig->cameras[index].id;
  *self->name = rig->cameras[index].name;
  again.unlock();
  self->live = self->live || settings.is_live;
  *failure = failure_of([&] { add_children(self, settings, rig, index); });
  if (*failure) lf_cam_src_close(self);
  return true;
}

void lf_cam_src_start_tail(const lf::CameraChain& chain) {
  for (auto element = chain.tail.rbegin(); element != chain.tail.rend(); ++element)
    gst_element_set_state(*element, GST_STATE_PAUSED);
}
