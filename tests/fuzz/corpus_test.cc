// SPDX-License-Identifier: LGPL-2.1-or-later
// Runs every fuzz target on its seeds, on new inputs that tests/fuzz.sh has found (corpus/), and on truncated and
// corrupted copies of both.
#include "fuzz/fuzz.h"
#include "fuzz/gst_start.h"
#include "fuzz/seeds.h"
#include "support/test.h"

namespace lf::fuzz {
namespace {

constexpr int kChanges = 24, kCuts = 8;  // per input

std::vector<std::filesystem::path> inputs_of(const std::string& target) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(LF_SOURCE_ROOT "/tests/fuzz/corpus/" + target))
    paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  return paths;
}

class Corpus : public testing::TestWithParam<std::string> {
 protected:
  // Exactly as long as the data, so that a sanitizer detects reads beyond the end.
  static void run(Bytes bytes) {
    bytes.shrink_to_fit();
    EXPECT_NO_THROW(targets().at(GetParam())(bytes.data(), bytes.size()));
  }
  // Runs truncated and corrupted copies.
  static void run_damaged(const Bytes& whole, std::minstd_rand& random) {
    run(whole);
    if (whole.empty()) return;
    for (int i = 0; i < kChanges; i++) {
      Bytes changed = whole;
      for (int k = 0; k <= i % 3; k++) changed[random() % changed.size()] ^= static_cast<uint8_t>(1u << random() % 8);
      run(std::move(changed));
    }
    for (int i = 0; i < kCuts; i++)
      run({whole.begin(), whole.begin() + static_cast<ptrdiff_t>(random() % whole.size())});
  }
};

TEST_P(Corpus, ReplaysWithoutFailures) {
  std::minstd_rand random(1);
  const std::map<std::string, std::vector<Bytes>> all = seeds();
  ASSERT_TRUE(all.count(GetParam()));
  for (const Bytes& seed : all.at(GetParam())) run_damaged(seed, random);
  const std::vector<std::filesystem::path> paths = inputs_of(GetParam());
  ASSERT_FALSE(paths.empty());
  for (const std::filesystem::path& path : paths) {
    SCOPED_TRACE(path.filename());
    run_damaged(read_bytes(path), random);
  }
}

// Returns folder names: targets register only when the program runs.
std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const auto& entry : std::filesystem::directory_iterator(LF_SOURCE_ROOT "/tests/fuzz/corpus"))
    all.push_back(entry.path().filename());
  std::sort(all.begin(), all.end());
  return all;
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Corpus, testing::ValuesIn(names()), [](const auto& info) { return info.param; });

TEST(Fuzz, EveryTargetHasACorpus) {
  for (const auto& [name, target] : targets())
    EXPECT_TRUE(std::filesystem::is_directory(LF_SOURCE_ROOT "/tests/fuzz/corpus/" + name)) << name;
}

}  // namespace
}  // namespace lf::fuzz

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  lf::fuzz::start_gst();
  return RUN_ALL_TESTS();
}
