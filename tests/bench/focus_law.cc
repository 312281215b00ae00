// SPDX-License-Identifier: LGPL-2.1-or-later
// Searches random situations (arrays, eyes, sizes, scenes, faults) for one in which a focal surface shows a worse
// picture than the viewer's plane: the law says that there is none, to kLaw. Prints the worst ones, and with --out
// their pictures (truth, plane, surface). Exits 1 if the law is broken.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "bench/focus_situation.h"
#include "command_line.h"
#include "image/image.h"

namespace {

constexpr double kLaw = -0.1;  // dB

struct Found {
  uint64_t seed;
  std::string text;
  lf::focus::Watched watched;
};

void print(const Found& f) {
  if (f.watched.worst < 0) return;
  const lf::focus::Seen &at = f.watched.seen[f.watched.worst], &last = f.watched.seen.back();
  std::printf("%6lu: %+6.2f dB (plane %.2f) at picture %d, at last %+.2f (%.2f to %.2f m): %s\n",
              static_cast<unsigned long>(f.seed), f.watched.lead(), at.plane_db, at.picture,
              last.surface_db - last.plane_db, last.near, last.far, f.text.c_str());
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  cli::App app("Searches for situations in which a focal surface is worse than a plane.", "bench-focus-law");
  uint64_t first = 1, situations = 1000, show = 10;
  int pictures = 60;
  std::string out;
  bool all = false;
  app.add_option("--first", first, "Seed of the first situation")->capture_default_str();
  app.add_option("--situations", situations, "How many")->capture_default_str();
  app.add_option("--pictures", pictures, "Looked at in each")->capture_default_str();
  app.add_option("--show", show, "How many of the worst")->capture_default_str();
  app.add_option("--out", out, "Folder for the pictures of the worst");
  app.add_flag("--all", all, "Prints every picture looked at");
  bool broken = false;
  const int status = cli::run_tool(app, argc, argv, [&] {
    std::vector<int> looked_at{0,  1,  2,  3,  4,   5,   6,   8,   10,  12,  15,   20,   25,  30,
                               40, 50, 60, 80, 100, 150, 200, 300, 400, 600, 1000, 1500, 2000};
    std::erase_if(looked_at, [&](int p) { return p > pictures; });
    std::vector<Found> worst;
    if (!out.empty()) std::filesystem::create_directories(out);  // a search is long, and should not end without it
    double gain = 0, least = 0;
    size_t measured = 0, below = 0;
    for (uint64_t seed = first; seed < first + situations; seed++) {
      const lf::focus::Situation s = lf::focus::random_situation(seed);
      Found found{seed, s.text, lf::focus::watch(s, looked_at)};
      if (found.watched.worst < 0) continue;
      measured++;
      const lf::focus::Seen& last = found.watched.seen.back();
      gain += last.surface_db - last.plane_db;
      least = std::min(least, found.watched.lead());
      if (found.watched.lead() < kLaw) below++;
      if (all) {
        print(found);
        for (const lf::focus::Seen& at : found.watched.seen)
          std::printf(" %d:%+.2f", at.picture, at.surface_db - at.plane_db);
        std::printf("\n");
      }
      worst.push_back(std::move(found));
      std::ranges::sort(worst, {}, [](const Found& f) { return f.watched.lead(); });
      if (worst.size() > show) worst.pop_back();
      // A search takes the better part of an hour: who stops it knows what it has found.
      if (measured % 20 == 0)
        std::fprintf(stderr, "seeds %llu to %llu: %zu below the law, the worst by %.2f dB\n",
                     static_cast<unsigned long long>(first), static_cast<unsigned long long>(seed), below, least);
    }
    for (const Found& f : worst) {
      print(f);
      if (out.empty()) continue;
      const std::string stem = out + "/" + std::to_string(f.seed);
      lf::save_image(f.watched.truth, stem + "_truth.png");
      lf::save_image(f.watched.plane, stem + "_plane.png");
      lf::save_image(f.watched.surface, stem + "_surface.png");
    }
    broken = below > 0;
    std::printf(
        "%zu situations measured: %zu below the law of %.1f dB, the worst by %.2f dB; at last %+.2f dB in the mean\n",
        measured, below, kLaw, least, measured > 0 ? gain / static_cast<double>(measured) : 0);
  });
  return status != 0 ? status : broken;
}
