// SPDX-License-Identifier: LGPL-2.1-or-later
// How near to the best possible: 8x8 cameras, 100 places, 0.2 pixels of noise, over seeds: LF_SEEDS=FIRST-LAST, 1-20
// without. LF_RESULTS=FILE keeps each seed's figures, a line each: seeds that are in it already are not run again, so
// that a long run can be stopped and taken up, or shared by several processes.
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "calibration/accuracy.h"

namespace lf::sim {
namespace {

constexpr int kMany = 500;  // runs after which the scatter of arrays, whose cameras err together, is small

struct Seeds {
  int first = 1, last = 20;
};
Seeds seeds() {
  Seeds s;
  const char* text = std::getenv("LF_SEEDS");
  if (text && std::sscanf(text, "%d-%d", &s.first, &s.last) != 2) ADD_FAILURE() << "LF_SEEDS must be FIRST-LAST";
  return s;
}

std::string to_line(const Errors& e) {
  std::ostringstream line;
  line.precision(9);
  line << e.converged << ' ' << e.seconds << ' ' << e.cameras << ' ' << e.transfers;
  for (const double v : e.squared) line << ' ' << v;
  for (const double v : e.bound) line << ' ' << v;
  for (const double v : e.inside) line << ' ' << v;
  return line.str();
}
bool from_line(std::istream& line, Errors& e) {
  e.runs = 1;
  line >> e.converged >> e.seconds >> e.cameras >> e.transfers;
  for (double& v : e.squared) line >> v;
  for (double& v : e.bound) line >> v;
  for (double& v : e.inside) line >> v;
  return !line.fail();
}

// Lines of "NAME SEED figures".
class Results {
 public:
  explicit Results(const std::string& name) : name_(name) {
    const char* path = std::getenv("LF_RESULTS");
    if (!path) return;
    std::ifstream in(path);
    for (std::string text; std::getline(in, text);) {
      std::istringstream line(text);
      std::string study;
      int seed = 0;
      Errors errors;
      if (line >> study >> seed && study == name_ && from_line(line, errors)) of_seed_[seed] = errors;
    }
    out_.open(path, std::ios::app);
  }
  bool has(int seed) const { return of_seed_.contains(seed); }
  void add(int seed, const Errors& errors) {
    of_seed_[seed] = errors;
    if (out_.is_open()) out_ << name_ + " " + std::to_string(seed) + " " + to_line(errors) + "\n" << std::flush;
  }
  const std::map<int, Errors>& all() const { return of_seed_; }

 private:
  std::string name_;
  std::map<int, Errors> of_seed_;
  std::ofstream out_;
};

Errors run(const char* name, const Study& study) {
  Results results(name);
  const Seeds range = seeds();
  std::vector<int> open;
  for (int seed = range.first; seed <= range.last; seed++)
    if (!results.has(seed)) open.push_back(seed);
  std::atomic<size_t> next = 0;
  std::mutex mutex;
  const auto work = [&] {
    for (size_t i = next++; i < open.size(); i = next++) {
      const Errors errors = run_seed(study, static_cast<uint64_t>(open[i]));
      const std::lock_guard lock(mutex);
      results.add(open[i], errors);
      if (results.all().size() % 50 == 0) std::fprintf(stderr, "%s: %zu seeds\n", name, results.all().size());
    }
  };
  {
    std::vector<std::jthread> workers;
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); i++) workers.emplace_back(work);
    work();
  }
  Errors errors;
  for (const auto& [seed, of_seed] : results.all()) {
    if (seed < range.first || seed > range.last) continue;
    errors += of_seed;
    if (!of_seed.converged) std::printf("%s: seed %d did not converge\n", name, seed);
  }
  std::printf("%-9s error/bound: position %.3f rotation %.3f focal %.3f transfer %.3f; inside 95 %%: %.3f %.3f %.3f\n",
              name, errors.ratio(Errors::kPosition), errors.ratio(Errors::kRotation), errors.ratio(Errors::kFocal),
              errors.ratio(Errors::kTransfer), errors.share_inside(Errors::kPosition),
              errors.share_inside(Errors::kRotation), errors.share_inside(Errors::kFocal));
  std::printf(
      "%-9s rms: %.3f mm, %.3f mrad, f %.3f px; transfer %.4f px at 1.5 m; slowest %.2f s; %d of %d converged\n", "",
      errors.rms(Errors::kPosition) * 1e3, errors.rms(Errors::kRotation) * 1e3, errors.rms(Errors::kFocal),
      errors.rms(Errors::kTransfer), errors.seconds, errors.converged, errors.runs);
  return errors;
}

void expect_good(const Errors& errors) {
  EXPECT_EQ(errors.converged, errors.runs);
  const bool many = errors.runs >= kMany;
  for (const auto q : {Errors::kPosition, Errors::kRotation, Errors::kFocal}) {
    EXPECT_LE(errors.ratio(q), 1.1) << q;
    EXPECT_GE(errors.share_inside(q), many ? 0.93 : 0.9) << q;
    EXPECT_LE(errors.share_inside(q), many ? 0.97 : 0.99) << q;
  }
  EXPECT_LE(errors.ratio(Errors::kTransfer), 1.1);
}

TEST(Accuracy, OneLightAndLensesMeasuredBefore) {
  const Errors errors = run("prior", {});
  expect_good(errors);
  EXPECT_LE(errors.rms(Errors::kTransfer), 0.05);
}

TEST(Accuracy, ABarAndNoLensKnown) {
  Study study;
  study.path.bar = 0.3, study.prior = false;
  const Errors errors = run("bar", study);
  expect_good(errors);
  EXPECT_LE(errors.rms(Errors::kTransfer), 0.05);
}

// 60 % of the observations: the bound is farther off.
TEST(Accuracy, AThirdMissedAndManyMistaken) {
  Study study;
  study.path.missed = 0.3, study.path.outliers = 0.15;
  expect_good(run("outliers", study));
}

}  // namespace
}  // namespace lf::sim
