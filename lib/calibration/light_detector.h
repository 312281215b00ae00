// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/maths.h"
#include "calibration/tracks.h"
#include "rig/rig.h"

namespace lf {

struct LightDetectorStats {
  size_t frames = 0;
  size_t lit = 0;         // number of frames with a light
  size_t busy = 0;        // number of frames with too many bright pixels to detect lights
  double noise = 0;       // standard deviation of a pixel, 0 to 255
  double background = 0;  // mean of the background, 0 to 255
  double brightest = 0;   // maximum pixel of all frames, 0 to 255
};

// Detects small moving lights in a dark room, in consecutive frames of one camera. Static lights (LEDs of devices, a
// window) become part of the background. Reflections are reported as lights, because only a comparison of several
// cameras can tell them apart.
//
// The background is the running median of each pixel, so no training is needed. The position of a light is its centroid
// under an elliptical Gaussian weight that adapts to the image (Bernstein and Jarvis 2002, for galaxies). This is as
// accurate as fitting a model, also for elongated and clipped images. Not thread-safe.
class LightDetector {
 public:
  LightDetector(int width, int height);

  // Returns the lights of the next frame, brightest first, at most kMaxDetections. The first frame only initialises the
  // background. `grey` has 8 bits per pixel and `stride` bytes per row.
  std::vector<LightDetection> detect(const uint8_t* grey, ptrdiff_t stride);
  const LightDetectorStats& record() const { return record_; }

  static constexpr size_t kMaxDetections = 8;

 private:
  struct Blob;
  std::vector<Blob> find_blobs(float threshold);
  bool refine(Blob& blob, const std::vector<Blob>& others, const uint8_t* grey, ptrdiff_t stride);
  void split_neighbours(std::vector<Blob>& blobs, const uint8_t* grey, ptrdiff_t stride);
  void mark_lit(const std::vector<Blob>& blobs);
  void update_noise(const std::vector<Blob>& blobs);
  void learn(const uint8_t* grey, ptrdiff_t stride);
  float at(int x, int y) const { return difference_[static_cast<size_t>(y) * width_ + x]; }

  int width_, height_;
  std::vector<float> background_, difference_;
  std::vector<uint8_t> lit_;           // pixels of lights and their surroundings
  double white_ = 0, correlated_ = 0;  // squared first moments of noise: expected for white noise, and measured
  uint32_t random_ = 1;
  LightDetectorStats record_;
};

// A light or a reflection that is followed through the frames of one camera.
struct LightPath {
  struct Point {
    double time = 0;  // camera stamp, seconds
    LightDetection sight;
  };
  std::vector<Point> points;  // in the order of time, at least two
  double brightness = 0;
  bool still = false;  // a static lamp, or one that was only switched on
};

// Connects the detections of one camera to light paths. The stamps are free of jitter if the frame rate is constant.
// Single detections are left out.
std::vector<LightPath> link_light_paths(const LightDetections::Camera& camera);

// A position on a path between frames, from the cubic through the four surrounding points.
struct PathSample {
  Vec2 pixel{0, 0};
  Vec2 velocity{0, 0};  // pixels per second
  double sigma = 0;     // standard deviation of the position, propagated from the surrounding points, pixels
  double brightness = 0;
};
// Returns the position at a stamp. Returns nullopt outside the path and in gaps of more than kMaxMissedFrames frames.
std::optional<PathSample> interpolate_path(const LightPath& path, double time, double frame_time);

inline constexpr int kMaxMissedFrames = 2;

// Returns the median frame interval in seconds, or 0 with fewer than two frames.
double frame_time_of(const LightDetections::Camera& camera);

// Remembers which cells of a 4 x 3 grid over a camera's image a light has visited. Copyable.
class CoverageGrid {
 public:
  static constexpr int kColumns = 4, kRows = 3;

  CoverageGrid(int width, int height) : width_(width), height_(height) {}

  // Marks the cell at `pixel`. A pixel outside the image counts as the nearest border cell.
  void come(const Vec2& pixel);
  bool has(int column, int row) const { return covered_[static_cast<size_t>(row * kColumns + column)]; }
  double share() const;  // visited share of the cells, 0 to 1
  // An area that has not been visited, named as a person sees it in the image.
  struct Gap {
    std::string name;  // "upper left", "middle right"
    int places = 0;    // number of cells in the area, 1 or 2
  };
  std::vector<Gap> gaps() const;

 private:
  int width_, height_;
  std::array<bool, static_cast<size_t>(kColumns) * kRows> covered_{};
};

// Returns for example "upper left, lower right".
std::string gap_names(const std::vector<CoverageGrid::Gap>& gaps);

// Tells the operator, during a recording, where the light or bar must still be moved so that it covers the images of
// all cameras.
//
// Depths are triangulated from the rays of two cameras of the nominal rig, which is accurate enough to distinguish near
// from far. A camera's own ray is interpolated between two of its frames. Not thread-safe.
class LightCoverage {
 public:
  // Prepares for recording with the nominal positions of `rig`. `lights` is the number of moved lights; of the
  // detections in a frame, that many of the brightest count. Throws Error if `lights` is less than 1.
  LightCoverage(const Rig& rig, int lights);

  // Adds the detections of a camera at `time` (seconds, increasing for each camera). A few frames per second are
  // enough. Cameras without frames do not appear in the directions.
  void add_frame(CameraIndex camera, double time, const std::vector<LightDetection>& sights);

  const CoverageGrid& places(CameraIndex camera) const { return cameras_[camera].places; }
  // Returns the direction along a camera's axis that the light has not covered: "nearer", "farther", or "" if both are
  // covered or the depths are unknown.
  std::string depth_wanted(CameraIndex camera) const;
  // Returns what the operator should still do for a camera, for example "upper left, lower left, nearer".
  std::string wanted(CameraIndex camera) const;
  // Returns one line for the operator: the overall coverage, the most frequent gaps, and the cameras with the largest
  // gaps. For example: "The light has covered 61 % of the images. Next: upper left (40 cameras), nearer (3 cameras).
  // Camera 12 (cam_01_04) 25 %: upper left, lower left, nearer."
  std::string summary() const;

 private:
  struct TimedPosition {
    double time = 0;
    Vec2 pixel{0, 0};
  };
  struct Camera {
    explicit Camera(const lf::Camera& planned) : places(planned.width, planned.height) {}
    CoverageGrid places;
    size_t num_frames = 0;
    bool lit = false;
    std::optional<TimedPosition> last;
    std::vector<double> depths;  // metres along the camera's axis, unordered
  };
  std::string most_wanted(CameraIndex camera) const;
  // Triangulates the light, interpolated between two frames of a camera, with the last frame of another camera.
  void measure_depth(CameraIndex camera, const TimedPosition& before, const TimedPosition& now);

  Rig rig_;
  size_t lights_;
  double size_ = 0;  // largest distance between two cameras, metres
  std::vector<Camera> cameras_;
};

}  // namespace lf
