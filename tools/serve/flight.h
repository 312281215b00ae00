// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include <gst/app/app.h>
#include <nlohmann/json.hpp>

#include "serve/adaptation.h"
#include "serve/browser_stream.h"
#include "serve/viewer_pipeline.h"

namespace lf::serve {

class Watcher;

// A flight along a camera path, which is rendered and encoded once for all of its watchers. The video has two sizes:
// the size of the path, and half this size for watchers with a slow network. The half size is encoded only while there
// is such a watcher.
//
// Main thread, unless stated otherwise. The destructor may run on any thread and may be slow.
class Flight {
 public:
  enum Size { kFull, kHalf, kSizes };

  // `settings.params` must contain the path and the size of its views. Throws Error.
  Flight(LightField& field, VideoCodec codec, const ViewSettings& settings);
  ~Flight();
  Flight(const Flight&) = delete;

  GstClockTime base_time() const { return gst_element_get_base_time(pipeline_); }
  int max_bit_rate() const { return settings_.max_bit_rate(); }
  // Delivers all further pictures of this size to the watcher. The first watcher starts the flight.
  void deliver(Watcher* watcher, Size size);
  void leave(Watcher* watcher);  // When this function has returned, the watcher gets no more pictures.
  void request_key_frame(Size size) { wants_key_frame_[size] = true; }  // thread-safe

  void update_rig() { view_pipeline_->set_rig(field_.rig()); }
  void shed(const LoadShedding& load_shedding);
  ViewerPipeline& view_pipeline() { return *view_pipeline_; }
  double kept() { return view_pipeline_->kept(); }
  ViewerCounters counters() const;
  // Returns the error that has stopped the flight, or "".
  const std::string& problem();
  // Updates the statistics. Call this once a second.
  void tick();
  const LoadShedding& load_shedding() const { return load_shedding_; }
  const nlohmann::json& statistics() const { return statistics_; }

 private:
  // A key frame has several times the bytes of another picture, so many watchers may not cause more than this.
  static constexpr int64_t kKeyFrameInterval = 1000000;  // microseconds

  struct Output {
    Flight* flight = nullptr;
    Size size = kFull;
    GstElement* encoder = nullptr;
    int64_t last_key_frame = 0;  // thread of the encoder only
    std::atomic<uint64_t> pictures = 0;
  };
  static std::string launch_line(size_t nodes, VideoCodec codec, const ViewSettings& settings);
  static GstFlowReturn take_picture(GstAppSink* sink, gpointer data);
  static GstPadProbeReturn before_encoder(GstPad* pad, GstPadProbeInfo* info, gpointer data);
  // Encodes the half size only while a watcher gets it. The caller holds mutex_.
  void open_valve();

  LightField& field_;
  const ViewSettings settings_;
  GstElement *pipeline_ = nullptr, *valve_ = nullptr;
  std::array<Output, kSizes> outputs_;
  std::unique_ptr<ViewerPipeline> view_pipeline_;
  std::array<std::atomic<bool>, kSizes> wants_key_frame_ = {};
  std::string problem_;
  nlohmann::json statistics_ = nlohmann::json::object();
  LoadShedding load_shedding_;
  bool started_ = false;
  std::mutex mutex_;
  std::map<Watcher*, Size> watchers_;  // guarded by mutex_
};

// A browser that watches a flight. Its pipeline only makes RTP packets of the encoded pictures and encrypts them.
class Watcher : public BrowserStream {
 public:
  Watcher(LightField& field, Offer offer, std::shared_ptr<Flight> flight, const Route& route, Callbacks callbacks);
  ~Watcher() override;
  void leave() override;
  ViewerCounters counters() const override;
  // Sends an encoded picture. Called by the flight on a streaming thread; never blocks.
  void take(Flight::Size size, GstBuffer* picture, GstCaps* caps);
  void notify_of_rig();

 private:
  static constexpr guint64 kMaxQueued = 30;  // pictures that wait for the network

  void control(const std::string& text) override;
  void report(const LinkReport& link) override;
  bool key_frame_requested() override;
  void start_video() override;

  const std::shared_ptr<Flight> flight_;
  GstAppSrc* source_ = nullptr;
  QualityControl quality_;
  std::atomic<Flight::Size> size_ = Flight::kFull;
  // The size of the last sent picture. A picture of another size must be a key frame. kSizes: no picture can follow
  // without a key frame.
  Flight::Size sent_size_ = Flight::kSizes;  // threads of the flight only
  uint64_t video_bytes_reported_ = 0;
  std::atomic<uint64_t> refused_messages_ = 0;
};

}  // namespace lf::serve
