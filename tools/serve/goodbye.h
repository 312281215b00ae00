// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>

#include <gst/gst.h>

namespace lf::serve {

// Waits until the end of a DTLS connection has left: another thread sends it, which must not be stopped before.
class Goodbye {
 public:
  static GstPadProbeReturn on_packet(GstPad*, GstPadProbeInfo* info, gpointer data) {
    constexpr guint8 kAlert = 21;  // DTLS ContentType, RFC 6347
    guint8 type = 0;
    if (gst_buffer_extract(GST_PAD_PROBE_INFO_BUFFER(info), 0, &type, 1) == 1 && type == kAlert)
      (*static_cast<std::shared_ptr<Goodbye>*>(data))->note();
    return GST_PAD_PROBE_OK;
  }
  void wait() {
    constexpr std::chrono::milliseconds kLongest{250};
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kLongest, [this] { return has_left_; });
  }

 private:
  void note() {
    const std::lock_guard lock(mutex_);
    has_left_ = true;
    changed_.notify_all();
  }
  std::mutex mutex_;
  std::condition_variable changed_;
  bool has_left_ = false;
};

}  // namespace lf::serve
