// SPDX-License-Identifier: LGPL-2.1-or-later
// Checks that a sanitizer understands GStreamer's synchronisation: check-sanitizer WAY. A pipeline's streaming thread
// counts pictures, and another thread reads the count:
//   lock     under GStreamer's object lock
//   queue    through a GLib queue
//   state    after the pipeline has stopped
//   race     without synchronisation: a report and exit status 66 are expected
#include <gst/gst.h>

#include <cstdio>
#include <string>

namespace {

constexpr int kPictures = 200;

struct Counted {
  GstElement* sink = nullptr;
  GAsyncQueue* queue = g_async_queue_new();
  std::string way;
  int pictures = 0;
};

GstPadProbeReturn count(GstPad*, GstPadProbeInfo*, gpointer data) {
  auto& counted = *static_cast<Counted*>(data);
  if (counted.way == "lock") GST_OBJECT_LOCK(counted.sink);
  counted.pictures++;
  if (counted.way == "lock") GST_OBJECT_UNLOCK(counted.sink);
  if (counted.way == "queue") g_async_queue_push(counted.queue, new int(counted.pictures));
  return GST_PAD_PROBE_OK;
}

int look(Counted& counted) {
  if (counted.way == "state") return kPictures;
  if (counted.way == "race") return counted.pictures;
  if (counted.way == "lock") {
    GST_OBJECT_LOCK(counted.sink);
    const int pictures = counted.pictures;
    GST_OBJECT_UNLOCK(counted.sink);
    return pictures;
  }
  auto* piece = static_cast<int*>(g_async_queue_pop(counted.queue));
  const int pictures = *piece;
  delete piece;
  return pictures;
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  if (argc != 2) return 2;
  const std::string line = "fakesrc num-buffers=" + std::to_string(kPictures) + " ! queue ! fakesink name=sink";
  GstElement* pipeline = gst_parse_launch(line.c_str(), nullptr);
  Counted counted;
  counted.way = argv[1];
  counted.sink = gst_bin_get_by_name(GST_BIN(pipeline), "sink");
  GstPad* pad = gst_element_get_static_pad(counted.sink, "sink");
  gst_pad_add_probe(pad, GST_PAD_PROBE_TYPE_BUFFER, count, &counted, nullptr);
  gst_object_unref(pad);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  while (look(counted) < kPictures) {
  }
  GstBus* bus = gst_element_get_bus(pipeline);
  gst_message_unref(gst_bus_timed_pop_filtered(bus, GST_CLOCK_TIME_NONE, GST_MESSAGE_EOS));
  gst_object_unref(bus);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  std::printf("%s: %d pictures\n", argv[1], counted.pictures);
  gst_object_unref(counted.sink);
  gst_object_unref(pipeline);
  g_async_queue_unref(counted.queue);
}
