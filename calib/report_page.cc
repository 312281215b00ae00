// SPDX-License-Identifier: LGPL-2.1-or-later
#include "report_page.h"

#include <algorithm>

#include "report_plots.h"
#include "report_style.h"

namespace {

using plots::escaped;
using plots::short_number;
using Grade = ReportVerdict::Grade;

constexpr size_t kMostRows = 16;  // of cameras that are good, before they are folded away

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
      fact(short_number(data_.solve->rms_px) + " px", "of residuals");
      std::vector<double> sizes;
      for (const ReportData::Camera& camera : data_.cameras)
        if (const auto size = camera.ellipsoid()) sizes.push_back(*size);
      if (!sizes.empty())
        fact(short_number(1e3 * *std::ranges::max_element(sizes)) + " mm", "within which every camera is, 95 %");
    }
    if (data_.colour)
      fact(short_number(data_.colour->before.median) + " \xe2\x86\x92 " + short_number(data_.colour->after.median),
           "of 255 between cameras' colours");
    if (data_.check) fact(data_.check->holds ? "holds" : "does not hold", "by the latest check");
    out_ += "</ul>";
  }

  void next() {
    out_ += "<h2>What to do next</h2><ol class=\"next\">";
    for (const std::string& step : verdict_.next) out_ += "<li>" + escaped(step) + "</li>";
    if (verdict_.next.empty())
      out_ +=
          "<li>Look at it: <code>lf-serve --rig RIG --watch</code>, and, for figures, <code>lf-rig snapshot RIG --out "
          "STILLS</code> and <code>lf-bench --rig STILLS/rig.json</code>.</li>"
          "<li>Whenever somebody has touched the cameras: <code>lf-calibrate check</code>.</li>";
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
            "Residual: root of the mean square of what fits. Coverage: share of the picture that the light "
            "came to. Place: half axis of the ellipsoid that holds the camera with 95 %.");
    std::string head = "<thead><tr><th>camera</th><th class=\"words\">verdict</th>";
    if (data_.solve)
      head += "<th>residual, px</th><th>outliers</th><th>coverage</th><th>place, mm</th><th>clock, ms</th>";
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
    if (num_good <= kMostRows) {
      out_ += table(other + good);
    } else {
      if (!other.empty()) out_ += table(other);
      out_ +=
          "<details><summary>" + std::to_string(num_good) + " cameras are good</summary>" + table(good) + "</details>";
    }
  }

  // One bar or dot for each camera.
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
            "How far lights are from where the calibrated cameras should see them. What looks like a swirl or "
            "a star in all pictures is a lens that is not understood; what is large in one camera is that "
            "camera.");
    out_ += "<div class=\"grid\">";
    auto bars = chart("Residuals of each camera", "px", [](const ReportData::Camera& c) {
      return c.solved && c.solved->found ? std::optional(c.solved->rms_px) : std::nullopt;
    });
    bars.lines.push_back({solve.expected_px, "what noise alone would leave"});
    card("Of each camera", plots::camera_chart(bars));
    const double enlarged = plots::residual_enlargement(data_);
    card("Over the picture, all cameras", plots::residual_field(data_, 4 * enlarged),
         "Means, " + short_number(4 * enlarged) + " times as long; the bluer the larger.");
    std::string tiles = "<div class=\"tiles\">";
    for (size_t i = 0; i < data_.cameras.size(); i++) {
      const ReportData::Camera& camera = data_.cameras[i];
      if (!camera.solved || camera.solved->coverage.size() != static_cast<size_t>(solve.columns * solve.rows)) continue;
      tiles += std::string("<div class=\"tile ") + name_of(verdict_.cameras[i].grade) + "\">" +
               plots::camera_tile(camera, solve.columns, solve.rows, enlarged) + escaped(camera.title()) + "</div>";
    }
    tiles += "</div>";
    const std::string note = "Shaded: where the light came to. Strokes: residuals, " + short_number(enlarged) +
                             " times as long. Move the light into what is empty next time.";
    if (data_.cameras.size() > 2 * kMostRows)
      tiles = "<details><summary>all " + std::to_string(data_.cameras.size()) + " pictures</summary>" + tiles +
              "</details>";
    card("Coverage, and residuals in each picture", tiles, note, true);
    out_ += "</div>";
  }

  void array() {
    section("Where the cameras are", "Each is in its ellipsoid with 95 %.");
    out_ += "<div class=\"grid\">";
    card("From the front", plots::array_map(data_, verdict_, false), "As the cameras see: x to the right, y down.");
    card("From above", plots::array_map(data_, verdict_, true), "Ahead is up.");
    out_ += "</div>";
  }

  void firmness(const ReportData::Solve& solve) {
    section("How firm it is", "What this recording tells, and what it leaves open.");
    out_ += "<div class=\"grid\">";
    if (!solve.projection.empty())
      card("A new point, placed by all other cameras", plots::projection_chart(solve),
           "How far from there a camera sees it, by its depth: errors of the calibration alone. Below half a pixel "
           "nothing "
           "is seen of it.");
    std::string list = "<ul class=\"modes\">";
    for (const ReportData::Solve::Mode& mode : solve.modes)
      list += "<li>" + plots::share_bar(mode.share, mode.soft) + "<span>" + escaped(mode.text) +
              (mode.soft ? " <b>Soft.</b>" : "") + "</span></li>";
    card("In words", list + "</ul>", "The bar reaches its middle where a better recording is worth it.");
    out_ += "</div>";
  }

  void times() {
    auto dots = chart("Time offsets", "ms",
                      [](const ReportData::Camera& c) { return c.solved ? c.solved->offset_ms : std::nullopt; });
    if (std::ranges::none_of(dots.bars, [](const auto& bar) { return bar.height.has_value(); })) return;
    section("Time", "How much later than its stamps say each camera takes its pictures, beside most others.");
    dots.dots = true;
    for (size_t i = 0; i < dots.bars.size(); i++)
      if (data_.cameras[i].solved) dots.bars[i].sigma = data_.cameras[i].solved->offset_sigma_ms.value_or(0);
    out_ += "<div class=\"grid\">";
    card("Offsets of the clocks", plots::camera_chart(dots), "Whiskers: two standard deviations.", true);
    out_ += "</div>";
  }

  void colours(const ReportData::Colour& colour) {
    section("Colours",
            "How far two cameras are from each other where they see the same, on what the fit did not see (" +
                colour.from + ").");
    std::string table =
        "<table><thead><tr><th>corrected are</th><th>median, of 255</th><th>95 %</th></tr></thead><tbody>";
    for (const ReportData::Colour::Row& row : colour.rows)
      table += std::string("<tr") + (row.chosen ? " class=\"chosen\"" : "") + "><td class=\"words\">" +
               escaped(row.what) + (row.chosen ? " (chosen)" : "") + "</td><td>" + short_number(row.median) +
               "</td><td>" + short_number(row.p95) + "</td></tr>";
    out_ += "<div class=\"grid\">";
    card("Before and after", table + "</tbody></table>");
    auto gains = chart("Brightness as cameras give it", "%", [](const ReportData::Camera& c) {
      return c.coloured ? std::optional(100 * (c.coloured->gain - 1)) : std::nullopt;
    });
    gains.dots = true;
    card("Before: brightness beside most others", plots::camera_chart(gains));
    auto left = chart("Colour differences that are left", "of 255", [](const ReportData::Camera& c) {
      return c.coloured && c.coloured->corrected ? std::optional(c.coloured->rms) : std::nullopt;
    });
    left.lines.push_back({colour.after.median, "median of all"});
    card("After: differences that are left", plots::camera_chart(left));
    out_ += "</div>";
  }

  void check(const ReportData::Check& check) {
    section("Since then", check.from == "monitor" ? "What the running monitor says." : "By a later recording.");
    auto bars = chart("How far pictures have moved", "px", [](const ReportData::Camera& c) {
      return c.checked && c.checked->state != "unknown" ? std::optional(c.checked->shift_px) : std::nullopt;
    });
    if (check.from != "monitor") bars.lines.push_back({0.3, "more has moved"});
    out_ += "<div class=\"grid\">";
    card("How far each picture has moved", plots::camera_chart(bars), "", true);
    out_ += "</div>";
  }

  void details() {
    std::string inside;
    if (!data_.findings.empty()) {
      inside += "<h3>All that was found</h3><ul>";
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
