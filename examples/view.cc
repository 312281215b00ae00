// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Shows a light field in an application. The application receives the pictures and moves the view.
//
//   g++ -std=c++20 view.cc $(pkg-config --cflags --libs gstreamer-app-1.0) -o view && ./view rig.json
#include <gst/app/gstappsink.h>
#include <gst/gst.h>

#include <cstdio>
#include <cstdlib>

namespace {

// Moves the view to another x. The structure may hold any of x, y, z, yaw, pitch, roll, fov, focus-distance and
// aperture. The next picture shows the change.
void move_to(GstElement* light_field, double x) {
  gboolean done = FALSE;
  GstStructure* view = gst_structure_new("view", "x", G_TYPE_DOUBLE, x, nullptr);
  g_signal_emit_by_name(light_field, "set-view", view, &done);
  gst_structure_free(view);
  if (!done) std::fprintf(stderr, "cannot move the view\n");
}

// Returns the mean brightness. A real application would draw the picture here.
double mean_of(GstSample* sample) {
  GstMapInfo map;
  if (!gst_buffer_map(gst_sample_get_buffer(sample), &map, GST_MAP_READ)) return 0;
  double sum = 0;
  for (gsize i = 0; i < map.size; i++) sum += map.data[i];
  const double mean = sum / static_cast<double>(map.size);
  gst_buffer_unmap(gst_sample_get_buffer(sample), &map);
  return mean;
}

// Prints the error of the pipeline, if any.
bool failed(GstElement* pipeline) {
  GstBus* bus = gst_element_get_bus(pipeline);
  GstMessage* message = gst_bus_pop_filtered(bus, GST_MESSAGE_ERROR);
  gst_object_unref(bus);
  if (!message) return false;
  GError* error = nullptr;
  gst_message_parse_error(message, &error, nullptr);
  std::fprintf(stderr, "%s\n", error->message);
  g_error_free(error);
  gst_message_unref(message);
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  if (argc < 2) {
    std::fprintf(stderr, "usage: view RIG.json [PICTURES]\n");
    return 1;
  }
  const int pictures = argc > 2 ? std::atoi(argv[2]) : 30;

  GError* error = nullptr;
  GstElement* pipeline = gst_parse_launch(
      "lfviewsrc name=light-field width=320 height=240 framerate=30/1 ! videoconvert ! video/x-raw,format=RGB ! "
      "appsink name=pictures max-buffers=1 drop=true",
      &error);
  if (error) {
    std::fprintf(stderr, "%s\n", error->message);
    g_error_free(error);
    return 1;
  }
  GstElement* light_field = gst_bin_get_by_name(GST_BIN(pipeline), "light-field");
  GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), "pictures");
  g_object_set(light_field, "rig", argv[1], nullptr);
  gst_element_set_state(pipeline, GST_STATE_PLAYING);

  double middle = 0;
  int shown = 0;
  while (shown < pictures) {
    GstSample* sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink), 10 * GST_SECOND);
    if (!sample) break;
    if (shown == 0) g_object_get(light_field, "x", &middle, nullptr);
    std::printf("picture %d: mean %.1f\n", shown, mean_of(sample));
    gst_sample_unref(sample);
    move_to(light_field, middle + 0.002 * ++shown);
  }

  GstStructure* stats = nullptr;
  g_object_get(light_field, "stats", &stats, nullptr);
  guint64 complete = 0, incomplete = 0;
  gst_structure_get_uint64(stats, "complete", &complete);
  gst_structure_get_uint64(stats, "incomplete", &incomplete);
  // The element may have rendered more pictures than were shown, because appsink drops pictures that the application
  // does not fetch in time.
  std::printf("%d pictures shown, %d rendered, %d of these complete\n", shown, static_cast<int>(complete + incomplete),
              static_cast<int>(complete));
  gst_structure_free(stats);

  const bool wrong = failed(pipeline) || shown < pictures;
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(sink);
  gst_object_unref(light_field);
  gst_object_unref(pipeline);
  return wrong ? 1 : 0;
}
