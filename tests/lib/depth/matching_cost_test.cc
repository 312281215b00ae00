// SPDX-License-Identifier: LGPL-2.1-or-later
#include "depth/matching_cost.h"

#include "reference/generators.h"
#include "support/every_target.h"
#include "support/test.h"

namespace lf {
namespace {

using reference::Random;

MatchingImage random_image(Random& random, int width, int height) {
  MatchingImage image;
  image.width = width;
  image.height = height;
  image.focal = random.uniform(0.8, 1.5) * width;
  image.centre = {width / 2.0, height / 2.0};
  image.pose = Pose(random.point_in_box(0.2), random.small_rotation(0.1));
  for (int i = 0; i < width * height; i++)
    image.pixels.push_back({static_cast<int16_t>(random.integer(0, 255 * MatchingImage::kUnit)),
                            static_cast<int16_t>(random.integer(-127, 127) * MatchingImage::kUnit),
                            static_cast<int16_t>(random.integer(-127, 127) * MatchingImage::kUnit),
                            random.integer(0, 99) == 0 ? MatchingImage::kUnseen : int16_t{0}});
  return image;
}

// The cost as its documentation says, in double precision. NaN: rounding decides whether the point is seen.
double plain_cost(const MatchingImage& image, const std::vector<const MatchingImage*>& neighbours, int x, int y,
                  double inverse) {
  std::vector<double> costs;
  for (const MatchingImage* other : neighbours) {
    costs.push_back(MatchingCost::kMax);
    const Vec3 in_camera = image.pose.rotation() * image.ray(x, y);
    const Vec3 at =
        glm::transpose(other->pose.rotation()) * (in_camera + inverse * (image.pose.position - other->pose.position));
    if (at.z < 1e-3) {
      if (at.z > -1e-3) return std::nan("");
      continue;
    }
    const Vec2 pixel = other->focal * Vec2(at) / at.z + other->centre;
    const double beyond = std::min({pixel.x, pixel.y, other->width - 1 - pixel.x, other->height - 1 - pixel.y});
    if (std::abs(beyond) < 1e-3) return std::nan("");
    if (beyond < 0) continue;
    const int column = static_cast<int>(pixel.x), row = static_cast<int>(pixel.y);
    const double right = pixel.x - column, down = pixel.y - row;
    const auto value = [&](int k) {
      const auto corner = [&](int i, int j) {
        return static_cast<double>(other->pixels[static_cast<size_t>(row + j) * other->width + column + i][k]);
      };
      return ((1 - down) * ((1 - right) * corner(0, 0) + right * corner(1, 0)) +
              down * ((1 - right) * corner(0, 1) + right * corner(1, 1))) /
             MatchingImage::kUnit;
    };
    const MatchingImage::Pixel& own = image.pixels[static_cast<size_t>(y) * image.width + x];
    double cost = 0;
    for (int k = 0; k < 3; k++)
      cost += std::min(std::abs(value(k) - own[k] / static_cast<double>(MatchingImage::kUnit)),
                       static_cast<double>(k == 0 ? MatchingCost::kMaxLuma : MatchingCost::kMaxGradient)) /
              2;
    if (value(3) > 20) cost = MatchingCost::kMax;
    if (value(3) > 0 && value(3) <= 20) return std::nan("");  // barely touches an unseen pixel
    costs.back() = std::min(cost, static_cast<double>(MatchingCost::kMax));
  }
  std::ranges::sort(costs);
  const size_t best = (costs.size() + 1) / 2;
  double sum = 0;
  for (size_t i = 0; i < best; i++) sum += costs[i];
  return sum / static_cast<double>(best);
}

TEST(MatchingCost, IsThatOfTheDefinition) {
  for (const int count : {1, 2, 4, 5, 6, 8}) {
    Random random(count);
    const MatchingImage image = random_image(random, 61, 23);
    std::vector<MatchingImage> others;
    for (int i = 0; i < count; i++) others.push_back(random_image(random, 40 + 7 * i, 30));
    std::vector<const MatchingImage*> neighbours;
    for (const MatchingImage& other : others) neighbours.push_back(&other);
    std::vector<float> inverse(image.size()), cost(image.size());
    for (float& value : inverse) value = static_cast<float>(random.uniform(0, 3));

    MatchingCost(image, neighbours).compute(inverse, cost);
    int compared = 0, below = 0;
    for (int y = 0; y < image.height; y++)
      for (int x = 0; x < image.width; x++) {
        const size_t i = static_cast<size_t>(y) * image.width + x;
        const double plain = plain_cost(image, neighbours, x, y, inverse[i]);
        if (std::isnan(plain)) continue;
        // Random pixels differ by up to 255 levels, so that an error of 1e-3 pixels is up to half a level.
        EXPECT_NEAR(cost[i], plain, 0.5) << x << ", " << y << " with " << count;
        compared++;
        below += plain < MatchingCost::kMax - 0.5;
      }
    EXPECT_GT(compared, image.width * image.height / 2);
    EXPECT_GT(below, 20) << "the test compares more than the largest cost";
  }
}

TEST(MatchingCost, IsIdenticalWithEveryInstructionSet) {
  Random random(7);
  const MatchingImage image = random_image(random, 67, 31), other = random_image(random, 70, 33);
  const MatchingImage third = random_image(random, 50, 40);
  const MatchingImage* const neighbours[] = {&other, &third};
  std::vector<float> inverse(image.size()), first;
  for (float& value : inverse) value = static_cast<float>(random.uniform(0, 2));
  test::on_every_target([&] {
    std::vector<float> cost(image.size());
    MatchingCost(image, neighbours).compute(inverse, cost);
    if (first.empty()) first = cost;
    EXPECT_EQ(cost, first);
  });
}

TEST(MatchingCost, IsZeroForTheSameImage) {
  Random random(9);
  MatchingImage image = random_image(random, 32, 16);
  for (MatchingImage::Pixel& pixel : image.pixels) pixel[3] = 0;
  const MatchingImage* const neighbours[] = {&image};
  std::vector<float> inverse(image.size(), 0.5f), cost(image.size());
  MatchingCost(image, neighbours).compute(inverse, cost);
  for (int y = 1; y < image.height - 1; y++)
    for (int x = 1; x < image.width - 1; x++) EXPECT_LT(cost[static_cast<size_t>(y) * image.width + x], 0.05f);
}

}  // namespace
}  // namespace lf
