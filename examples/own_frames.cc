// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Shows how an application feeds its own frames into a light field. Four cameras see a synthetic wall, and the program
// renders the view from a point between them.
//
//   g++ -std=c++20 own_frames.cc $(pkg-config --cflags --libs gstreamer-app-1.0) -o own_frames && ./own_frames
#include <gst/app/gstappsink.h>
#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <glib/gstdio.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace {

// Four cameras at the corners of a square of 20 cm, 2 m in front of a wall.
constexpr int kWidth = 160, kHeight = 120, kFrames = 10;
constexpr double kFocal = 150, kSide = 0.2, kWall = 2;

std::string rig() {
  std::string cameras;
  for (int i = 0; i < 4; i++)
    cameras += std::string(i ? "," : "") + "{\"id\":" + std::to_string(i) + ",\"name\":\"" + std::to_string(i) +
               "\",\"width\":160,\"height\":120,\"model\":\"PINHOLE\",\"params\":[150,150,79.5,59.5],\"position\":[" +
               (i % 2 ? "0.2" : "0") + "," + (i / 2 ? "0.2" : "0") + ",0],\"orientation\":[1,0,0,0]}";
  return "{\"format\":\"lightfield-rig\",\"version\":1,\"cameras\":[" + cameras +
         "],\"topology\":{\"type\":\"grid\",\"rows\":2,\"columns\":2}}";
}

// Returns the brightness of the wall at a position in metres. The pattern moves with time.
double wall(double x, double y, int frame) { return 128 + 60 * std::sin(10 * x + 0.1 * frame) + 60 * std::cos(12 * y); }

// Returns the brightness of pixel (u, v) for a camera at (eye_x, eye_y).
double seen(double eye_x, double eye_y, int u, int v, int frame) {
  return wall(eye_x + (u - (kWidth - 1) / 2.0) / kFocal * kWall, eye_y + (v - (kHeight - 1) / 2.0) / kFocal * kWall,
              frame);
}

GstBuffer* draw(int camera, int frame) {
  GstBuffer* buffer = gst_buffer_new_allocate(nullptr, 3 * kWidth * kHeight, nullptr);
  GstMapInfo map;
  gst_buffer_map(buffer, &map, GST_MAP_WRITE);
  for (int v = 0, i = 0; v < kHeight; v++)
    for (int u = 0; u < kWidth; u++)
      for (int channel = 0; channel < 3; channel++, i++)
        map.data[i] = static_cast<guint8>(std::lround(seen(kSide * (camera % 2), kSide * (camera / 2), u, v, frame)));
  gst_buffer_unmap(buffer, &map);
  GST_BUFFER_PTS(buffer) = frame * GST_SECOND / 10;
  GST_BUFFER_DURATION(buffer) = GST_SECOND / 10;
  return buffer;
}

// Returns the mean absolute error of the picture, on a scale of 255 and without the border.
double error_of(GstSample* sample, int frame) {
  GstMapInfo map;
  gst_buffer_map(gst_sample_get_buffer(sample), &map, GST_MAP_READ);
  double sum = 0;
  int count = 0;
  for (int v = 20; v < kHeight - 20; v++)
    for (int u = 20; u < kWidth - 20; u++, count++)
      sum += std::abs(map.data[3 * (v * kWidth + u)] - seen(kSide / 2, kSide / 2, u, v, frame));
  gst_buffer_unmap(gst_sample_get_buffer(sample), &map);
  return sum / count;
}

}  // namespace

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  const std::string path = std::string(g_get_tmp_dir()) + "/own_frames_rig.json";
  if (!g_file_set_contents(path.c_str(), rig().c_str(), -1, nullptr)) return 1;

  // The view has the lens of the cameras, is in the middle between the cameras, and is focused on the wall. Each
  // request needs one frame of each camera.
  const std::string fov = std::to_string(2 * std::atan(kHeight / 2.0 / kFocal) * 180 / G_PI);
  std::string line = "lfviewrequest num-buffers=" + std::to_string(kFrames) + " framerate=10/1 rig=" + path +
                     " x=0.1 y=0.1 z=0 focus-distance=2 fov=" + fov +
                     " ! tee name=r  r. ! queue ! node.request  lffragment name=node rig=" + path +
                     " ! queue ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c focus=plane rig=" + path +
                     " ! videoconvert ! video/x-raw,format=RGB ! appsink name=pictures sync=false";
  for (int i = 0; i < 4; i++)
    line += " appsrc name=camera" + std::to_string(i) + " format=time ! node.sink_" + std::to_string(i);
  GstElement* pipeline = gst_parse_launch(line.c_str(), nullptr);
  if (!pipeline) return 1;
  GstElement* node = gst_bin_get_by_name(GST_BIN(pipeline), "node");
  GstElement* sink = gst_bin_get_by_name(GST_BIN(pipeline), "pictures");
  for (int i = 0; i < 4; i++) {
    const std::string number = std::to_string(i);
    gst_child_proxy_set(GST_CHILD_PROXY(node), ("sink_" + number + "::camera").c_str(), i, nullptr);
    GstElement* source = gst_bin_get_by_name(GST_BIN(pipeline), ("camera" + number).c_str());
    GstCaps* caps = gst_caps_from_string("video/x-raw,format=RGB,width=160,height=120,framerate=10/1");
    gst_app_src_set_caps(GST_APP_SRC(source), caps);
    for (int frame = 0; frame < kFrames; frame++) gst_app_src_push_buffer(GST_APP_SRC(source), draw(i, frame));
    gst_app_src_end_of_stream(GST_APP_SRC(source));
    gst_caps_unref(caps);
    gst_object_unref(source);
  }
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  int shown = 0;
  double worst = 0;
  while (GstSample* sample = gst_app_sink_try_pull_sample(GST_APP_SINK(sink), 10 * GST_SECOND)) {
    worst = std::max(worst, error_of(sample, shown++));
    gst_sample_unref(sample);
  }
  std::printf("%d pictures, worst mean error %.2f of 255\n", shown, worst);
  gst_element_set_state(pipeline, GST_STATE_NULL);
  gst_object_unref(sink);
  gst_object_unref(node);
  gst_object_unref(pipeline);
  g_unlink(path.c_str());
  return shown == kFrames && worst < 2 ? 0 : 1;
}
