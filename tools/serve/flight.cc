// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/flight.h"

#include <algorithm>
#include <sstream>

#include <gst/video/video.h>

#include "serve/control_message.h"
#include "serve/pipelines.h"

namespace lf::serve {
namespace {

constexpr char kSource[] = "appsrc name=pictures is-live=true format=time max-bytes=0 max-buffers=0 min-latency=0 ! ";
constexpr int kMinBitRate = 100000;

}  // namespace

std::string Flight::launch_line(size_t nodes, VideoCodec codec, const ViewSettings& settings) {
  ViewSettings half = settings;
  half.params.width = settings.params.width / 4 * 2;
  half.params.height = settings.params.height / 4 * 2;
  // Watchers join at any time, so each key frame must contain the parameters of the decoder.
  const std::string out = std::string(" ! capsfilter caps=") +
                          (codec == VideoCodec::kH264 ? "video/x-h264,stream-format=byte-stream" : "video/x-vp8") +
                          " ! appsink sync=false async=false enable-last-sample=false name=out";
  const std::string queue = " queue leaky=downstream max-size-buffers=1 max-size-bytes=0 max-size-time=0 ! ";
  std::ostringstream line;
  line << ViewerPipeline::launch_line(nodes) << "tee name=sizes  sizes. !" << queue
       << encoder_line(codec, settings.max_bit_rate(), "encoder0") << out << "0  sizes. !" << queue
       << "valve name=half drop=true ! videoscale ! video/x-raw,width=" << half.params.width
       << ",height=" << half.params.height << " ! " << encoder_line(codec, half.max_bit_rate(), "encoder1") << out
       << '1';
  return line.str();
}

Flight::Flight(LightField& field, VideoCodec codec, const ViewSettings& settings) : field_(field), settings_(settings) {
  pipeline_ = GST_ELEMENT(gst_object_ref_sink(launch(launch_line(field.nodes(), codec, settings), false)));
  valve_ = gst_bin_get_by_name(GST_BIN(pipeline_), "half");
  for (const Size size : {kFull, kHalf}) {
    outputs_[size].flight = this;
    outputs_[size].size = size;
    outputs_[size].encoder = gst_bin_get_by_name(GST_BIN(pipeline_), size == kFull ? "encoder0" : "encoder1");
    g_autoptr(GstPad) pad = gst_element_get_static_pad(outputs_[size].encoder, "sink");
    gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, before_encoder, &outputs_[size], nullptr);
    g_autoptr(GstElement) sink = gst_bin_get_by_name(GST_BIN(pipeline_), size == kFull ? "out0" : "out1");
    GstAppSinkCallbacks callbacks = {};
    callbacks.new_sample = take_picture;
    gst_app_sink_set_callbacks(GST_APP_SINK(sink), &callbacks, &outputs_[size], nullptr);
  }
  view_pipeline_ = std::make_unique<ViewerPipeline>(pipeline_, field, settings, [](GstClockTime) {});
  gst_pipeline_use_clock(GST_PIPELINE(pipeline_), field.clock());
  gst_element_set_start_time(pipeline_, GST_CLOCK_TIME_NONE);
  gst_element_set_base_time(pipeline_, request_base_time(field.clock(), settings));
}

Flight::~Flight() {
  view_pipeline_->close();
  gst_element_set_state(pipeline_, GST_STATE_NULL);
  view_pipeline_.reset();
  for (const Output& output : outputs_) gst_object_unref(output.encoder);
  gst_object_unref(valve_);
  gst_object_unref(pipeline_);
}

void Flight::deliver(Watcher* watcher, Size size) {
  {
    const std::lock_guard lock(mutex_);
    watchers_[watcher] = size;
    open_valve();
  }
  request_key_frame(size);
  if (!started_) gst_element_set_state(pipeline_, GST_STATE_PLAYING);
  started_ = true;
}

void Flight::leave(Watcher* watcher) {
  const std::lock_guard lock(mutex_);
  watchers_.erase(watcher);
  open_valve();
}

void Flight::open_valve() {
  const bool is_half = std::ranges::any_of(watchers_, [](const auto& entry) { return entry.second == kHalf; });
  g_object_set(valve_, "drop", static_cast<gboolean>(!is_half), nullptr);
}

GstPadProbeReturn Flight::before_encoder(GstPad*, GstPadProbeInfo*, gpointer data) {
  auto& [flight, size, encoder, last, pictures] = *static_cast<Output*>(data);
  const int64_t now = g_get_monotonic_time();
  if (now - last < kKeyFrameInterval || !flight->wants_key_frame_[size].exchange(false)) return GST_PAD_PROBE_OK;
  last = now;
  gst_element_send_event(encoder, gst_video_event_new_upstream_force_key_unit(GST_CLOCK_TIME_NONE, TRUE, 0));
  return GST_PAD_PROBE_OK;
}

