// SPDX-License-Identifier: LGPL-2.1-or-later
#include "show/output.h"

#include <gst/gst.h>

#include <cstdio>
#include <regex>

#include "base/error.h"
#include "progress.h"

namespace {

constexpr int kFilmQuality = 90;

}  // namespace

Output::Output(const std::string& path, FrameRate rate) : path_(path), rate_(rate) {
  static const std::regex still(R"(([^%]*)\.(png|jpg))"), numbered(R"([^%]*%(0[1-9])?d[^%]*\.(png|jpg))"),
      film(R"([^%]*\.mkv)");
  if (std::regex_match(path, still))
    kind_ = Kind::kOne;
  else if (std::regex_match(path, numbered))
    kind_ = Kind::kNumbered;
  else if (std::regex_match(path, film))
    kind_ = Kind::kFilm;
  else
    throw lf::Error("--out " + path + ": must be NAME.png or NAME.jpg, of several pictures NAME_%03d.png or NAME.mkv");
  if (kind_ == Kind::kFilm) gst_init(nullptr, nullptr);
}

void Output::add(const lf::Image& rgb) {
  if (kind_ == Kind::kFilm) {
    if (!film_) film_ = std::make_unique<MjpegWriter>(path_, rgb.width(), rgb.height(), rate_, kFilmQuality);
    return film_->add(rgb);
  }
  if (kind_ == Kind::kOne) return lf::save_image(rgb, path_);
  // The pattern was checked when it came.
  std::string name(path_.size() + 16, 0);
  name.resize(static_cast<size_t>(std::snprintf(name.data(), name.size(), path_.c_str(), count_++)));
  lf::save_image(rgb, name);
}

void Output::finish() {
  if (film_) film_->finish();
}

void OutputOptions::add_to(cli::App& command, const char* what) {
  command.add_option("--out", out, what)->required()->type_name("FILE");
  framerate_options.push_back(command.add_option("--framerate", framerate, "Frame rate of a film, pictures per second")
                                  ->capture_default_str()
                                  ->check(cli::Range(0.1, 1000.0)));
}

void OutputOptions::check() const {
  const bool given = std::ranges::any_of(framerate_options, [](const cli::Option* option) { return bool(*option); });
  if (given && !out.ends_with(".mkv"))
    throw lf::Error("--framerate: only a film (.mkv) has a frame rate; --out " + out + " is not a film");
}

Output OutputOptions::open() const {
  FrameRate rate;
  gst_util_double_to_fraction(framerate, &rate.numerator, &rate.denominator);
  return Output(out, rate);
}

void show_views(const OutputOptions& options, const std::vector<lf::NamedView>& views,
                const std::function<lf::Image(const lf::NamedView&)>& make) {
  Output output = options.open();
  Progress progress("showing", views.size());
  for (const lf::NamedView& view : views) {
    output.add(make(view));
    progress.step();
  }
  output.finish();
  progress.finish();
  std::printf("%s: %zu %s\n", options.out.c_str(), views.size(), views.size() == 1 ? "picture" : "pictures");
}
