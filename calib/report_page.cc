// SPDX-License-Identifier: LGPL-2.1-or-later
#include "report_page.h"

#include <algorithm>
#include <cmath>

#include "base/maths.h"
#include "base/text.h"

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

// Returns the distance of grid lines: 1, 2 or 5 times a power of ten, for about `count` lines up to `most`.
double tick_step(double most, int count) {
  const double raw = most / count, power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (raw <= factor * power) return factor * power;
  return 10 * power;
}

// Returns the largest number of the form 1, 2 or 5 times a power of ten that is at most `most`.
double round_down(double most) {
  if (!(most > 0) || !std::isfinite(most)) return 1;
  const double power = std::pow(10, std::floor(std::log10(most)));
  return (most >= 5 * power ? 5 : most >= 2 * power ? 2 : 1) * power;
}

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
  const size_t down = from_above ? 2 : 1;
  double least[2] = {1e30, 1e30}, most[2] = {-1e30, -1e30}, largest = 0;
  std::vector<std::pair<double, double>> places;
  for (const ReportData::Camera& camera : data.cameras) {
    if (!camera.solved || !camera.solved->position) continue;
    const auto& p = *camera.solved->position;
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
                   short_number(enlarged) + " times enlarged",
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
      // Positions are relative to the image width, so that cameras of different resolutions are comparable.
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
                    label((from + to) / 2, axis.top - 8, "light positions", "middle", "dim") +
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
         label(right, axis.at(end.median_px) + 15, "median camera", "end", "line-text");
  return svg(width, 242, "Predicted reprojection error over depth", out);
}

std::string percentage_bar(double share, bool soft) {
  const double length = 100 * std::min(1.0, share / 2);
  return "<span class=\"share\"><span class=\"" + std::string(soft ? "fair" : "good") +
         format_text("\" style=\"width:%.0f%%\"></span></span>", std::max(1.0, length));
}

}  // namespace plots

