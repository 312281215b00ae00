// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#if LF_HAS_RTSP_SERVER
#include <gst/rtsp-server/rtsp-server.h>
#endif

#include "gst/camera_files.h"

namespace lf::test {

#if LF_HAS_RTSP_SERVER
inline constexpr const char* kRtspServerMissing = nullptr;

// Serves white pictures of 64x48 at 30 frames/s as /jpeg and, if an encoder exists, /h264; /undated is JPEG without
// sender reports.
class RtspServer {
 public:
  // `port`: port of a destroyed RtspServer to reuse; 0: any.
  explicit RtspServer(int port = 0)
      : context_(g_main_context_new()), loop_(g_main_loop_new(context_, FALSE)), server_(gst_rtsp_server_new()) {
    gst_rtsp_server_set_address(server_, "127.0.0.1");
    gst_rtsp_server_set_service(server_, std::to_string(port).c_str());
    // Clients are served in the server's own loop; stop() closes them in the same loop.
    g_autoptr(GstRTSPThreadPool) threads = gst_rtsp_server_get_thread_pool(server_);
    gst_rtsp_thread_pool_set_max_threads(threads, 0);
    mount("/jpeg", "jpegenc ! rtpjpegpay name=pay0");
    mount("/undated", "jpegenc ! rtpjpegpay name=pay0", false);
    mount("/h264", CameraFiles::h264_encoder() + " ! rtph264pay name=pay0");
    gst_rtsp_server_attach(server_, context_);
    thread_ = std::thread([this] {
      g_main_context_push_thread_default(context_);
      g_main_loop_run(loop_);
      g_main_context_pop_thread_default(context_);
    });
  }
  ~RtspServer() {
    if (thread_.joinable()) stop();
  }
  // Closes all connections and ends the server, in the server's loop. gst-rtsp-server has no lock between a thread that
  // closes a connection and one that reads from it; such a read is a GLib critical.
  void stop() {
    GSource* quit = g_idle_source_new();
    g_source_set_callback(
        quit,
        [](gpointer data) -> gboolean {
          const auto* self = static_cast<RtspServer*>(data);
          gst_rtsp_server_client_filter(
              self->server_, [](GstRTSPServer*, GstRTSPClient*, gpointer) { return GST_RTSP_FILTER_REMOVE; }, nullptr);
          g_main_loop_quit(self->loop_);
          return G_SOURCE_REMOVE;
        },
        this, nullptr);
    g_source_attach(quit, context_);
    g_source_unref(quit);
    thread_.join();
    g_object_unref(server_);
    g_main_loop_unref(loop_);
    g_main_context_unref(context_);
  }
  GstRTSPServer* server() const { return server_; }
  // Call after the last server is destroyed.
  static void clean_up() { gst_rtsp_thread_pool_cleanup(); }
  std::string uri(const std::string& path) const { return "rtsp://127.0.0.1:" + std::to_string(port()) + path; }
  int port() const { return gst_rtsp_server_get_bound_port(server_); }

 private:
  static void disable_sender_reports(GstRTSPMedia* media, gpointer) {
    g_autoptr(GstElement) element = gst_rtsp_media_get_element(media);
    g_autoptr(GstObject) pipeline = gst_object_get_parent(GST_OBJECT(element));
    GstIterator* bins = gst_bin_iterate_all_by_element_factory_name(GST_BIN(pipeline), "rtpbin");
    GValue bin = G_VALUE_INIT;
    if (gst_iterator_next(bins, &bin) == GST_ITERATOR_OK) {
      const PadPtr reports = pad_of(GST_ELEMENT(g_value_get_object(&bin)), "send_rtcp_src_0");
      gst_pad_add_probe(
          reports.get(), GST_PAD_PROBE_TYPE_BUFFER,
          [](GstPad*, GstPadProbeInfo*, gpointer) { return GST_PAD_PROBE_DROP; }, nullptr, nullptr);
      g_value_unset(&bin);
    }
    gst_iterator_free(bins);
  }

  void mount(const char* path, const std::string& coder, bool reports = true) {
    g_autoptr(GstRTSPMountPoints) mounts = gst_rtsp_server_get_mount_points(server_);
    GstRTSPMediaFactory* factory = gst_rtsp_media_factory_new();
    const std::string line =
        "( videotestsrc is-live=true pattern=white ! video/x-raw,format=I420,width=64,height=48,framerate=30/1 ! " +
        coder + " )";
    gst_rtsp_media_factory_set_launch(factory, line.c_str());
    gst_rtsp_media_factory_set_shared(factory, TRUE);
    if (!reports)
      g_signal_connect(factory, "media-configure", G_CALLBACK(+[](GstRTSPMediaFactory*, GstRTSPMedia* media, gpointer) {
                         g_signal_connect(media, "prepared", G_CALLBACK(disable_sender_reports), nullptr);
                       }),
                       nullptr);
    gst_rtsp_mount_points_add_factory(mounts, path, factory);
  }

  GMainContext* context_;
  GMainLoop* loop_;
  GstRTSPServer* server_;
  std::thread thread_;
};
#else
inline constexpr const char* kRtspServerMissing = "libgstrtspserver-1.0-dev is not installed";
class RtspServer {
 public:
  explicit RtspServer(int = 0) {}
  static void clean_up() {}
  std::string uri(const std::string& path) const { return path; }
  int port() const { return 0; }
};
#endif

}  // namespace lf::test
