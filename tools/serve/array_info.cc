// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/array_info.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <sstream>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "composite/view_weights.h"
#include "render/contribution_map.h"
#include "rig/camera_source.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "view/navigator.h"

namespace lf::serve {
namespace {

GstStructure* stats_of(GstElement* element) {
  GstStructure* stats = nullptr;
  g_object_get(element, "stats", &stats, nullptr);
  return stats ? stats : gst_structure_new_empty("lightfield-fragment-stats");
}

const GstStructure* inner(const GstStructure* outer, const char* name) {
  const GValue* value = gst_structure_get_value(outer, name);
  return value && GST_VALUE_HOLDS_STRUCTURE(value) ? gst_value_get_structure(value) : nullptr;
}

const GValue* array_in(const GstStructure* stats, const char* name) {
  const GValue* array = gst_structure_get_value(stats, name);
  return array && GST_VALUE_HOLDS_ARRAY(array) ? array : nullptr;
}

template <typename Take>
void for_each(const GValue* array, const Take& take) {
  for (guint i = 0; array && i < gst_value_array_get_size(array); i++) take(i, gst_value_array_get_value(array, i));
}

std::string label(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '"' || c == '\\') escaped += '\\';
    escaped += c == '\n' ? ' ' : c;
  }
  return '"' + escaped + '"';
}

std::string name_of(const Camera& camera) { return camera.name.empty() ? std::to_string(camera.id) : camera.name; }

bool shows_still(const Rig& rig, const Camera& camera) {
  try {
    return find_camera_source(rig, camera).kind == CameraSource::Kind::kStill;
  } catch (const Error&) {
    return false;
  }
}

nlohmann::json numbers(const Vec3& v) { return {v.x, v.y, v.z}; }

}  // namespace

CameraStates camera_states(GstElement* node) {
  CameraStates states;
  g_autoptr(GstStructure) stats = stats_of(node);
  const GstStructure* cameras = inner(stats, "cameras");
  const gint count = cameras ? gst_structure_n_fields(cameras) : 0;
  for (gint i = 0; i < count; i++) {
    const GstStructure* camera = inner(cameras, gst_structure_nth_field_name(cameras, static_cast<guint>(i)));
    if (!camera) continue;
    states.count++;
    states.working += g_strcmp0(gst_structure_get_string(camera, "state"), "lost") != 0;
  }
  return states;
}

std::string camera_problem(GstElement* node, uint32_t id) {
  g_autoptr(GstElement) camera = gst_bin_get_by_name(GST_BIN(node), ("camera" + std::to_string(id)).c_str());
  if (!camera) return "";
  g_autoptr(GstStructure) stats = stats_of(camera);
  const char* reason = gst_structure_get_string(stats, "reason");
  return reason ? reason : "";
}

MonitorReport monitor_report(const GstStructure* stats) {
  MonitorReport report;
  gst_structure_get_uint64(stats, "monitor-turns", &report.turns);
  gst_structure_get_uint64(stats, "monitor-bytes", &report.bytes);
  const GValue* psnr = array_in(stats, "monitor-psnr");
  if (psnr) report.cameras.resize(gst_value_array_get_size(psnr));
  const std::pair<const char*, double MonitorReport::Camera::*> figures[] = {
      {"monitor-psnr", &MonitorReport::Camera::psnr},
      {"monitor-gain", &MonitorReport::Camera::gain},
      {"monitor-shift", &MonitorReport::Camera::shift}};
  for (const auto& [name, figure] : figures)
    for_each(array_in(stats, name), [&, figure = figure](guint i, const GValue* value) {
      if (i < report.cameras.size()) report.cameras[i].*figure = g_value_get_double(value);
    });
  for_each(array_in(stats, "monitor-suspects"), [&](guint, const GValue* value) {
    const GstStructure* suspect = gst_value_get_structure(value);
    guint camera = 0;
    if (gst_structure_get_uint(suspect, "camera", &camera) && camera < report.cameras.size())
      report.cameras[camera].fault = gst_structure_get_string(suspect, "fault");
  });
  return report;
}

