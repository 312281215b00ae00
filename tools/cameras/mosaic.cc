// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/mosaic.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/text.h"
#include "cameras/rig_cameras.h"
#include "image/image_file.h"

namespace lf::cameras {
namespace {

// The seconds between two thumbnails of a camera are kEvery times the number of cameras, and at least kMinEvery.
constexpr double kEvery = 0.01, kMinEvery = 0.15;
// Thumbnails are made for this many seconds after a request. A page requests a mosaic every 0.2 s; a single request
// must not decode all cameras many times.
constexpr double kLooksOn = 1;
constexpr std::chrono::milliseconds kEncodeEvery{100};
constexpr double kSilent = 2;      // seconds without a frame until a camera counts as silent
constexpr double kRateMemory = 1;  // time constant of the averaged frame rate, seconds
constexpr int kPartColumns = 8, kPartRows = 6;
constexpr int kMosaicQuality = 75;

Image shrink(const Image& rgb, int width, int height) {
  Image small(PixelFamily::kRgb, width, height);
  for (int y = 0; y < height; y++)
    for (int x = 0; x < width; x++) {
      const int left = x * rgb.width() / width, right = std::max(left + 1, (x + 1) * rgb.width() / width);
      const int top = y * rgb.height() / height, bottom = std::max(top + 1, (y + 1) * rgb.height() / height);
      int sum[3] = {};
      for (int v = top; v < bottom; v++)
        for (int u = left; u < right; u++)
          for (int c = 0; c < 3; c++) sum[c] += rgb.pixel(u, v)[c];
      for (int c = 0; c < 3; c++)
        small.pixel(x, y)[c] = static_cast<uint8_t>(sum[c] / ((right - left) * (bottom - top)));
    }
  return small;
}

std::vector<float> parts_of(const Image& small) {
  const Image parts = shrink(small, kPartColumns, kPartRows);
  std::vector<float> brightness;
  for (size_t i = 0; i < parts.data().size(); i += 3)
    brightness.push_back((0.299f * parts.data()[i] + 0.587f * parts.data()[i + 1] + 0.114f * parts.data()[i + 2]) /
                         255);
  return brightness;
}

}  // namespace

Mosaic::Mosaic(const Rig& rig) : tiles_(rig.cameras.size()), waves_(rig.cameras.size()) {
  const bool grid = rig.topology.type == Topology::Type::kGrid;
  columns_ = grid ? rig.topology.columns : static_cast<int>(std::ceil(std::sqrt(static_cast<double>(tiles_.size()))));
  rows_ = (static_cast<int>(tiles_.size()) + columns_ - 1) / columns_;
  width_ = std::clamp(1920 / columns_, 48, 320) & ~1;
  const Camera& first = rig.cameras[0];
  height_ = std::max(2, width_ * first.height / first.width & ~1);
  for (size_t i = 0; i < tiles_.size(); i++) {
    tiles_[i].id = rig.cameras[i].id;
    tiles_[i].name = rig.cameras[i].name;
    tiles_[i].column = static_cast<int>(i) % columns_;
    tiles_[i].row = static_cast<int>(i) / columns_;
  }
}

Mosaic::Tile* Mosaic::find(uint32_t id) {
  const auto found = std::find_if(tiles_.begin(), tiles_.end(), [id](const Tile& tile) { return tile.id == id; });
  return found == tiles_.end() ? nullptr : &*found;
}

void Mosaic::see(uint32_t id, GstBuffer* buffer, GstCaps* caps, double now) {
  {
    const std::lock_guard lock(mutex_);
    Tile* const seen = find(id);
    if (!seen) return;
    Tile& tile = *seen;
    const double since = now - tile.arrival_time, share = 1 - std::exp(-since / kRateMemory);
    tile.rate = since > kSilent ? 0 : tile.rate + share * (1 / std::max(since, 1e-4) - tile.rate);
    tile.arrival_time = now;
    if (now > watched_ + kLooksOn ||
        now < tile.looked + std::max(kMinEvery, kEvery * static_cast<double>(tiles_.size())))
      return;
    tile.looked = now;
  }
  Image small;
  try {
    small = shrink(rgb_of(buffer, caps), width_, height_);
  } catch (const Error&) {
    return;
  }
  const std::vector<float> parts = parts_of(small);
  const std::lock_guard lock(mutex_);
  Tile* const tile = find(id);
  tile->small = std::move(small);
  waves_.see(static_cast<size_t>(tile - tiles_.data()), parts, now);
}

void Mosaic::swap(uint32_t a, uint32_t b) {
  const std::lock_guard lock(mutex_);
  Tile *const first = find(a), *const second = find(b);
  if (!first || !second) return;
  std::swap(first->small, second->small);
  std::swap(first->arrival_time, second->arrival_time);
  std::swap(first->rate, second->rate);
  waves_ = HandWaveDetector(tiles_.size());
}

std::vector<uint8_t> Mosaic::jpeg(double now) {
  std::unique_lock lock(mutex_);
  watched_ = now;
  wanted_ = true;
  if (!encoder_.joinable()) encoder_ = std::jthread([this](const std::stop_token& stop) { encode(stop); });
  changed_.notify_all();
  changed_.wait(lock, [this] { return !jpeg_.empty() || !problem_.empty(); });
  if (!problem_.empty()) throw Error(problem_);
  return jpeg_;
}

// Limits the thread to half of a CPU core, for any number of clients.
void Mosaic::encode(const std::stop_token& stop) {
  using Clock = std::chrono::steady_clock;
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return wanted_; })) {
    wanted_ = false;
    const Clock::time_point began = Clock::now();
    const Image all = picture();
    lock.unlock();
    std::vector<uint8_t> jpeg;
    std::string problem;
    try {
      jpeg = encode_jpeg(all, kMosaicQuality);
    } catch (const Error& error) {
      problem = error.what();
    }
    const Clock::duration took = Clock::now() - began;
    lock.lock();
    jpeg_ = std::move(jpeg);
    problem_ = std::move(problem);
    changed_.notify_all();
    changed_.wait_for(lock, stop, std::max<Clock::duration>(kEncodeEvery, took), [] { return false; });
  }
}

// The caller holds mutex_.
Image Mosaic::picture() const {
  Image all(PixelFamily::kRgb, columns_ * width_, rows_ * height_);
  for (const Tile& tile : tiles_) {
    if (tile.small.data().empty()) continue;
    for (int y = 0; y < height_; y++)
      std::memcpy(all.pixel(tile.column * width_, tile.row * height_ + y), tile.small.pixel(0, y),
                  3 * static_cast<size_t>(width_));
  }
  return all;
}

nlohmann::json Mosaic::state(double now, const std::function<std::string(uint32_t id)>& problem) const {
  const std::lock_guard lock(mutex_);
  const std::optional<size_t> lit = waves_.found();
  nlohmann::json cameras = nlohmann::json::array();
  for (size_t i = 0; i < tiles_.size(); i++) {
    const Tile& tile = tiles_[i];
    const bool silent = now - tile.arrival_time > kSilent;
    std::string why;
    if (silent) why = problem(tile.id);
    if (silent && why.empty()) why = "no frames";
    cameras.push_back({{"id", tile.id},
                       {"name", tile.name},
                       {"column", tile.column},
                       {"row", tile.row},
                       {"rate", silent ? 0 : std::round(10 * tile.rate) / 10},
                       {"problem", why},
                       {"lit", lit == i}});
  }
  return {{"columns", columns_}, {"rows", rows_}, {"tile", {width_, height_}}, {"cameras", cameras}};
}

}  // namespace lf::cameras
