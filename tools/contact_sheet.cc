// SPDX-License-Identifier: LGPL-2.1-or-later
#include "contact_sheet.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "image/image.h"

namespace {

constexpr int kPanelWidth = 480, kPanelHeight = 360, kGap = 16, kTitleHeight = 30, kHeadingHeight = 52,
              kFootHeight = 36;
constexpr int kMaxTiles = 16;
constexpr double kCapital = 21;
constexpr int kScaleGap = 8, kBarHeight = 12, kLineHeight = 18;
constexpr double kSmall = 9;
const cv::Scalar kPaper(24, 26, 30), kInk(235, 235, 235), kQuiet(160, 165, 170);

cv::Mat as_mat(const lf::Image& rgb) {
  return {rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data())};
}

void write(cv::Mat& on, const std::string& text, cv::Point at, double scale, const cv::Scalar& colour) {
  cv::putText(on, text, at, cv::FONT_HERSHEY_DUPLEX, scale, colour, 1, cv::LINE_AA);
}

void place(const lf::Image& picture, cv::Mat into) {
  const double scale =
      std::min(static_cast<double>(into.cols) / picture.width(), static_cast<double>(into.rows) / picture.height());
  const cv::Size size(std::max(1, static_cast<int>(std::lround(picture.width() * scale))),
                      std::max(1, static_cast<int>(std::lround(picture.height() * scale))));
  cv::Mat scaled;
  cv::resize(as_mat(picture), scaled, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  scaled.copyTo(into(cv::Rect((into.cols - size.width) / 2, (into.rows - size.height) / 2, size.width, size.height)));
}

std::vector<int> evenly(int n, int most) {
  const int count = std::min(n, most);
  std::vector<int> chosen;
  for (int i = 0; i < count; i++) chosen.push_back(static_cast<int>(static_cast<int64_t>(i) * n / count));
  return chosen;
}

}  // namespace

lf::Image camera_mosaic(const lf::Rig& rig, const lf::CameraImages& images, int width, bool names) {
  const int n = static_cast<int>(rig.cameras.size());
  int columns = static_cast<int>(std::ceil(std::sqrt(n))), rows = (n + columns - 1) / columns;
  if (rig.topology.type == lf::Topology::Type::kGrid) {
    columns = rig.topology.columns;
    rows = rig.topology.rows;
  }
  const std::vector<int> xs = evenly(columns, kMaxTiles), ys = evenly(rows, kMaxTiles);
  const int tile_width = std::max(1, width / static_cast<int>(xs.size()));
  const int tile_height = std::max(1, tile_width * rig.cameras[0].height / rig.cameras[0].width);
  lf::Image mosaic(lf::PixelFamily::kRgb, tile_width * static_cast<int>(xs.size()),
                   tile_height * static_cast<int>(ys.size()));
  cv::Mat out = as_mat(mosaic);
  for (size_t r = 0; r < ys.size(); r++)
    for (size_t c = 0; c < xs.size(); c++) {
      const int camera = ys[r] * columns + xs[c];
      if (camera >= n) continue;
      cv::Rect tile(static_cast<int>(c) * tile_width, static_cast<int>(r) * tile_height, tile_width, tile_height);
      if (names) tile.width -= tile.width > 1, tile.height -= tile.height > 1;
      place(images(static_cast<lf::CameraIndex>(camera)), out(tile));
      if (!names) continue;
      const std::string& name = rig.cameras[static_cast<size_t>(camera)].name;
      const std::string text = name.empty() ? std::to_string(rig.cameras[static_cast<size_t>(camera)].id) : name;
      const double size = std::min(10.0, 0.7 * tile_width / text_width(text, 1));
      write_text(mosaic, text, {tile.x + 0.5 * size, tile.y + tile.height - 0.5 * size}, size);
    }
  return mosaic;
}

void write_text(lf::Image& on, const std::string& text, lf::Vec2 at, double size, bool centred) {
  cv::Mat out = as_mat(on);
  if (centred) at += lf::Vec2(-text_width(text, size) / 2, size / 2);
  const cv::Point place(static_cast<int>(std::lround(at.x)), static_cast<int>(std::lround(at.y)));
  const double scale = size / kCapital;
  cv::putText(out, text, place, cv::FONT_HERSHEY_DUPLEX, scale, kPaper, 3, cv::LINE_AA);
  write(out, text, place, scale, kInk);
}

double text_width(const std::string& text, double size) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_DUPLEX, 1, 1, &baseline).width * size / kCapital;
}

lf::Image with_colour_bar(const lf::Image& picture, const ColourBar& scale) {
  const int width = picture.width(), left = kScaleGap, right = width - kScaleGap;
  const int scale_height = 2 * kScaleGap + kBarHeight + kLineHeight * (1 + static_cast<int>(scale.lines.size()));
  lf::Image whole(lf::PixelFamily::kRgb, width, picture.height() + scale_height);
  cv::Mat out = as_mat(whole);
  out.setTo(kPaper);
  as_mat(picture).copyTo(out(cv::Rect(0, 0, width, picture.height())));
  const int bar = picture.height() + kScaleGap;
  for (int x = left; x < right; x++) {
    const auto [r, g, b] = lf::heat_colour(static_cast<double>(x - left) / std::max(1, right - left - 1));
    out(cv::Rect(x, bar, 1, kBarHeight)).setTo(cv::Scalar(r, g, b));
  }
  const double room = right - left, squares = scale.none.empty() ? 1 : 3;
  const double size = std::min(kSmall, (room - 16 * squares) / text_width(scale.low + scale.none + scale.high, 1));
  int line = bar + kBarHeight + kLineHeight;
  const auto at = [&](const std::string& text, double x, const cv::Scalar& colour, double high) {
    write(out, text, {static_cast<int>(x), line}, high / kCapital, colour);
  };
  at(scale.low, left, kInk, size);
  at(scale.high, right - text_width(scale.high, size), kInk, size);
  if (!scale.none.empty()) {
    const double x =
        left +
        (room + text_width(scale.low, size) - text_width(scale.high, size) - text_width(scale.none, size) + 16) / 2;
    out(cv::Rect(static_cast<int>(x) - 16, line - 10, 11, 11)).setTo(cv::Scalar::all(lf::kNoValueGrey));
    at(scale.none, x, kInk, size);
  }
  for (const std::string& text : scale.lines) {
    line += kLineHeight;
    at(text, left, kQuiet, std::min(kSmall, room / text_width(text, 1)));
  }
  return whole;
}

lf::Image make_contact_sheet(const std::string& heading, const std::vector<Panel>& panels, int columns,
                             const std::string& foot) {
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  const int cell_height = kTitleHeight + kPanelHeight + kGap;
  lf::Image sheet(lf::PixelFamily::kRgb, kGap + columns * (kPanelWidth + kGap),
                  kHeadingHeight + rows * cell_height + kFootHeight);
  cv::Mat out = as_mat(sheet);
  out.setTo(kPaper);
  write(out, heading, {kGap, 36}, 0.85, kInk);
  for (size_t i = 0; i < panels.size(); i++) {
    const int x = kGap + static_cast<int>(i) % columns * (kPanelWidth + kGap);
    const int y = kHeadingHeight + static_cast<int>(i) / columns * cell_height;
    write(out, panels[i].title, {x, y + 20}, 0.5, kInk);
    place(panels[i].picture, out(cv::Rect(x, y + kTitleHeight, kPanelWidth, kPanelHeight)));
  }
  write(out, foot, {kGap, sheet.height() - 16}, 0.5, kQuiet);
  return sheet;
}
