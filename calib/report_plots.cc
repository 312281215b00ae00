// SPDX-License-Identifier: LGPL-2.1-or-later
#include "report_plots.h"
#include "base/number_text.h"

#include <algorithm>
#include <cmath>

#include "base/percentiles.h"

namespace plots {
namespace {

using lf::format_text;

std::string svg(double width, double height, const std::string& label, const std::string& inside,
                double least_width = 0, double most_width = 0) {
  const std::string bounds =
      least_width > 0 ? format_text(" style=\"min-width:%.0fpx;max-width:%.0fpx\"", least_width, most_width) : "";
  return format_text("<svg viewBox=\"0 0 %.0f %.0f\" role=\"img\"", width, height) + " aria-label=\"" + escaped(label) +
         "\"" + bounds + ">" + inside + "</svg>";
}

std::string label(double x, double y, const std::string& what, const char* anchor = "middle", const char* kind = "") {
  return format_text("<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\" class=\"%s\">", x, y, anchor, kind) +
         escaped(what) + "</text>";
}

std::string line(double x0, double y0, double x1, double y1, const char* kind) {
  return format_text("<path d=\"M%.1f %.1fL%.1f %.1f\" class=\"%s\"/>", x0, y0, x1, y1, kind);
}

// Steps of 1, 2 or 5 times a power of ten, some `count` of them to `most`.
double tick_step(double most, int count) {
  const double raw = most / count, power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (raw <= factor * power) return factor * power;
  return 10 * power;
}

// 1, 2 or 5 times a power of ten, not more than `most`.
double round_down(double most) {
  if (!(most > 0) || !std::isfinite(most)) return 1;
  const double power = std::pow(10, std::floor(std::log10(most)));
  return (most >= 5 * power ? 5 : most >= 2 * power ? 2 : 1) * power;
}

// Where values go on a vertical axis, with its lines and numbers.
struct Axis {
  double least = 0, most = 1, top = 0, bottom = 1;
  double at(double value) const { return bottom - (value - least) / (most - least) * (bottom - top); }
  std::string draw(double left, double right, const std::string& unit) const {
    std::string out;
    const double step = tick_step(most - least, 4);
    for (double v = std::ceil(least / step) * step; v <= most + 1e-9 * step; v += step) {
      const double clean = std::abs(v) < 1e-9 * step ? 0 : v;
      out += line(left, at(v), right, at(v), clean == 0 ? "zero" : "grid");
      out += label(left - 6, at(v) + 4, short_number(clean), "end", "dim");
    }
    return out + label(left - 6, top - 8, unit, "end", "dim");
  }
};

}  // namespace

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '&': out += "&amp;"; break;
      case '"': out += "&quot;"; break;
      default: out += c;
    }
  }
  return out;
}

std::string short_number(double value) {
  const double size = std::abs(value);
  if (size == 0) return "0";
  if (size >= 99.95) return format_text("%.0f", value);
  if (size < 1e-4) return format_text("%.1e", value);
  // %g, without its trailing powers for what is small.
  const int decimals = std::max(0, 2 - static_cast<int>(std::floor(std::log10(size))));
  std::string out = format_text("%.*f", decimals, value);
  if (out.find('.') != std::string::npos) {
    while (out.back() == '0') out.pop_back();
    if (out.back() == '.') out.pop_back();
  }
  return out;
}