namespace {

// The style sheet of the page: light or dark like the system, a single column on phones, no backgrounds in print.
constexpr char kReportStyle[] = R"css(
:root { color-scheme: light dark; --bg: #fff; --fg: #1d2024; --dim: #5d6672; --line: #d9dee5; --card: #f5f7f9;
  --accent: #1a64b8; --good: #1b7f4b; --fair: #a15c00; --bad: #c0282d; --paper: #e9edf1; }
@media (prefers-color-scheme: dark) { :root { --bg: #14171b; --fg: #e6e9ed; --dim: #9aa5b1; --line: #323941;
  --card: #1c2025; --accent: #6cb0ff; --good: #53c689; --fair: #e9a545; --bad: #ff7b78; --paper: #262c33; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 72rem; background: var(--bg); color: var(--fg);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1rem; font-weight: 600; color: var(--dim); margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 1.15rem; margin: 2.5rem 0 .5rem; }
h3 { font-size: 1rem; margin: 0 0 .25rem; }
p { margin: .25rem 0 .75rem; max-width: 46rem; }
.headline { font-size: clamp(1.6rem, 5vw, 2.3rem); line-height: 1.2; font-weight: 700; margin: .35rem 0 .5rem; }
.headline::before { content: ""; display: inline-block; width: .62em; height: .62em; border-radius: 50%;
  margin-right: .4em; background: var(--good); }
.headline.fair::before { background: var(--fair); }
.headline.bad::before { background: var(--bad); }
.facts { display: flex; flex-wrap: wrap; gap: .4rem 1.6rem; margin: 0 0 1rem; padding: 0; list-style: none; }
.facts b { font-weight: 600; }
.facts li, .note { color: var(--dim); }
.facts b { color: var(--fg); }
.note { font-size: .9rem; }
ol.next { padding-left: 1.4rem; max-width: 50rem; }
ol.next li { margin-bottom: .5rem; }
.grid { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr)); }
.card { background: var(--card); border: 1px solid var(--line); border-radius: .6rem; padding: .9rem 1rem; min-width: 0; }
.wide { grid-column: 1 / -1; }
.scroll { overflow-x: auto; }
.tiles { display: grid; gap: .6rem; grid-template-columns: repeat(auto-fill, minmax(7.5rem, 1fr)); }
.tile { font-size: .8rem; color: var(--dim); overflow: hidden; text-overflow: ellipsis; white-space: nowrap; }
.tile svg { border-bottom: 3px solid var(--good); }
.tile.fair svg { border-color: var(--fair); }
.tile.bad svg { border-color: var(--bad); }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th { font-weight: 600; text-align: right; color: var(--dim); font-size: .85rem; white-space: nowrap; }
td { text-align: right; white-space: nowrap; }
th, td { padding: .35rem .7rem .35rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
th:first-child, td:first-child, td.words, th.words { text-align: left; }
td.words { white-space: normal; min-width: 14rem; }
tr.chosen td { font-weight: 600; }
.badge { display: inline-block; min-width: 2.9rem; padding: 0 .5rem; border-radius: 1rem; border: 1px solid;
  font-size: .8rem; font-weight: 600; text-align: center; }
.badge.good { color: var(--good); } .badge.fair { color: var(--fair); } .badge.bad { color: var(--bad); }
.reasons { margin: 0; padding-left: 1.1rem; }
.modes { list-style: none; margin: 0; padding: 0; }
.modes li { display: grid; grid-template-columns: 5rem 1fr; gap: .8rem; padding: .4rem 0; border-bottom: 1px solid var(--line); }
.share { display: block; height: .5rem; margin-top: .5rem; border-radius: .25rem; position: relative; overflow: hidden;
  background: linear-gradient(to right, var(--paper) 50%, var(--line) 50%); }
.share span { display: block; height: 100%; background: var(--good); }
.share .fair { background: var(--fair); }
details summary { cursor: pointer; color: var(--accent); padding: .4rem 0; }
svg { display: block; width: 100%; height: auto; }
svg text { font: 12px system-ui, sans-serif; fill: var(--fg); }
svg .dim { fill: var(--dim); }
svg .bad-text { fill: var(--bad); font-weight: 700; }
svg .mark-text, svg .line-text { paint-order: stroke; stroke: var(--card); stroke-width: 4px; stroke-linejoin: round; }
svg .mark-text { fill: var(--dim); }
svg .line-text { fill: var(--accent); }
svg path { fill: none; }
svg .grid { stroke: var(--line); }
svg .zero { stroke: var(--dim); }
svg .mark { stroke: var(--dim); stroke-dasharray: 4 3; }
svg .whisker { stroke: var(--dim); stroke-width: 1.5; }
svg .band { fill: var(--accent); fill-opacity: .1; }
svg .curve { stroke: var(--accent); stroke-width: 2.5; stroke-linejoin: round; }
svg .second { stroke: var(--dim); stroke-width: 1.5; }
svg .paper { fill: var(--paper); }
svg .seen { fill: var(--accent); }
svg .residual { stroke: var(--fg); stroke-width: .9; stroke-opacity: .75; }
svg .arrow { stroke: var(--fg); stroke-width: 2; stroke-linecap: round; }
svg g.good { fill: var(--good); } svg g.fair { fill: var(--fair); } svg g.bad { fill: var(--bad); }
svg ellipse { fill-opacity: .25; }
@media print { body { max-width: none; } .card { break-inside: avoid; } }
)css";

using plots::escaped;
using plots::short_number;
using Grade = ReportVerdict::Grade;

constexpr size_t kMaxRows = 16;  // maximum number of good cameras that are shown without folding

class Page {
 public:
  Page(const ReportData& data, const ReportVerdict& verdict) : data_(data), verdict_(verdict) {}

  std::string write(const std::string& title) {
    out_ =
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
        escaped(title + ": " + verdict_.headline) + "</title>\n<style>" + kReportStyle + "</style>\n";
    out_ += "<header><h1>" + escaped(title) + "</h1><p class=\"headline " + name_of(verdict_.grade) + "\">" +
            escaped(verdict_.headline) + "</p>";
    facts();
    out_ += "</header>\n<main>";
    next();
    cameras();
    if (data_.solve) {
      residuals(*data_.solve);
      array();
      firmness(*data_.solve);
      times();
    }
    if (data_.colour) colours(*data_.colour);
    if (data_.check) check(*data_.check);
    details();
    return out_ + "</main>\n</html>\n";
  }

 private:
  void fact(const std::string& value, const std::string& what) {
    out_ += "<li><b>" + escaped(value) + "</b> " + escaped(what) + "</li>";
  }
  void section(const std::string& title, const std::string& note) {
    out_ += "\n<h2>" + escaped(title) + "</h2><p class=\"note\">" + escaped(note) + "</p>";
  }
  void card(const std::string& title, const std::string& inside, const std::string& note = "", bool wide = false) {
    out_ += std::string("<div class=\"card") + (wide ? " wide" : "") + "\"><h3>" + escaped(title) +
            "</h3><div class=\"scroll\">" + inside + "</div>" +
            (note.empty() ? "" : "<p class=\"note\">" + escaped(note) + "</p>") + "</div>";
  }

  void facts() {
    out_ += "<ul class=\"facts\">";
    if (data_.solve) {
      const auto found =
          std::ranges::count_if(data_.cameras, [](const ReportData::Camera& c) { return c.solved && c.solved->found; });
      fact(std::to_string(found) + " of " + std::to_string(data_.cameras.size()), "cameras placed");
      fact(short_number(data_.solve->rms_px) + " px", "RMS residual");
      std::vector<double> sizes;
      for (const ReportData::Camera& camera : data_.cameras)
        if (const auto size = camera.ellipsoid()) sizes.push_back(*size);
      if (!sizes.empty())
        fact(short_number(1e3 * *std::ranges::max_element(sizes)) + " mm",
             "95 % uncertainty of the worst camera position");
    }
    if (data_.colour)
      fact(short_number(data_.colour->before.median) + " \xe2\x86\x92 " + short_number(data_.colour->after.median),
           "of 255, colour difference between cameras");
    if (data_.check) fact(data_.check->holds ? "holds" : "does not hold", "by the latest check");
    out_ += "</ul>";
  }

  void next() {
    out_ += "<h2>What to do next</h2><ol class=\"next\">";
    for (const std::string& step : verdict_.next) out_ += "<li>" + escaped(step) + "</li>";
    if (verdict_.next.empty())
      out_ +=
          "<li>View the light field: <code>lf-serve --rig RIG --watch</code>. Measure it: <code>lf-rig snapshot RIG "
          "--out STILLS</code>, then <code>lf-bench --rig STILLS/rig.json</code>.</li>"
          "<li>After the cameras may have moved: <code>lf-calibrate check</code>.</li>";
    out_ += "</ol>";
  }

  std::string row(size_t i) const {
    const ReportData::Camera& camera = data_.cameras[i];
    const ReportVerdict::Camera& verdict = verdict_.cameras[i];
    const auto cell = [](bool known, const std::string& text) { return "<td>" + (known ? text : "") + "</td>"; };
    std::string out = "<tr><td>" + escaped(camera.title()) + "</td><td class=\"words\"><span class=\"badge " +
                      std::string(name_of(verdict.grade)) + "\">" + name_of(verdict.grade) + "</span>";
    if (!verdict.reasons.empty()) {
      out += "<ul class=\"reasons\">";
      for (const std::string& reason : verdict.reasons) out += "<li>" + escaped(reason) + "</li>";
      out += "</ul>";
    }
    out += "</td>";
    if (data_.solve) {
      const bool found = camera.solved && camera.solved->found;
      out += cell(found, found ? short_number(camera.solved->rms_px) : "");
      const double seen = camera.solved ? camera.solved->observations : 0;
      out += cell(seen > 0, seen > 0 ? short_number(100 * camera.solved->outliers / seen) + " %" : "");
      const auto covered = camera.covered();
      out += cell(covered.has_value(), covered ? short_number(100 * *covered) + " %" : "");
      const auto size = camera.ellipsoid();
      out += cell(size.has_value(), size ? short_number(1e3 * *size) : "");
      const bool timed = camera.solved && camera.solved->offset_ms;
      out += cell(timed, timed ? sign(*camera.solved->offset_ms) : "");
    }
    if (data_.colour)
      out += cell(camera.coloured.has_value(), camera.coloured ? short_number(camera.coloured->rms) : "");
    if (data_.check)
      out += cell(camera.checked.has_value(), camera.checked ? short_number(camera.checked->shift_px) : "");
    return out + "</tr>";
  }
  static std::string sign(double value) { return (value > 0 ? "+" : "") + short_number(value); }

  void cameras() {
    section("Cameras",
            "Residual: RMS reprojection error of the inliers. Coverage: share of the image that the light "
            "covered. Position: longest semi-axis of the 95 % confidence ellipsoid.");
    std::string head = "<thead><tr><th>camera</th><th class=\"words\">verdict</th>";
    if (data_.solve)
      head += "<th>residual, px</th><th>outliers</th><th>coverage</th><th>position, mm</th><th>clock, ms</th>";
    if (data_.colour) head += "<th>colour, of 255</th>";
    if (data_.check) head += "<th>moved, px</th>";
    head += "</tr></thead>";
    std::string good, other;
    size_t num_good = 0;
    for (size_t i = 0; i < data_.cameras.size(); i++) {
      const bool is_good = verdict_.cameras[i].grade == Grade::kGood;
      num_good += is_good;
      (is_good ? good : other) += row(i);
    }
    const auto table = [&](const std::string& rows) {
      return "<div class=\"scroll\"><table>" + head + "<tbody>" + rows + "</tbody></table></div>";
    };
    if (num_good <= kMaxRows) {
      out_ += table(other + good);
    } else {
      if (!other.empty()) out_ += table(other);
      out_ +=
          "<details><summary>" + std::to_string(num_good) + " cameras are good</summary>" + table(good) + "</details>";
    }
  }

  template <class Value>
  plots::CameraChart chart(const std::string& label, const std::string& unit, const Value& value) const {
    plots::CameraChart chart;
    chart.label = label, chart.unit = unit;
    for (size_t i = 0; i < data_.cameras.size(); i++) {
      const std::optional<double> height = value(data_.cameras[i]);
      chart.bars.push_back({data_.cameras[i].title(), height ? short_number(*height) + " " + unit : "", height, 0,
                            verdict_.cameras[i].grade});
    }
    return chart;
  }

  void residuals(const ReportData::Solve& solve) {
    section("Residuals",
            "Reprojection errors of the lights. A swirl or a star in all images indicates an unsuitable lens "
            "model; large residuals in one camera indicate a problem of that "
            "camera.");
    out_ += "<div class=\"grid\">";
    auto bars = chart("Residuals of each camera", "px", [](const ReportData::Camera& c) {
      return c.solved && c.solved->found ? std::optional(c.solved->rms_px) : std::nullopt;
    });
    bars.lines.push_back({solve.expected_px, "expected from noise"});
    card("Per camera", plots::camera_chart(bars));
    const double enlarged = plots::residual_enlargement(data_);
    card("Over the image, all cameras", plots::residual_field(data_, 4 * enlarged),
         "Mean residuals, enlarged " + short_number(4 * enlarged) + " times; darker blue: larger RMS.");
    std::string tiles = "<div class=\"tiles\">";
    for (size_t i = 0; i < data_.cameras.size(); i++) {
      const ReportData::Camera& camera = data_.cameras[i];
      if (!camera.solved || camera.solved->coverage.size() != static_cast<size_t>(solve.columns * solve.rows)) continue;
      tiles += std::string("<div class=\"tile ") + name_of(verdict_.cameras[i].grade) + "\">" +
               plots::camera_tile(camera, solve.columns, solve.rows, enlarged) + escaped(camera.title()) + "</div>";
    }
    tiles += "</div>";
    const std::string note = "Shaded: covered by the light. Strokes: residuals, enlarged " + short_number(enlarged) +
                             " times. Next time, move the light into the empty areas.";
    if (data_.cameras.size() > 2 * kMaxRows)
      tiles =
          "<details><summary>all " + std::to_string(data_.cameras.size()) + " images</summary>" + tiles + "</details>";
    card("Coverage and residuals in each image", tiles, note, true);
    out_ += "</div>";
  }

  void array() {
    section("Camera positions", "Ellipsoids: 95 % confidence.");
    out_ += "<div class=\"grid\">";
    card("From the front", plots::array_map(data_, verdict_, false),
         "Seen along the viewing direction: x to the right, y down.");
    card("From above", plots::array_map(data_, verdict_, true), "Forward is up.");
    out_ += "</div>";
  }

  void firmness(const ReportData::Solve& solve) {
    section("Uncertainty", "Accuracy that this recording supports.");
    out_ += "<div class=\"grid\">";
    if (!solve.projection.empty())
      card("Reprojection error of a new point, triangulated by all other cameras", plots::projection_chart(solve),
           "Predicted from the uncertainty of the calibration, over the depth of the point. Errors below half a pixel "
           "are invisible.");
    std::string list = "<ul class=\"modes\">";
    for (const ReportData::Solve::Mode& mode : solve.modes)
      list += "<li>" + plots::percentage_bar(mode.share, mode.soft) + "<span>" + escaped(mode.text) +
              (mode.soft ? " <b>Weak.</b>" : "") + "</span></li>";
    card("Common errors of all cameras", list + "</ul>",
         "Past the middle of the bar, a better recording is recommended.");
    out_ += "</div>";
  }

  void times() {
    using SolveResult = ReportData::Camera::SolveResult;
    const auto dots = [&](const char* label, std::optional<double> SolveResult::*value,
                          std::optional<double> SolveResult::*sigma) {
      plots::CameraChart made =
          chart(label, "ms", [&](const ReportData::Camera& c) { return c.solved ? (*c.solved).*value : std::nullopt; });
      made.dots = true;
      for (size_t i = 0; i < made.bars.size(); i++)
        if (data_.cameras[i].solved) made.bars[i].sigma = ((*data_.cameras[i].solved).*sigma).value_or(0);
      return made;
    };
    const auto known = [](const plots::CameraChart& made) {
      return std::ranges::any_of(made.bars, [](const auto& bar) { return bar.height.has_value(); });
    };
    const auto offsets = dots("Time offsets", &SolveResult::offset_ms, &SolveResult::offset_sigma_ms);
    const auto readouts = dots("Readout times", &SolveResult::readout_ms, &SolveResult::readout_sigma_ms);
    if (!known(offsets) && !known(readouts)) return;
    section("Time", "Delay of each camera's frames relative to its stamps and to the median camera.");
    out_ += "<div class=\"grid\">";
    if (known(offsets)) card("Clock offsets", plots::camera_chart(offsets), "Whiskers: two standard deviations.", true);
    if (known(readouts))
      card("Rolling shutters", plots::camera_chart(readouts),
           "Time from the first row of an image to the last row. Cameras without a dot have no significant readout "
           "time.",
           true);
    out_ += "</div>";
  }

  void colours(const ReportData::Colour& colour) {
    section("Colours",
            "Differences between two cameras at the same place, on patches held out of the fit (" + colour.from + ").");
    std::string table =
        "<table><thead><tr><th>corrected terms</th><th>median, of 255</th><th>95 %</th></tr></thead><tbody>";
    for (const ReportData::Colour::Row& row : colour.rows)
      table += std::string("<tr") + (row.chosen ? " class=\"chosen\"" : "") + "><td class=\"words\">" +
               escaped(row.what) + (row.chosen ? " (chosen)" : "") + "</td><td>" + short_number(row.median) +
               "</td><td>" + short_number(row.p95) + "</td></tr>";
    out_ += "<div class=\"grid\">";
    card("Before and after", table + "</tbody></table>");
    auto gains = chart("Brightness before correction", "%", [](const ReportData::Camera& c) {
      return c.coloured ? std::optional(100 * (c.coloured->gain - 1)) : std::nullopt;
    });
    gains.dots = true;
    card("Before: brightness relative to the median camera", plots::camera_chart(gains));
    auto left = chart("Remaining colour differences", "of 255", [](const ReportData::Camera& c) {
      return c.coloured && c.coloured->corrected ? std::optional(c.coloured->rms) : std::nullopt;
    });
    left.lines.push_back({colour.after.median, "median of all"});
    card("After: remaining differences", plots::camera_chart(left));
    out_ += "</div>";
  }

  void check(const ReportData::Check& check) {
    section("Latest check", check.from == "monitor" ? "By the camera monitor of lf-serve." : "By a later recording.");
    auto bars = chart("Image displacement", "px", [](const ReportData::Camera& c) {
      return c.checked && c.checked->state != "unknown" ? std::optional(c.checked->shift_px) : std::nullopt;
    });
    if (check.from != "monitor") bars.lines.push_back({0.3, "threshold"});
    out_ += "<div class=\"grid\">";
    card("Image displacement of each camera", plots::camera_chart(bars), "", true);
    out_ += "</div>";
  }

  void details() {
    std::string inside;
    if (!data_.findings.empty()) {
      inside += "<h3>All findings</h3><ul>";
      for (const ReportData::Finding& f : data_.findings)
        inside += "<li>" + escaped(f.severity + ": " + f.text) + "</li>";
      inside += "</ul>";
    }
    if (data_.solve) {
      inside += "<p>" +
                escaped("Distortion: " + data_.solve->model +
                        ". Scale: " + (data_.solve->scale_from.empty() ? "none" : "from " + data_.solve->scale_from) +
                        ". " + short_number(data_.solve->outliers) + " of " + short_number(data_.solve->observations) +
                        " observations are outliers.") +
                "</p>";
      if (!data_.solve->trials.empty()) {
        inside +=
            "<div class=\"scroll\"><table><thead><tr><th>lens model tried</th><th>BIC</th><th>held out, px</th></tr>"
            "</thead><tbody>";
        for (const auto& trial : data_.solve->trials)
          inside += std::string("<tr") + (trial.chosen ? " class=\"chosen\"" : "") + "><td>" + escaped(trial.model) +
                    "</td><td>" + short_number(trial.bic) + "</td><td>" +
                    (trial.transfer_px ? short_number(*trial.transfer_px) : "") + "</td></tr>";
        inside += "</tbody></table></div>";
      }
    }
    if (!inside.empty())
      out_ += "\n<h2>Details</h2><details><summary>findings and models</summary>" + inside + "</details>";
  }

  const ReportData& data_;
  const ReportVerdict& verdict_;
  std::string out_;
};

}  // namespace

std::string report_page(const ReportData& data, const ReportVerdict& verdict, const std::string& title) {
  return Page(data, verdict).write(title);
}
