// SPDX-License-Identifier: LGPL-2.1-or-later
#include "serve/surface_sender.h"

#include "compositor/view_meta.h"
#include "support/test.h"
#include "wire/surface_codec.h"

namespace lf::serve {
namespace {

constexpr int kWidth = 640, kHeight = 480, kStep = 8;
constexpr double kEyeDistance = 0.063;  // metres

GValue array_of(const std::vector<double>& numbers) {
  GValue array = G_VALUE_INIT, value = G_VALUE_INIT;
  g_value_init(&array, GST_TYPE_ARRAY);
  g_value_init(&value, G_TYPE_DOUBLE);
  for (const double number : numbers) {
    g_value_set_double(&value, number);
    gst_value_array_append_value(&array, &value);
  }
  return array;
}

void put(GstStructure* to, const char* field, const std::vector<double>& numbers) {
  GValue array = array_of(numbers);
  gst_structure_take_value(to, field, &array);
}

void put(GstStructure* to, const char* field, GstStructure* part) {
  gst_structure_set(to, field, GST_TYPE_STRUCTURE, part, nullptr);
  gst_structure_free(part);
}

struct FreeStructure {
  void operator()(GstStructure* structure) const { gst_structure_free(structure); }
};
using StructurePtr = std::unique_ptr<GstStructure, FreeStructure>;

// The meta of a picture from position (x, 0, 0). The levels of the surface have noise, so that they need bits.
StructurePtr picture(double x, uint32_t noise = 0) {
  GstStructure* lens = gst_structure_new("lightfield-lens", "model", G_TYPE_STRING, "SIMPLE_PINHOLE", "width",
                                         G_TYPE_INT, kWidth, "height", G_TYPE_INT, kHeight, nullptr);
  put(lens, "params", {500, 319.5, 239.5});
  const int columns = kWidth / kStep, rows = kHeight / kStep;
  std::vector<uint8_t> levels;
  for (int i = 0; i < columns * rows; i++)
    levels.push_back(
        static_cast<uint8_t>(100 + i % columns + ((noise + static_cast<uint32_t>(i)) * 2654435761u >> 30)));
  g_autoptr(GBytes) bytes = g_bytes_new(levels.data(), levels.size());
  GstStructure* map = gst_structure_new("lightfield-focal-map", "step", G_TYPE_INT, kStep, "columns", G_TYPE_INT,
                                        columns, "rows", G_TYPE_INT, rows, "inverse-farthest", G_TYPE_DOUBLE, 0.1,
                                        "inverse-nearest", G_TYPE_DOUBLE, 1.0, "levels", G_TYPE_BYTES, bytes, nullptr);
  put(map, "from", {0, 0, 1, 0});
  GstStructure* focus = gst_structure_new("lightfield-focus", "mode", G_TYPE_STRING, "surface", nullptr);
  put(focus, "plane", {0, 0, 1, -2});
  put(focus, "map", map);
  StructurePtr made(gst_structure_new_empty("lightfield-view"));
  put(made.get(), "position", {x, 0, 0});
  put(made.get(), "orientation", {1, 0, 0, 0});
  put(made.get(), "lens", lens);
  put(made.get(), "focus", focus);
  return made;
}

// The meta of a stereo pair.
StructurePtr pair(double x) {
  StructurePtr made = picture(x);
  GValue views = G_VALUE_INIT, one = G_VALUE_INIT;
  g_value_init(&views, GST_TYPE_ARRAY);
  g_value_init(&one, GST_TYPE_STRUCTURE);
  for (const double eye : {x, x + kEyeDistance}) {
    gst_value_set_structure(&one, picture(eye).get());
    gst_value_array_append_value(&views, &one);
  }
  g_value_unset(&one);
  gst_structure_take_value(made.get(), "views", &views);
  return made;
}

TEST(SurfaceSender, ReadsTheViewsOfAPair) {
  const StructurePtr both = pair(0.25);
  const std::vector<PictureView> views = views_of_picture(both.get());
  ASSERT_EQ(views.size(), 2u);
  for (const size_t i : {0, 1}) EXPECT_EQ(views[i].view.pose.position.x, i == 0 ? 0.25 : 0.25 + kEyeDistance);
  EXPECT_TRUE(views[1].view.focus.map);
}

TEST(SurfaceSender, ReadsTheViewOfAPicture) {
  const std::vector<PictureView> views = views_of_picture(picture(0.25).get());
  ASSERT_EQ(views.size(), 1u);
  const View* const view = &views[0].view;
  EXPECT_EQ(view->pose.position.x, 0.25);
  EXPECT_EQ(view->lens, Lens::pinhole(500, 319.5, 239.5));
  ASSERT_TRUE(view->focus.map);
  EXPECT_EQ(view->focus.map->columns, kWidth / kStep);
  EXPECT_EQ(view->focus.map->inverse_of(0), 0.1);
}

TEST(SurfaceSender, InvalidFieldsGiveNoView) {
  for (const char* field : {"position", "orientation", "lens", "focus"}) {
    const StructurePtr bad = picture(0);
    gst_structure_set(bad.get(), field, G_TYPE_STRING, "nothing", nullptr);
    EXPECT_THAT(views_of_picture(bad.get()), IsEmpty()) << field;
  }
  const StructurePtr no_levels = picture(0);
  const GstStructure* focus = gst_value_get_structure(gst_structure_get_value(no_levels.get(), "focus"));
  StructurePtr changed(gst_structure_copy(focus));
  put(changed.get(), "map", gst_structure_new_empty("lightfield-focal-map"));
  put(no_levels.get(), "focus", changed.release());
  EXPECT_THAT(views_of_picture(no_levels.get()), IsEmpty()) << "a map without levels";
  const StructurePtr huge = picture(NAN);
  EXPECT_THAT(views_of_picture(huge.get()), IsEmpty());
}

TEST(SurfaceSender, MovingViewsKeepTheirShareOfTheBits) {
  for (const auto& [video, eyes] : {std::pair{2000, 1}, {6000, 1}, {20000, 1}, {20000, 2}}) {
    SurfaceSender sender;
    size_t sum = 0, messages = 0;
    constexpr int kPictures = 300;
    for (int i = 0; i < kPictures; i++) {
      const StructurePtr shown = eyes == 1 ? picture(1e-3 * i, static_cast<uint32_t>(i)) : pair(1e-3 * i);
      for (const auto& bytes : sender.messages(shown.get(), static_cast<uint32_t>(i), video)) {
        messages++;
        sum += bytes.size() + SurfaceSender::kPacketBytes;
        const auto surface = wire::decode_surface(bytes);
        ASSERT_TRUE(surface);
        EXPECT_EQ(surface->timestamp, static_cast<uint32_t>(i));
        EXPECT_LT(surface->view, eyes);
        EXPECT_EQ(surface->pose.position.x, 1e-3 * i + surface->view * kEyeDistance);
      }
    }
    const double share = SurfaceSender::kShare * static_cast<double>(video) * kPictures;
    EXPECT_LE(static_cast<double>(sum), share + eyes * SurfaceSender::kMaxBytes) << video;
    EXPECT_GE(static_cast<double>(sum), 0.2 * share) << video;
    EXPECT_GE(messages, static_cast<size_t>(eyes * (video > 2000 ? 290 : 150))) << video;
  }
}

TEST(SurfaceSender, RestingViewsGetTheFullResolutionOnce) {
  SurfaceSender sender;
  constexpr uint32_t kFrame = 3000;  // RTP time of a frame
  for (uint32_t i = 0; i < 30; i++) sender.messages(picture(1e-3 * i).get(), kFrame * i, 2500);
  std::vector<wire::PictureSurface> sent;
  for (uint32_t i = 30; i < 230; i++)
    for (const auto& bytes : sender.messages(picture(0.029).get(), kFrame * i, 700))
      sent.push_back(*wire::decode_surface(bytes));
  ASSERT_FALSE(sent.empty());
  EXPECT_LE(sent.size(), 8u) << "an unchanged surface is repeated rarely";
  for (const auto& surface : sent) EXPECT_EQ(surface.step, kStep);
}

}  // namespace
}  // namespace lf::serve
