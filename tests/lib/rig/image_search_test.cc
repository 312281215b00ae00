// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rig/exchange.h"

#include <gtest/gtest.h>

#include "support/expect_error.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

TEST(ImageSearch, FindsByNameAndByEndOfName) {
  const TempDir dir;
  for (const char* name : {"1.jpg", "11.jpg", "20.23.45.jpg", "left/a.png", "right/a.png", "left/b.png", "x_c.png"})
    dir.write(name, "");
  const ImageSearch search(dir.path());
  struct {
    const char* name;
    const char* file;
  } const cases[] = {
      {"1.jpg", "1.jpg"},
      {"11.jpg", "11.jpg"},
      {"./left/../1.jpg", "1.jpg"},
      {"left/a.png", "left/a.png"},
      {"2021-05-19 20.23.45.jpg", "20.23.45.jpg"},
      {"b.png", "left/b.png"},
      {"images/left/b.png", "left/b.png"},
      {"c.png", "x_c.png"},
      {"frame 1.jpg", "1.jpg"},
  };
  for (const auto& c : cases) EXPECT_EQ(search.find(c.name), dir / c.file) << c.name;
}

TEST(ImageSearch, RefusesWhatIsNotThereOrNotSure) {
  const TempDir dir;
  for (const char* name : {"1.jpg", "left/a.png", "right/a.png", "x_c.png", "y_c.png"}) dir.write(name, "");
  const ImageSearch search(dir.path());
  EXPECT_ERROR(search.find("2.jpg"), dir.path() + ": no image file for \"2.jpg\"");
  EXPECT_ERROR(search.find("21.jpg"), "no image file for \"21.jpg\"");  // 1.jpg is not the end of a word of it
  EXPECT_ERROR(search.find("a.png"), "more than one image file for \"a.png\": left/a.png, right/a.png");
  EXPECT_ERROR(search.find("c.png"), "more than one image file for \"c.png\"");
  EXPECT_ERROR(search.find(""), "no image file");
  EXPECT_ERROR(ImageSearch(dir / "none"), "none: can't be read");
  EXPECT_ERROR(ImageSearch(dir / "1.jpg"), "1.jpg: can't be read");
}

TEST(ImageSearch, LongNamesAreNoWork) {
  const TempDir dir;
  dir.write("1.jpg", "");
  const ImageSearch search(dir.path());
  EXPECT_ERROR(search.find(std::string(1 << 20, ' ') + "1.jpg"), "no image file for");
}

}  // namespace
}  // namespace lf
