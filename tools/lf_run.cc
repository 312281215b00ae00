// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-run: runs a pipeline as a service, with metrics for Prometheus.
#include <memory>
#include <string>
#include <vector>

#include <glib-unix.h>
#include <gst/gst.h>

#include "base/file.h"
#include "base/text.h"
#include "command_line.h"
#include "serve/http.h"
#include "serve/pipeline_monitor.h"
#include "serve/pipelines.h"
#include "serve/process.h"
#include "terminal.h"

namespace {

using namespace lf::serve;

struct Options {
  std::string metrics;
  std::vector<std::string> pipeline;
};

// The running pipeline. Main thread only.
class Program {
 public:
  explicit Program(const Options& options) : loop_(g_main_loop_new(nullptr, FALSE)) {
    std::vector<const char*> words;
    for (const std::string& word : options.pipeline) words.push_back(word.c_str());
    words.push_back(nullptr);
    g_autoptr(GError) error = nullptr;
    GstElement* made = gst_parse_launchv_full(words.data(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
    if (!made) throw lf::Error(error ? error->message : "the pipeline has no elements");
    if (GST_IS_PIPELINE(made)) {
      pipeline_ = GST_ELEMENT(gst_object_ref_sink(made));
    } else {  // a single element, such as lfnodesink
      pipeline_ = GST_ELEMENT(gst_object_ref_sink(gst_pipeline_new(nullptr)));
      gst_bin_add(GST_BIN(pipeline_), made);
    }
    metrics_ = std::make_unique<PipelineMetrics>(pipeline_);
    if (!options.metrics.empty()) listen(options.metrics);
    g_autoptr(GstBus) bus = gst_element_get_bus(pipeline_);
    gst_bus_set_sync_handler(
        bus,
        [](GstBus*, GstMessage* message, gpointer data) {
          if (!static_cast<PipelineMetrics*>(data)->take(message)) return GST_BUS_PASS;
          gst_message_unref(message);
          return GST_BUS_DROP;
        },
        metrics_.get(), nullptr);
    bus_watch_ = gst_bus_add_watch(
        bus,
        [](GstBus*, GstMessage* message, gpointer data) -> gboolean {
          static_cast<Program*>(data)->handle(message);
          return G_SOURCE_CONTINUE;
        },
        this);
  }
  ~Program() {
    listener_.reset();
    g_source_remove(bus_watch_);
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(pipeline_);
    g_main_loop_unref(loop_);
  }
  Program(const Program&) = delete;

  // Runs until SIGINT, SIGTERM or the end of the stream. Throws Error.
  void run() {
    const auto quit = [](gpointer loop) -> gboolean {
      g_main_loop_quit(static_cast<GMainLoop*>(loop));
      return G_SOURCE_CONTINUE;
    };
    const guint signals[] = {g_unix_signal_add(SIGINT, quit, loop_), g_unix_signal_add(SIGTERM, quit, loop_)};
    ProgressCheck progress(pipeline_);
    const ServiceWatchdog watchdog([&]() -> std::string {
      (void)metrics_->text();  // does not return if an element never releases a lock
      return is_ready_ ? progress.problem() : "";
    });
    gst_element_set_state(pipeline_, GST_STATE_PLAYING);  // a failure is a message of the bus
    g_main_loop_run(loop_);
    for (const guint source : signals) g_source_remove(source);
    notify_service("STOPPING=1");
    if (!failure_.empty()) throw lf::Error(failure_);
  }

 private:
  void listen(const std::string& text) {
    const std::vector<lf::HostPort> places = lf::parse_host_ports(text);
    if (places.size() != 1) throw lf::Error("--metrics " + text + ": must be PORT or ADDRESS:PORT");
    HttpListener::Settings settings{.name = "lf-run",
                                    .caching = "no-store",
                                    .max_body = 0,
                                    .on_request = [this](SoupServerMessage* message, const std::string& path,
                                                         GHashTable*) { answer(message, path); },
                                    .on_refusal =
                                        [](SoupServerMessage* message, const HttpRefusal& refusal) {
                                          respond(message, refusal.status, "text/plain",
                                                  std::string(refusal.title) + "\n");
                                        }};
    const std::string address = places.front().host.empty() ? "127.0.0.1" : places.front().host;
    listener_ = std::make_unique<HttpListener>(address, places.front().port, nullptr, std::move(settings));
  }

  void answer(SoupServerMessage* message, const std::string& path) {
    const std::string method = soup_server_message_get_method(message);
    if (method != "GET" && method != "HEAD")
      return respond(message, SOUP_STATUS_METHOD_NOT_ALLOWED, "text/plain", "GET only\n");
    if (path == "/healthz") return respond(message, SOUP_STATUS_OK, "text/plain", "ok\n");
    if (path == "/readyz")
      return is_ready_ ? respond(message, SOUP_STATUS_OK, "text/plain", "ok\n")
                       : respond(message, SOUP_STATUS_SERVICE_UNAVAILABLE, "text/plain", "starting\n");
    if (path != "/metrics") return respond(message, SOUP_STATUS_NOT_FOUND, "text/plain", "no such page\n");
    respond(message, SOUP_STATUS_OK, "text/plain; version=0.0.4",
            "# HELP lightfield_build_info Version of the program.\n# TYPE lightfield_build_info gauge\n"
            "lightfield_build_info{program=\"lf-run\",version=\"" LF_VERSION "\"} 1\n" +
                metrics_->text());
  }

  void handle(GstMessage* message) {
    switch (GST_MESSAGE_TYPE(message)) {
      case GST_MESSAGE_ERROR: return fail(text_of(message));
      case GST_MESSAGE_WARNING: return say("warning: " + text_of(message));
      case GST_MESSAGE_EOS: return g_main_loop_quit(loop_);
      case GST_MESSAGE_LATENCY: gst_bin_recalculate_latency(GST_BIN(pipeline_)); return;
      case GST_MESSAGE_CLOCK_LOST: return fail("the clock of the pipeline is lost");
      case GST_MESSAGE_STATE_CHANGED: {
        GstState now = GST_STATE_NULL;
        gst_message_parse_state_changed(message, nullptr, &now, nullptr);
        if (GST_MESSAGE_SRC(message) != GST_OBJECT(pipeline_) || now != GST_STATE_PLAYING || is_ready_) return;
        is_ready_ = true;
        notify_service("READY=1");
        say("running");
        return;
      }
      default: return;
    }
  }

  void fail(const std::string& why) {
    failure_ = why;
    g_main_loop_quit(loop_);
  }

  GMainLoop* loop_;
  GstElement* pipeline_ = nullptr;
  guint bus_watch_ = 0;
  std::unique_ptr<PipelineMetrics> metrics_;
  std::unique_ptr<HttpListener> listener_;
  bool is_ready_ = false;
  std::string failure_;
};

}  // namespace

int main(int argc, char** argv) {
  setlinebuf(stdout);
  Options o;
  cli::App app(
      "Runs a GStreamer pipeline as a service of systemd, such as a camera host or a compositor. Reports to systemd "
      "when the pipeline runs, and delivers metrics for Prometheus. An error of the pipeline ends the program with "
      "status 1, so that systemd restarts it.",
      "lf-run");
  app.add_option(
         "--metrics", o.metrics,
         "Address that answers HTTP requests for /metrics, /healthz and /readyz, as PORT (only for this machine) "
         "or ADDRESS:PORT. There is no password, so use an address that only Prometheus can reach (default: none)")
      ->type_name("ADDRESS");
  app.add_option("PIPELINE", o.pipeline, "Elements and properties, as for gst-launch-1.0")->required();
  gst_init(nullptr, nullptr);
  return cli::run_tool(app, argc, argv, [&] { Program(o).run(); });
}