// All watchers share the memory of a picture. Its timestamp becomes the running time, because x264enc shifts its
// segment.
GstFlowReturn Flight::take_picture(GstAppSink* sink, gpointer data) {
  auto& [flight, size, encoder, last, pictures] = *static_cast<Output*>(data);
  g_autoptr(GstSample) sample = gst_app_sink_pull_sample(sink);
  GstBuffer* encoded = sample ? gst_sample_get_buffer(sample) : nullptr;
  if (!encoded) return GST_FLOW_OK;
  g_autoptr(GstBuffer) picture = gst_buffer_new();
  gst_buffer_copy_into(picture, encoded, GstBufferCopyFlags(GST_BUFFER_COPY_FLAGS | GST_BUFFER_COPY_MEMORY), 0, -1);
  GST_BUFFER_PTS(picture) =
      gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, GST_BUFFER_PTS(encoded));
  pictures++;
  const std::lock_guard lock(flight->mutex_);
  for (const auto& [watcher, wanted] : flight->watchers_)
    if (wanted == size) watcher->take(size, picture, gst_sample_get_caps(sample));
  return GST_FLOW_OK;
}

void Flight::shed(const LoadShedding& load_shedding) {
  load_shedding_ = load_shedding;
  view_pipeline_->reduce(load_shedding.pictures_left_out(), load_shedding.depth_interval());
}

ViewerCounters Flight::counters() const {
  ViewerCounters counters = view_pipeline_->counters();
  counters.encoded = outputs_[kFull].pictures;
  counters.encoded_half = outputs_[kHalf].pictures;
  return counters;
}

const std::string& Flight::problem() {
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_);
  while (g_autoptr(GstMessage) message = gst_bus_pop(bus)) {
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR && problem_.empty()) problem_ = text_of(message);
    if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_LATENCY) gst_bin_recalculate_latency(GST_BIN(pipeline_));
  }
  return problem_;
}

void Flight::tick() {
  statistics_ = view_pipeline_->statistics();
  statistics_["encoder"] = GST_OBJECT_NAME(gst_element_get_factory(outputs_[kFull].encoder));
  statistics_["frameRate"] = settings_.limits.framerate / (1 + load_shedding_.pictures_left_out());
  const std::lock_guard lock(mutex_);
  statistics_["watchers"] = watchers_.size();
}

Watcher::Watcher(LightField& field, Offer offer, std::shared_ptr<Flight> flight, const Route& route,
                 Callbacks callbacks)
    : BrowserStream(field, kSource + payloader_line(offer), std::move(callbacks)),
      flight_(std::move(flight)),
      quality_(std::min(kMinBitRate, flight_->max_bit_rate()), flight_->max_bit_rate(), 0) {
  source_ = GST_APP_SRC(gst_bin_get_by_name(GST_BIN(video_), "pictures"));
  connect(std::move(offer), route, flight_->base_time());
  peer_->set_bit_rate(flight_->max_bit_rate());
}

Watcher::~Watcher() {
  stop();
  gst_object_unref(source_);
}

void Watcher::start_video() {
  BrowserStream::start_video();
  flight_->deliver(this, size_);
}

void Watcher::leave() {
  flight_->leave(this);
  BrowserStream::leave();
}

void Watcher::take(Flight::Size size, GstBuffer* picture, GstCaps* caps) {
  if (gst_app_src_get_current_level_buffers(source_) >= kMaxQueued) {
    sent_size_ = Flight::kSizes;
    return;
  }
  if (size != sent_size_ && GST_BUFFER_FLAG_IS_SET(picture, GST_BUFFER_FLAG_DELTA_UNIT))
    return flight_->request_key_frame(size);
  sent_size_ = size;
  g_autoptr(GstSample) sample = gst_sample_new(picture, caps, nullptr, nullptr);
  gst_app_src_push_sample(source_, sample);
}

bool Watcher::key_frame_requested() {
  flight_->request_key_frame(size_);
  return false;
}

// The path determines the view, so there is nothing to control.
void Watcher::control(const std::string&) { refused_messages_++; }

void Watcher::report(const LinkReport& link) {
  quality_.update(link.loss, link.round_trip);
  const int bits = quality_.bits_per_second(), most = flight_->max_bit_rate();
  const Flight::Size size = bits <= most / 2 ? Flight::kHalf : bits >= most ? Flight::kFull : size_.load();
  if (size_.exchange(size) != size) flight_->deliver(this, size);
  const int divisor = size == Flight::kFull ? 1 : 2;
  nlohmann::json info = flight_->statistics();
  info.update({{"videoBytes", video_bytes_.load()},
               {"bitRate", size == Flight::kFull ? most : most / 4},
               {"sizeDivisor", divisor},
               {"shed", shed_report(flight_->load_shedding(), flight_->load_shedding().pictures_left_out(), divisor)},
               {"sentRate", 8 * (video_bytes_ - video_bytes_reported_)},
               {"busy", busy_},
               {"loss", link.loss},
               {"roundTripMs", link.round_trip * 1e3}});
  video_bytes_reported_ = video_bytes_;
  peer_->send(info_message(nlohmann::json{{"statistics", std::move(info)}}));
}

void Watcher::notify_of_rig() {
  if (connected()) peer_->send(info_message(nlohmann::json{{"rig", field_.array()->hash()}}));
}

ViewerCounters Watcher::counters() const {
  return {.video_bytes = video_bytes_, .refused_messages = refused_messages_};
}

}  // namespace lf::serve