std::string camera_chart(const CameraChart& chart) {
  const auto n = static_cast<double>(chart.bars.size());
  const double pitch = std::clamp(560 / std::max(1.0, n), 14.0, 44.0), left = 52, width = left + n * pitch + 12;
  Axis axis{0, 0, 26, 190};
  for (const CameraChart::Bar& bar : chart.bars) {
    if (!bar.height) continue;
    axis.most = std::max(axis.most, *bar.height + 2 * bar.sigma);
    axis.least = std::min(axis.least, *bar.height - 2 * bar.sigma);
  }
  for (const auto& [value, name] : chart.lines) axis.most = std::max(axis.most, value);
  if (!chart.dots) axis.least = 0;
  if (!(axis.most > axis.least)) axis.most = axis.least + 1;
  const double room = 0.08 * (axis.most - axis.least);
  axis.most += room;
  if (axis.least < 0) axis.least -= room;
  std::string out = axis.draw(left, width - 8, chart.unit);
  const auto every = static_cast<size_t>(std::ceil(26 / pitch));
  for (size_t i = 0; i < chart.bars.size(); i++) {
    const CameraChart::Bar& bar = chart.bars[i];
    const double x = left + (static_cast<double>(i) + 0.5) * pitch;
    if (i % every == 0) out += label(x, 206, bar.camera.substr(0, bar.camera.find(' ')), "middle", "dim");
    if (!bar.height) {
      out += label(x, axis.at(0) - 4, "\xc3\x97", "middle", "bad-text");
      continue;
    }
    const double y = axis.at(*bar.height);
    out += "<g class=\"" + std::string(name_of(bar.grade)) + "\"><title>" + escaped(bar.camera + ": " + bar.value) +
           "</title>";
    if (bar.sigma > 0)
      out += line(x, axis.at(*bar.height - 2 * bar.sigma), x, axis.at(*bar.height + 2 * bar.sigma), "whisker");
    if (chart.dots)
      out += format_text("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\"/>", x, y);
    else
      out += format_text("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" rx=\"1.5\"/>", x - 0.36 * pitch, y,
                         0.72 * pitch, std::max(1.0, axis.at(0) - y));
    out += "</g>";
  }
  for (const auto& [value, name] : chart.lines)
    out += line(left, axis.at(value), width - 8, axis.at(value), "mark") +
           label(width - 8, axis.at(value) - 5, name, "end", "mark-text");
  return svg(width, 214, chart.label, out, 0.7 * width, 1.3 * width);
}

std::string array_map(const ReportData& data, const ReportVerdict& verdict, bool from_above) {
  const size_t down = from_above ? 2 : 1;  // of x, y, z
  double least[2] = {1e30, 1e30}, most[2] = {-1e30, -1e30}, largest = 0;
  std::vector<std::pair<double, double>> places;
  for (const ReportData::Camera& camera : data.cameras) {
    if (!camera.solved || !camera.solved->position) continue;
    const auto& p = *camera.solved->position;
    // From above what lies ahead is up.
    const double place[2] = {p[0], from_above ? -p[down] : p[down]};
    for (int k = 0; k < 2; k++) least[k] = std::min(least[k], place[k]), most[k] = std::max(most[k], place[k]);
    places.emplace_back(place[0], place[1]);
    largest = std::max(largest, camera.ellipsoid().value_or(0));
  }
  if (places.empty()) return "";
  double nearest = 1e30;
  for (size_t i = 0; i < places.size(); i++)
    for (size_t j = 0; j < i; j++)
      nearest = std::min(
          nearest, std::max(1e-6, std::hypot(places[i].first - places[j].first, places[i].second - places[j].second)));
  const double extent = std::max({most[0] - least[0], most[1] - least[1], 1e-3});
  const double usual = std::sqrt(extent * extent / static_cast<double>(places.size()));
  const double enlarged = round_down(0.45 * usual / std::max(largest, 1e-9));
  const double margin = std::max(0.6 * usual, 0.06 * extent);
  const double wide = most[0] - least[0] + 2 * margin, high = std::max(most[1] - least[1] + 2 * margin, 0.22 * wide);
  const double scale = 520 / wide, height = std::min(high * scale, 520.0) + 30;
  const double middle_y = (least[1] + most[1]) / 2;
  std::string out;
  for (size_t i = 0; i < data.cameras.size(); i++) {
    const ReportData::Camera& camera = data.cameras[i];
    if (!camera.solved || !camera.solved->position) continue;
    const auto& p = *camera.solved->position;
    const double x = (p[0] - least[0] + margin) * scale;
    const double y = ((from_above ? -p[down] : p[down]) - middle_y) * scale + (height - 30) / 2;
    // The shadow of the ellipsoid on this plane, from its covariance.
    const double a = camera.solved->covariance[0][0], c = camera.solved->covariance[down][down];
    const double b = camera.solved->covariance[0][down] * (from_above ? -1 : 1);
    const double mean = (a + c) / 2, apart = std::hypot((a - c) / 2, b);
    const double turn = 0.5 * std::atan2(2 * b, a - c) * 180 / M_PI, k = 2.7955 * enlarged * scale;
    out += "<g class=\"" + std::string(name_of(verdict.cameras[i].grade)) + "\"><title>" +
           escaped("camera " + camera.title() + ": " +
                   format_text("%.4f, %.4f, %.4f m; within %.2f mm with 95 %%", p[0], p[1], p[2],
                               1e3 * camera.ellipsoid().value_or(0))) +
           "</title>" +
           format_text(
               "<ellipse cx=\"%.1f\" cy=\"%.1f\" rx=\"%.2f\" ry=\"%.2f\" transform=\"rotate(%.1f %.1f %.1f)\"/>", x, y,
               k * std::sqrt(std::max(0.0, mean + apart)), k * std::sqrt(std::max(0.0, mean - apart)), turn, x, y) +
           format_text("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2.5\"/></g>", x, y);
    if (!from_above && usual * scale > 26) out += label(x, y - 10, std::to_string(camera.id), "middle", "dim");
  }
  const double bar = round_down(0.3 * wide);
  out += line(8, height - 8, 8 + bar * scale, height - 8, "mark");
  out += label(14 + bar * scale, height - 4,
               (bar >= 1 ? short_number(bar) + " m" : short_number(1e3 * bar) + " mm") + "; ellipsoids " +
                   short_number(enlarged) + " times as large",
               "start", "dim");
  return svg(520, height, from_above ? "The cameras from above" : "The cameras from the front", out);
}

