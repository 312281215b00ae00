// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/film_length.h"

#include "support/temp_dir.h"
#include "support/test.h"

namespace lf {
namespace {

std::string id_bytes(uint32_t id) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8)
    if (id >> shift) bytes += static_cast<char>(id >> shift & 0xFF);
  return bytes;
}

std::string element(uint32_t id, const std::string& content) {
  std::string bytes = id_bytes(id) + '\x08';  // a size of five bytes
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(content.size() >> shift & 0xFF);
  return bytes + content;
}

std::string element(uint32_t id, uint8_t value) { return element(id, std::string(1, static_cast<char>(value))); }

// A film with a sound track, and clusters of ten frames, 40 ms each.
std::string film(int frames, bool has_size = true) {
  const std::string sound = element(0xAE, element(0xD7, 1) + element(0x83, 2));
  const std::string video = element(0xAE, element(0xD7, 2) + element(0x83, 1));
  std::string content = element(0x1549A966, element(0x2AD7B1, std::string("\x0F\x42\x40", 3)));
  content += element(0x1654AE6B, sound + video);
  for (int first = 0; first < frames; first += 10) {
    const int time = 40 * first;
    std::string cluster = element(0xE7, std::string{static_cast<char>(time >> 8), static_cast<char>(time)});
    for (int i = 0; i < std::min(10, frames - first); i++) {
      const std::string header = {static_cast<char>(40 * i >> 8), static_cast<char>(40 * i), 0};
      cluster += element(0xA3, "\x81" + header + "sound");
      const std::string block = "\x82" + header + std::string(100, 'x');
      cluster += i % 2 ? element(0xA3, block) : element(0xA0, element(0xA1, block));
    }
    content += has_size ? element(0x1F43B675, cluster) : id_bytes(0x1F43B675) + "\xFF" + cluster;
  }
  const std::string start = element(0x1A45DFA3, "header");
  return start +
         (has_size ? element(0x18538067, content) : id_bytes(0x18538067) + "\x01" + std::string(7, '\xFF') + content);
}

class MatroskaLength : public testing::Test {
 protected:
  std::optional<FilmLength> length_of(const std::string& bytes) {
    return matroska_length(dir_.write("film.mkv", bytes));
  }
  TempDir dir_;
};

TEST_F(MatroskaLength, CountsTheFramesOfTheVideo) {
  for (const bool has_size : {true, false}) {
    const auto length = length_of(film(25, has_size)).value();
    EXPECT_EQ(length.frames, 25u);
    EXPECT_NEAR(length.seconds, 1, 1e-9);
    EXPECT_FALSE(length.is_cut_off);
  }
}

TEST_F(MatroskaLength, DetectsTruncatedFiles) {
  const std::string whole = film(25);
  const auto length = length_of(whole.substr(0, whole.size() * 3 / 5)).value();
  EXPECT_TRUE(length.is_cut_off);
  EXPECT_GT(length.frames, 10u);
  EXPECT_LT(length.frames, 20u);
  EXPECT_NEAR(length.seconds, 0.04 * static_cast<double>(length.frames), 1e-9);
  const auto unfinished = film(25, false);
  EXPECT_TRUE(length_of(unfinished.substr(0, unfinished.size() - 50))->is_cut_off);
}

TEST_F(MatroskaLength, SurvivesDamage) {
  EXPECT_FALSE(matroska_length(dir_ / "none.mkv"));
  EXPECT_FALSE(matroska_length(dir_.path()));
  EXPECT_FALSE(length_of(""));
  EXPECT_FALSE(length_of(film(0)));
  const std::string whole = film(12);
  for (size_t size = 0; size < whole.size(); size += 11)
    EXPECT_LE(length_of(whole.substr(0, size)).value_or(FilmLength{}).frames, 12u);
  std::mt19937 random(7);
  for (int i = 0; i < 200; i++) {
    std::string damaged = whole;
    for (int k = 0; k < 3; k++) damaged[random() % damaged.size()] = static_cast<char>(random());
    length_of(damaged);
  }
}

std::vector<std::string> compare(const std::vector<FilmLength>& lengths) {
  std::vector<Film> films;
  for (const FilmLength& length : lengths)
    films.push_back({std::string(1, static_cast<char>('a' + films.size())), length});
  std::vector<std::string> texts;
  for (const RigFinding& finding : compare_film_lengths(films)) texts.push_back(finding.text);
  return texts;
}

TEST(FilmLengths, NamesADifferentFilm) {
  EXPECT_THAT(compare({}), IsEmpty());
  EXPECT_THAT(compare({{60, 2}, {60, 2}, {60, 2}}), IsEmpty());
  EXPECT_THAT(compare({{60, 2}, {30, 1}, {60, 2}}),
              ElementsAre(mentions("b has", "30 frames", "1.00 s", "60", "2.00 s")));
  EXPECT_THAT(compare({{60, 2}, {60, 2}, {59, 59 / 30.0}}), ElementsAre(mentions("c has", "59 frames", "1.97 s")));
  EXPECT_THAT(compare({{60, 2}, {60, 2}, {90, 3}}), ElementsAre(mentions("c has", "90 frames", "3.00 s")));
  EXPECT_THAT(compare({{60}, {40}, {60}}), ElementsAre(mentions("b has", "40 frames", "60")));
  EXPECT_THAT(compare({{60, 2}, {31, 1.03, true}}),
              ElementsAre(mentions("b is", "truncated", "31 frames", "1.03 s", "60", "2.00 s")));
  EXPECT_THAT(compare({{60, 2, true}}), ElementsAre(mentions("a is", "truncated", "60 frames", "2.00 s")));
}

TEST(FilmLengths, ToleratesSmallDifferencesOfFreeRunningCameras) {
  EXPECT_THAT(compare({{60, 2}, {59, 59 / 30.0}, {61, 61 / 30.0}, {58, 58 / 30.0}}), IsEmpty());
  EXPECT_THAT(compare({{60, 2}, {59, 59 / 30.0}}), IsEmpty());
  EXPECT_THAT(compare({{60, 2}, {30, 2}, {60, 2}, {30, 2}}), IsEmpty()) << "other frame rates, same duration";
  EXPECT_THAT(compare({{60, 2}, {50, 2}, {60, 2}}), IsEmpty()) << "lost frames";
}

TEST(FilmLengths, CountsManyFindings) {
  std::vector<FilmLength> lengths(21, {60, 2});
  for (size_t i = 0; i < 10; i++) lengths[i] = {30, 1};
  const std::vector<std::string> texts = compare(lengths);
  ASSERT_EQ(texts.size(), 9u);
  EXPECT_MENTIONS(texts.back(), "2 more", "truncated");
}

}  // namespace
}  // namespace lf
