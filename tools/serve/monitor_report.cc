// SPDX-License-Identifier: LGPL-2.1-or-later
#include "monitor_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

namespace lf::serve {
namespace {

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

}  // namespace

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
  const auto number = [](double v) { return std::isfinite(v) ? json(v) : json(nullptr); };
  json cameras = json::array();
  for (size_t i = 0; i < std::min(report.cameras.size(), names.size()); i++) {
    const MonitorReport::Camera& camera = report.cameras[i];
    cameras.push_back({{"name", names[i]},
                       {"psnr", number(camera.psnr)},
                       {"gain", number(camera.gain)},
                       {"shift", number(camera.shift)},
                       {"fault", camera.fault.empty() ? json(nullptr) : json(camera.fault)}});
  }
  return {{"turns", report.turns}, {"bytes", report.bytes}, {"cameras", std::move(cameras)}};
}

std::string to_metrics(const MonitorReport& report, const std::vector<std::string>& names) {
  std::ostringstream out;
  out << "# HELP lightfield_monitor_bytes_total Bytes of answers that only measured the cameras.\n"
         "# TYPE lightfield_monitor_bytes_total counter\nlightfield_monitor_bytes_total "
      << report.bytes << '\n';
  out << "# HELP lightfield_camera_psnr_db How well the others predict a camera.\n"
         "# TYPE lightfield_camera_psnr_db gauge\n";
  const size_t count = std::min(report.cameras.size(), names.size());
  for (size_t i = 0; i < count; i++)
    if (std::isfinite(report.cameras[i].psnr))
      out << "lightfield_camera_psnr_db{camera=" << label(names[i]) << "} " << report.cameras[i].psnr << '\n';
  out << "# HELP lightfield_camera_suspect Cameras that the others predict unusually badly, and what is wrong.\n"
         "# TYPE lightfield_camera_suspect gauge\n";
  for (size_t i = 0; i < count; i++)
    if (!report.cameras[i].fault.empty())
      out << "lightfield_camera_suspect{camera=" << label(names[i]) << ",fault=" << label(report.cameras[i].fault)
          << "} 1\n";
  return out.str();
}

}  // namespace lf::serve
