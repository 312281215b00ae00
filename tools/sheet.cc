// SPDX-License-Identifier: LGPL-2.1-or-later
#include "sheet.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

namespace {

constexpr int kPanelWidth = 480, kPanelHeight = 360, kGap = 16, kTitleHeight = 30, kHeadingHeight = 52,
              kFootHeight = 36;
constexpr int kMostTiles = 16;  // a side of the mosaic
const cv::Scalar kPaper(24, 26, 30), kInk(235, 235, 235), kQuiet(160, 165, 170);

cv::Mat as_mat(const lf::Image& rgb) {
  return {rgb.height(), rgb.width(), CV_8UC3, const_cast<uint8_t*>(rgb.data().data())};
}

void write(cv::Mat& on, const std::string& text, cv::Point at, double scale, const cv::Scalar& colour) {
  cv::putText(on, text, at, cv::FONT_HERSHEY_DUPLEX, scale, colour, 1, cv::LINE_AA);
}

// Scaled to fit, in the middle of `into`.
void place(const lf::Image& picture, cv::Mat into) {
  const double scale =
      std::min(static_cast<double>(into.cols) / picture.width(), static_cast<double>(into.rows) / picture.height());
  const cv::Size size(std::max(1, static_cast<int>(std::lround(picture.width() * scale))),
                      std::max(1, static_cast<int>(std::lround(picture.height() * scale))));
  cv::Mat scaled;
  cv::resize(as_mat(picture), scaled, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_CUBIC);
  scaled.copyTo(into(cv::Rect((into.cols - size.width) / 2, (into.rows - size.height) / 2, size.width, size.height)));
}

// `most` of 0..n-1 or all, evenly spaced.
std::vector<int> evenly(int n, int most) {
  const int count = std::min(n, most);
  std::vector<int> chosen;
  for (int i = 0; i < count; i++) chosen.push_back(static_cast<int>(static_cast<int64_t>(i) * n / count));
  return chosen;
}

}  // namespace

lf::Image camera_mosaic(const lf::Rig& rig, const lf::CameraImages& images, int width) {
  const int n = static_cast<int>(rig.cameras.size());
  int columns = static_cast<int>(std::ceil(std::sqrt(n))), rows = (n + columns - 1) / columns;
  if (rig.topology.type == lf::Topology::Type::kGrid) {
    columns = rig.topology.columns;
    rows = rig.topology.rows;
  }
  const std::vector<int> xs = evenly(columns, kMostTiles), ys = evenly(rows, kMostTiles);
  const int tile_width = std::max(1, width / static_cast<int>(xs.size()));
  const int tile_height = std::max(1, tile_width * rig.cameras[0].height / rig.cameras[0].width);
  lf::Image mosaic(lf::PixelFamily::kRgb, tile_width * static_cast<int>(xs.size()),
                   tile_height * static_cast<int>(ys.size()));
  cv::Mat out = as_mat(mosaic);
  for (size_t r = 0; r < ys.size(); r++)
    for (size_t c = 0; c < xs.size(); c++) {
      const int camera = ys[r] * columns + xs[c];
      if (camera >= n) continue;
      const cv::Rect tile(static_cast<int>(c) * tile_width, static_cast<int>(r) * tile_height, tile_width, tile_height);
      place(images(static_cast<lf::CameraIndex>(camera)), out(tile));
    }
  return mosaic;
}

lf::Image make_sheet(const std::string& heading, const std::vector<Panel>& panels, int columns,
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