double residual_enlargement(const ReportData& data) {
  std::vector<double> lengths;
  double width = 0;
  for (const ReportData::Camera& camera : data.cameras) {
    width = std::max(width, static_cast<double>(camera.width));
    if (camera.solved)
      for (const auto& r : camera.solved->residuals) lengths.push_back(std::hypot(r[2], r[3]));
  }
  return lengths.empty() ? 1 : round_down(0.05 * width / std::max(1e-6, lf::median(std::move(lengths))));
}

std::string camera_tile(const ReportData::Camera& camera, int columns, int rows, double enlarged) {
  const double w = 160, scale = w / std::max(1, camera.width), h = camera.height * scale;
  double most = 1;
  for (const double count : camera.solved->coverage) most = std::max(most, count);
  std::string out = format_text("<rect width=\"%.0f\" height=\"%.1f\" class=\"paper\"/>", w, h);
  for (int i = 0; i < columns * rows; i++) {
    const double count = camera.solved->coverage[static_cast<size_t>(i)];
    if (count > 0)
      out += format_text(
          "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" class=\"seen\" fill-opacity=\"%.2f\"/>",
          i % columns * w / columns, i / columns * h / rows, w / columns, h / rows,
          0.15 + 0.5 * std::sqrt(count / most));
  }
  std::string path;
  for (const auto& [x, y, dx, dy] : camera.solved->residuals) {
    const double x0 = (x + 0.5) * scale, y0 = (y + 0.5) * scale;
    path += format_text("M%.1f %.1fl%.1f %.1f", x0, y0, dx * enlarged * scale, dy * enlarged * scale);
  }
  return svg(w, h, "camera " + camera.title(), out + "<path d=\"" + path + "\" class=\"residual\"/>");
}

