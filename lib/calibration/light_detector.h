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

// The pictures of one camera so far.
struct LightRecord {
  size_t frames = 0;
  size_t lit = 0;         // frames that show a light
  size_t busy = 0;        // frames so much of which is brighter than the background that no light can be told
  double noise = 0;       // standard deviation of a sample, of 255
  double background = 0;  // mean of the background, of 255
  double brightest = 0;   // the brightest sample of all, of 255
};

// Finds small lights that move through a dark room, in one camera's pictures one after the other. What is there all the
// time (lamps of machines, a window) is background; what comes from a light elsewhere (reflections) is found, too: only
// the geometry of several cameras tells which is which.
//
// The background is the running median of each pixel, so that nothing must be learnt first. A light is where its image
// equals a normal distribution best (the centroid under a weight that adapts to the image's size and direction, as
// Bernstein and Jarvis 2002 do for galaxies): as exact as a fit for round, elongated and clipped images alike. Not
// thread-safe.
class LightDetector {
 public:
  LightDetector(int width, int height);

  // The lights of the next picture: 8 bits a sample, `stride` bytes from row to row. Brightest first, not more than
  // kMostSights; none in the first picture, which is the background.
  std::vector<Sight> look(const uint8_t* grey, ptrdiff_t stride);
  const LightRecord& record() const { return record_; }

  static constexpr size_t kMostSights = 8;

 private:
  struct Blob;
  std::vector<Blob> find_blobs(float threshold);
  bool refine(Blob& blob, const std::vector<Blob>& others, const uint8_t* grey, ptrdiff_t stride);
  void part_neighbours(std::vector<Blob>& blobs, const uint8_t* grey, ptrdiff_t stride);
  void mark_lit(const std::vector<Blob>& blobs);
  void watch_noise(const std::vector<Blob>& blobs);
  void learn(const uint8_t* grey, ptrdiff_t stride);
  float at(int x, int y) const { return difference_[static_cast<size_t>(y) * width_ + x]; }

  int width_, height_;
  std::vector<float> background_, difference_;
  std::vector<uint8_t> lit_;           // pixels of lights, and those around them
  double white_ = 0, correlated_ = 0;  // moments of noise: as they would be if it were white, and as they are
  uint32_t random_ = 1;
  LightRecord record_;
};

// A light, or a reflection of one, followed through the frames of one camera.
struct LightPath {
  struct Point {
    double time = 0;  // the camera's stamp
    Sight sight;
  };
  std::vector<Point> points;  // points in the order of time, two at least
  double brightness = 0;      // median brightness of its points
  bool still = false;         // a lamp, or what has only been switched on: no light that is moved
};

// All paths in one camera's frames, at evened_stamps(). Sights that nothing continues are left out.
std::vector<LightPath> link_light_paths(const LightSights::Camera& camera);

// The place of a path between its points: on the cubic through the four around.
struct PathPlace {
  Vec2 pixel{0, 0};
  Vec2 velocity{0, 0};    // pixels a second
  double sigma = 0;       // standard deviation of the place, from those of the points around
  double brightness = 0;  // brightness of the nearest point
};
// The place at a stamp; nothing outside of the path, and in gaps of more than kMostMissed frames.
std::optional<PathPlace> place_at(const LightPath& path, double time, double frame_time);

inline constexpr int kMostMissed = 2;

// The frames' stamps as an even rhythm has them, frames missing here and there, where they are that but for a jitter:
// files round stamps to a millisecond, in which a light goes half a millimetre; and drivers stamp what has arrived. As
// they are where there is no such rhythm.
std::vector<double> evened_stamps(const LightSights::Camera& camera);

// Seconds from frame to frame, the median; 0 where there are fewer than two.
double frame_time_of(const LightSights::Camera& camera);

// Which places of a camera's picture, of 4 x 3, a light came to. A plain value.
class PicturePlaces {
 public:
  static constexpr int kColumns = 4, kRows = 3;

  // The size of the picture, pixels.
  PicturePlaces(int width, int height) : width_(width), height_(height) {}

  // The light came to this pixel; what is outside of the picture counts as its border.
  void come(const Vec2& pixel);
  bool has(int column, int row) const { return came_[static_cast<size_t>(row * kColumns + column)]; }
  double share() const;  // of the places, 0 to 1
  // Where it did not come, in the words of who looks at the picture, in the order of reading.
  struct Gap {
    std::string name;  // "upper left", "middle right"
    int places = 0;    // how many places, of two, it did not come to
  };
  std::vector<Gap> gaps() const;

 private:
  int width_, height_;
  std::array<bool, static_cast<size_t>(kColumns) * kRows> came_{};
};

// The names of gaps: "upper left, lower right".
std::string listed(const std::vector<PicturePlaces::Gap>& gaps);

// Where a moved light, or a bar with two, has come to in the pictures of an array, while it is being filmed, and where
// it is to go next.
//
// Depths are those of the array as it was planned: good enough to tell near from far, whatever the true lenses and
// poses are. A camera's depth at the time of a look at another camera is by both their lines of sight, its own taken
// between two looks. Not thread-safe.
class LightCoverage {
 public:
  // `lights`: how many are moved; the brightest are taken for them. Throws Error where there are none.
  LightCoverage(const Rig& rig, int lights);

  // What a camera showed at `time`, seconds; looks may be far apart (a few a second will do), and times of a camera
  // grow. Cameras that were never looked at ask for nothing.
  void look(CameraIndex camera, double time, const std::vector<Sight>& sights);

  const PicturePlaces& places(CameraIndex camera) const { return cameras_[camera].places; }
  // How the light must move along a camera's axis, so that it has been near and far: "nearer", "farther", or "" where
  // it has, or where nothing is known of its depth yet.
  std::string depth_wanted(CameraIndex camera) const;
  // "upper left, lower left, nearer"; "" where a camera lacks nothing.
  std::string wanted(CameraIndex camera) const;
  // For the person with the light, in one line: how far it is, what most cameras lack, and which ones lack most.
  // "The light came to 61 % of the pictures. Next: upper left (40 cameras), nearer (3 cameras). Camera 12 (cam_01_04)
  // 25 %: upper left, lower left, nearer."
  std::string told() const;

 private:
  struct Look {
    double time = 0;
    Vec2 pixel{0, 0};  // middle of the lights
  };
  struct Camera {
    explicit Camera(const lf::Camera& planned) : places(planned.width, planned.height) {}
    PicturePlaces places;
    size_t looks = 0;
    bool lit = false;
    std::optional<Look> last;    // the last look, where all lights were seen
    std::vector<double> depths;  // metres along its axis, in no order
  };
  std::string most_wanted(CameraIndex camera) const;
  // The light between two looks of a camera, with the last look of another one.
  void measure_depth(CameraIndex camera, const Look& before, const Look& now);

  Rig rig_;
  size_t lights_;
  double size_ = 0;  // metres from camera to camera, the farthest
  std::vector<Camera> cameras_;
};

}  // namespace lf