nlohmann::json to_json(const MonitorReport& report, const std::vector<std::string>& names) {
  using nlohmann::json;
  json cameras = json::array();
  for (size_t i = 0; i < std::min(report.cameras.size(), names.size()); i++) {
    const MonitorReport::Camera& camera = report.cameras[i];
    cameras.push_back({{"name", names[i]},
                       {"psnr", camera.psnr},
                       {"gain", camera.gain},
                       {"shift", camera.shift},
                       {"fault", camera.fault.empty() ? json(nullptr) : json(camera.fault)}});
  }
  return {{"turns", report.turns}, {"bytes", report.bytes}, {"cameras", std::move(cameras)}};
}

std::string to_metrics(const MonitorReport& report, const std::vector<std::string>& names) {
  std::ostringstream out;
  out << "# HELP lightfield_monitor_bytes_total Bytes of answers that only measured the cameras.\n"
         "# TYPE lightfield_monitor_bytes_total counter\nlightfield_monitor_bytes_total "
      << report.bytes << '\n';
  out << "# HELP lightfield_camera_psnr_db PSNR of a camera's prediction from the other cameras.\n"
         "# TYPE lightfield_camera_psnr_db gauge\n";
  const size_t count = std::min(report.cameras.size(), names.size());
  for (size_t i = 0; i < count; i++)
    if (std::isfinite(report.cameras[i].psnr))
      out << "lightfield_camera_psnr_db{camera=" << label(names[i]) << "} " << report.cameras[i].psnr << '\n';
  out << "# HELP lightfield_camera_suspect Cameras with an unusually bad prediction, and the probable fault.\n"
         "# TYPE lightfield_camera_suspect gauge\n";
  for (size_t i = 0; i < count; i++)
    if (!report.cameras[i].fault.empty())
      out << "lightfield_camera_suspect{camera=" << label(names[i]) << ",fault=" << label(report.cameras[i].fault)
          << "} 1\n";
  return out.str();
}

ArrayInfo::ArrayInfo(const std::string& rig) : path_(rig), rig_(load_rig(rig)), mesh_(build_mesh(rig_)) {
  nlohmann::json cameras = nlohmann::json::array(), faces = nlohmann::json::array();
  for (const Camera& camera : rig_.cameras) {
    names_.push_back(name_of(camera));
    cameras.push_back({{"name", names_.back()}, {"position", numbers(camera.pose.position)}});
  }
  size_ = largest_distance(rig_);
  for (const MeshFace& face : mesh_.faces)
    faces.push_back(std::vector<CameraIndex>(face.camera.begin(), face.camera.begin() + face.corners()));
  is_still_ = std::ranges::all_of(rig_.cameras, [this](const Camera& camera) { return shows_still(rig_, camera); });
  const nlohmann::json file = parse_json(read_text_file(rig), rig);
  const auto unit = file.find("unit");
  unit_ = unit == file.end() || *unit == "m" ? "m" : "";
  const Pose front = default_viewpoint(rig_).pose;
  json_ = nlohmann::json{{"cameras", std::move(cameras)},
                         {"faces", std::move(faces)},
                         {"right", numbers(front.right())},
                         {"down", numbers(front.down())}}
              .dump();
}

std::string ArrayInfo::hash() const {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(rig_.hash()));
  return text;
}

nlohmann::json ArrayInfo::pixel(const View& view, int x, int y) const {
  nlohmann::json cameras = nlohmann::json::array();
  if (x < 0 || y < 0 || x >= view.width || y >= view.height) return cameras;
  for (const PixelShare& share : pixel_shares(rig_, ViewPlan(rig_, mesh_, view), x, y))
    cameras.push_back({{"name", name_of(rig_.cameras[share.camera])}, {"weight", share.weight}, {"sees", share.sees}});
  return cameras;
}

double ArrayInfo::coverage(const View& view) const {
  return mean_coverage(rig_, ViewPlan(rig_, mesh_, view), ViewCoverage::kColumns, ViewCoverage::kRows).seen;
}

}  // namespace lf::serve