std::string residual_field(const ReportData& data, double enlarged) {
  constexpr int kColumns = 12, kRows = 9;
  const double w = 520, h = 390;
  struct Part {
    double dx = 0, dy = 0, squares = 0, count = 0;
  };
  std::vector<Part> parts(kColumns * kRows);
  for (const ReportData::Camera& camera : data.cameras) {
    if (!camera.solved) continue;
    for (const auto& [x, y, dx, dy] : camera.solved->residuals) {
      const int column = std::clamp(static_cast<int>((x + 0.5) * kColumns / camera.width), 0, kColumns - 1);
      const int row = std::clamp(static_cast<int>((y + 0.5) * kRows / camera.height), 0, kRows - 1);
      Part& part = parts[static_cast<size_t>(row * kColumns + column)];
      // As shares of the picture's width, so that cameras of other sizes count alike.
      part.dx += dx / camera.width, part.dy += dy / camera.width, part.squares += dx * dx + dy * dy, part.count++;
    }
  }
  std::string out = format_text("<rect width=\"%.0f\" height=\"%.0f\" class=\"paper\"/>", w, h);
  double most = 1e-9;
  for (const Part& part : parts)
    if (part.count >= 3) most = std::max(most, std::sqrt(part.squares / part.count));
  for (int i = 0; i < kColumns * kRows; i++) {
    const Part& part = parts[static_cast<size_t>(i)];
    if (part.count < 3) continue;
    const double x = (i % kColumns) * w / kColumns, y = (i / kColumns) * h / kRows,
                 rms = std::sqrt(part.squares / part.count);
    out +=
        "<g><title>" + format_text("%.0f residuals, %.3f px rms", part.count, rms) + "</title>" +
        format_text("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" class=\"seen\" fill-opacity=\"%.2f\"/>",
                    x, y, w / kColumns, h / kRows, 0.08 + 0.6 * rms / most) +
        format_text("<path d=\"M%.1f %.1fl%.1f %.1f\" class=\"arrow\"/></g>", x + w / kColumns / 2, y + h / kRows / 2,
                    part.dx / part.count * enlarged * w, part.dy / part.count * enlarged * w);
  }
  return svg(w, h, "Mean residuals over the picture", out);
}

std::string projection_chart(const ReportData::Solve& solve) {
  const double left = 56, right = 510, width = 520;
  Axis axis{0, 0, 26, 220};
  for (const auto& depth : solve.projection) axis.most = std::max(axis.most, depth.worst_px);
  axis.most *= 1.08;
  const double near = std::log(solve.projection.front().depth_m), far = std::log(solve.projection.back().depth_m);
  const auto across = [&](double depth) { return left + (std::log(depth) - near) / (far - near) * (right - left); };
  const double from = across(solve.near_m), to = across(solve.far_m);
  std::string out = format_text("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" class=\"band\"/>", from,
                                axis.top, to - from, axis.bottom - axis.top) +
                    label((from + to) / 2, axis.top - 8, "where lights were", "middle", "dim") +
                    axis.draw(left, right, "px");
  std::string middle, worst;
  for (const auto& depth : solve.projection) {
    const char move = middle.empty() ? 'M' : 'L';
    middle += format_text("%c%.1f %.1f", move, across(depth.depth_m), axis.at(depth.median_px));
    worst += format_text("%c%.1f %.1f", move, across(depth.depth_m), axis.at(depth.worst_px));
  }
  out += "<path d=\"" + worst + "\" class=\"curve second\"/><path d=\"" + middle + "\" class=\"curve\"/>";
  double last = -100;
  for (const double mantissa : {0.01, 0.1, 1.0, 10.0, 100.0})
    for (const double factor : {1.0, 2.0, 3.0, 5.0}) {
      const double depth = mantissa * factor, x = across(depth);
      if (x < left || x > right || x - last < 34) continue;
      out += line(x, axis.bottom, x, axis.bottom + 4, "zero") +
             label(x, axis.bottom + 17, short_number(depth) + " m", "middle", "dim");
      last = x;
    }
  const auto& end = solve.projection.back();
  out += label(right, axis.at(end.worst_px) - 6, "worst camera", "end", "dim") +
         label(right, axis.at(end.median_px) + 15, "most cameras", "end", "line-text");
  return svg(width, 242, "Projection uncertainty by depth", out);
}

std::string share_bar(double share, bool soft) {
  const double length = 100 * std::min(1.0, share / 2);
  return "<span class=\"share\"><span class=\"" + std::string(soft ? "fair" : "good") +
         format_text("\" style=\"width:%.0f%%\"></span></span>", std::max(1.0, length));
}

}  // namespace plots
